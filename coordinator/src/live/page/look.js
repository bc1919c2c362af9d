// The live view: the server's scene, the picture, and the user's actions on both.

import { element } from "./dom.js";
import { Eye } from "./eye.js";
import { Handles, isLight } from "./handles.js";
import { Keys } from "./keys.js";
import { Panel } from "./panel.js";
import { Picture } from "./picture.js";
import { checkScene } from "./scene.js";
import { Steer } from "./steer.js";
import { Wire } from "./wire.js";

const at = (id) => document.getElementById(id);
const stage = at("stage");
const TOAST = 6000;
const EXPOSURE = "render.exposure";
const DOING = {
  sketch: "sketching", pilot: "choosing how to render", passes: "refining", done: "done", "no workers": "waiting for workers",
};

let scene = null;
let wide = 0;             // useful width of the picture in device pixels
let typesPasses = false;

// Show a message for a while.
function toast(...inside) {
  const close = element("button", { type: "button", "aria-label": "Close" }, "✕");
  const node = element("div", { class: "toast" }, element("span", {}, ...inside), close);
  const hasLink = inside.some((part) => part instanceof HTMLAnchorElement);
  const timer = setTimeout(() => node.remove(), hasLink ? 10 * TOAST : TOAST);
  close.addEventListener("click", () => {
    clearTimeout(timer);
    node.remove();
  });
  const old = [...at("toasts").children];
  for (const same of old.filter((other) => other.firstChild.textContent === node.firstChild.textContent)) same.remove();
  if (old.length > 4) old[0].remove();
  at("toasts").append(node);
}

const wire = new Wire({
  opened() {
    at("connection").hidden = true;
    for (const part of [eye, handles, panel, steer, keys, picture]) part.forget();
    if (wide > 0) wire.tell({ type: "size", width: wide });
  },
  closed(reason, wait) {
    for (const part of [eye, handles, panel, steer, keys]) part.forget();
    at("connection").hidden = false;
    at("lost").textContent = `No connection to the server${reason ? ` (${reason})` : ""}. `
      + `Trying again in ${Math.max(1, Math.round(wait / 1000))} s; until then nothing that you change counts.`;
    at("doing").textContent = "not connected";
    enable();
  },
  scene: hearScene,
  error(message) {
    eye.refused(message.seq);
    handles.refused(message.seq);
    const { path, line } = message;
    if (panel.fail(message)) return;
    const file = scene?.file ?? "the scene";
    const where = Number.isFinite(line) ? `${file}:${line}: ` : `${path ?? file}: `;
    at("wrong").textContent = `${where}${message.message}`;
    at("wrong").hidden = false;
  },
  fine() {
    at("wrong").hidden = true;
    panel.fine();
  },
  state: hearState,
  picked(message) {
    select(message.thing ?? null);
    const { name, material, distance } = message;
    const words = name || message.thing;
    if (!words) say("Nothing is there.");
    else say(words + (Number.isFinite(distance) ? ` · ${distance.toPrecision(3)} away` : ""), material);
  },
  told(message) { toast(String(message.text)); },
  open(message) {
    const url = new URL(message.url, location.href);
    if (!["http:", "https:"].includes(url.protocol)) throw new Error("no address of a page");
    const opened = window.open(url, "_blank");
    if (opened) opened.opener = null;
    const link = element("a", { href: url, target: "_blank", rel: "noopener" }, "Open its page");
    toast(opened ? "The job has begun. " : "The job has begun; the browser did not open its page. ", link);
  },
  frame(header, blob) { picture.take(header, blob); },
});

const handles = new Handles(at("overlay"));
const eye = new Eye(wire, () => handles.look(eye.camera));
const picture = new Picture(stage, at("canvas"), {
  drawn(header) {
    wire.drawn(header);
    at("first").hidden = true;
    at("canvas").dataset.frame = header.frame;
    at("what").textContent = header.passes > 0 ? "average of passes" : `sketch ${header.step + 1} of ${header.steps ?? "?"}`;
    if (header.passes > 0) at("passes").textContent = header.passes;
  },
  done(header) { wire.tell({ type: "drawn", frame: header.frame }); },
  sized(box) { handles.size(box); },
  wanted(width) {
    wide = width;
    wire.tell({ type: "size", width });
  },
});
const panel = new Panel(at("panel"), at("search"), wire, { select: (id) => select(id, true) });
const says = {
  pick([x, y]) { wire.tell({ type: "pick", x, y }); },
  focus([x, y], time) {
    if (eye.fixed === null) wire.changeNow({ type: "focus", x, y }, time);
    else toast(eye.fixed);
  },
  tell: toast,
  select: (id) => select(id),
  handles: toggleHandles,
  expose,
  beside(words) {
    at("beside").hidden = words === null;
    at("beside").textContent = words ?? "";
    if (words !== null) placeBeside();
  },
};
const steer = new Steer(stage, picture, eye, handles, wire, says);
const keys = new Keys(stage, steer, says);

// Next to the pointer, or to the object that keys move.
let pointer = null;
stage.addEventListener("pointermove", (event) => { pointer = event; }, true);
stage.addEventListener("pointerleave", () => { if (steer.drag === null) pointer = null; });
function placeBeside() {
  const box = stage.getBoundingClientRect();
  const thing = steer.drag === null && handles.held ? handles.screen(handles.held.at) : null;
  const place = thing ?? (pointer ? { x: pointer.clientX - box.left, y: pointer.clientY - box.top } : { x: 0, y: 0 });
  const label = at("beside");
  const x = Math.max(0, Math.min(place.x + 22, box.width - label.offsetWidth - 4));
  const y = Math.max(0, Math.min(place.y + 22, box.height - label.offsetHeight - 4));
  label.style.transform = `translate(${x}px, ${y}px)`;
}

function hearScene(message) {
  checkScene(message);
  scene = message;
  eye.hear(scene);
  picture.shape(scene.camera.width, scene.camera.height);
  handles.hear(scene);
  panel.hear(scene);
  at("title").textContent = scene.title || scene.file;
  at("title").title = scene.file;
  at("dirty").hidden = !scene.dirty;
  document.title = `${scene.dirty ? "● " : ""}${scene.title || scene.file} – beamfarm`;
  const exposure = panel.value(EXPOSURE);
  at("exposure").textContent = `${Number(exposure ?? 0)} EV`.replace("-", "−");
  at("png").download = `${scene.title || "beamfarm"}.png`;
  const selected = handles.selected;
  if (selected === null && !at("deselect").hidden && hasThing) select(null);
  enable();
}

function enable() {
  const isOn = scene !== null && wire.isOpen;
  at("undo").disabled = !(isOn && scene.undo);
  at("redo").disabled = !(isOn && scene.redo);
  at("save").disabled = !(isOn && scene.dirty);
  at("revert").disabled = !(isOn && scene.dirty);
  at("render").textContent = scene?.dirty ? "Save and render" : "Render";
  for (const id of ["render", "editor", "darker", "brighter"]) at(id).disabled = !isOn;
}

function hearState({ doing, passes, of, error, workers, seconds }) {
  at("doing").textContent = DOING[doing] ?? String(doing ?? "");
  at("doing").classList.toggle("bad", doing === "no workers");
  if (Number.isFinite(passes)) at("passes").textContent = passes;
  if (Number.isFinite(of)) {
    // The number of passes is known once the settings are.
    if (!typesPasses) at("of").value = of > 0 ? of : "";
    at("count").hidden = !(of > 0 || typesPasses);
    at("progress").value = of > 0 ? Math.min(1, (passes || 0) / of) : 0;
  }
  at("error").textContent = Number.isFinite(error) ? `standard error ${(100 * error).toPrecision(2)} %` : "";
  at("workers").textContent = Number.isFinite(workers) ? `${workers} ${workers === 1 ? "worker" : "workers"}` : "";
  at("workers").title = Number.isFinite(seconds) ? `${seconds.toFixed(1)} s` : "";
}

let hasThing = false;
function say(words, material) {
  at("selection-name").textContent = words;
  at("material").hidden = !material;
  at("material").textContent = material ? `Material ${material}` : "";
  at("material").dataset.name = material ?? "";
  at("material").title = "To its material's fields";
}

// `isOpen`: its fields are already in view.
function select(id, isOpen) {
  const thing = id === null ? undefined : handles.things.get(id);
  hasThing = thing !== undefined;
  handles.select(hasThing ? id : null);
  at("deselect").hidden = !hasThing;
  if (!isOpen) panel.revealThing(hasThing ? id : null);
  if (!hasThing) {
    say("Click a thing to select it.");
    return;
  }
  const words = [thing.name, isLight(thing) ? `${thing.kind} light` : thing.kind];
  if (handles.isOutside(id)) words.push("outside of the picture");
  say(words.join(" · "));
}

function toggleHandles() {
  const showsAll = handles.toggleAll();
  at("handles").setAttribute("aria-pressed", String(showsAll));
}

function expose(by, time) {
  const exposure = Math.round(4 * (Number(panel.value(EXPOSURE) ?? 0) + by)) / 4;
  panel.set(EXPOSURE, exposure, time);
  at("exposure").textContent = `${exposure} EV`.replace("-", "−");
}

// Do nothing if there is no step; changes sent since the last scene may have added one.
function goThrough(type, event) {
  if (scene !== null && (scene[type] || wire.seq > scene.seq)) wire.changeNow({ type }, event.timeStamp);
}

// Actions of the bar's buttons and keys.
const does = {
  undo: (event) => goThrough("undo", event),
  redo: (event) => goThrough("redo", event),
  revert: (event) => wire.changeNow({ type: "revert" }, event.timeStamp),
  save() {
    wire.flush();
    wire.tell({ type: "save" });
  },
  render() {
    wire.flush();
    if (scene?.dirty) wire.tell({ type: "save" });
    wire.tell({ type: "render" });
  },
  editor: () => wire.tell({ type: "editor" }),
  handles: toggleHandles,
  darker: (event) => expose(-0.25, event.timeStamp),
  brighter: (event) => expose(0.25, event.timeStamp),
  help: () => at("keys").showModal(),
  deselect: () => select(null),
  material: () => panel.revealMaterial(at("material").dataset.name),
  again: () => wire.hurry(),
  more() {
    const isOpen = at("bar").classList.toggle("is-open");
    at("more").setAttribute("aria-expanded", String(isOpen));
  },
};
for (const [id, what] of Object.entries(does)) at(id).addEventListener("click", what);

addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase();
  const isWriting = event.target.matches?.("input:not([type=range], [type=checkbox], [type=color]), select, textarea");
  if ((event.ctrlKey || event.metaKey) && !event.altKey) {
    if (key === "s") {
      panel.commit(event);
      does.save();
    } else if (key === "z" || key === "y") {
      // Text being typed has its own undo.
      if (isWriting && panel.isTyping) return;
      (key === "y" || event.shiftKey ? does.redo : does.undo)(event);
    } else {
      return;
    }
    event.preventDefault();
  } else if (!isWriting && !event.altKey && !at("keys").open) {
    if (event.key === "?") does.help();
    else if (event.key === "/") at("search").focus();
    else return;
    event.preventDefault();
  }
});

at("of").addEventListener("input", () => { typesPasses = true; });
at("of").addEventListener("change", () => {
  typesPasses = false;
  const passes = Number(at("of").value);
  if (Number.isSafeInteger(passes) && passes > 0) wire.tell({ type: "passes", passes });
  else toast("Passes are a whole number from 1 on.");
});
addEventListener("online", () => wire.hurry());

enable();
wire.connect();
