// Replaces pieces of the page as the coordinator sends them, and fetches each new picture. The page is complete without
// it.
"use strict";

const at = (id) => document.getElementById(id);
const shown = at("shown"), exposure = at("exposure"), view = at("view"), tone = at("tone"), white = at("white"), zoom = at("zoom");
const name = document.querySelector("h1").textContent;

let available = 0;   // passes of the newest picture on the coordinator
let wanted = "";     // address of the picture to show
let there = "";      // address of the picture shown
let current = null;  // the picture shown
let fetching = false;

function say(text, calm) {
  at("connection").textContent = text;
  at("connection").classList.toggle("calm", Boolean(calm));
}

function describe(passes) {
  const which = passes === 1 ? "pass 0" : `passes 0 to ${passes - 1}`;
  if (view.value === "error") return `Error of ${which}`;
  const words = view.value === "image" ? "" : `, ${view.selectedOptions[0].textContent}`;
  const kelvin = Number(white.value) !== 6500 && !white.disabled ? `, ${white.value} K` : "";
  const curve = tone.value !== "standard" && !tone.disabled ? `, ${tone.value}` : "";
  return `${which[0].toUpperCase()}${which.slice(1)}${words} at ${exposure.value} EV${kelvin}${curve}`;
}

function look() {
  at("stops").textContent = `${exposure.value} EV`;
  const plain = ["error", "depth", "normal", "albedo", "beam_density", "targets"].includes(view.value);
  for (const control of [exposure, at("darker"), at("brighter")]) control.disabled = plain;
  for (const control of [tone, white]) control.disabled = plain || view.value === "false";
  at("scale").hidden = view.value !== "error";
  if (available > 0) {
    const look = `curve=${tone.value}&white_balance=${encodeURIComponent(white.value)}`;
    const settings = `exposure=${exposure.value}&view=${encodeURIComponent(view.value)}&${look}`;
    wanted = `/image.png?passes=${available}&${settings}`;
    at("png").href = wanted;
    at("exr").href = `/image.exr?passes=${available}`;
    load();
  }
}

// One at a time: a slider requests the next picture when the last has arrived.
async function load() {
  if (fetching || wanted === there) return;
  fetching = true;
  const address = wanted;
  try {
    const answer = await fetch(address);
    if (!answer.ok) throw new Error(await answer.text());
    const passes = Number(answer.headers.get("beamfarm-passes"));
    const caption = describe(passes);
    const blob = await answer.blob();
    const url = URL.createObjectURL(blob);
    const before = shown.src;
    shown.src = url;
    await shown.decode();
    shown.hidden = false;
    shown.alt = caption;
    shown.dataset.passes = passes;
    at("caption").textContent = caption;
    cover();
    if (before.startsWith("blob:")) URL.revokeObjectURL(before);
    there = address;
    current = blob;
  } catch (error) {
    // The next picture comes soon enough.
    wanted = there;
  }
  fetching = false;
  if (wanted !== there) load();
}

const frame = at("frame");
let factor = 0;      // zoom: screen pixels per picture pixel; 0 fits the picture into the frame

function zoomed() {
  shown.classList.toggle("zoomed", factor > 0);
  shown.style.width = factor > 0 ? `${factor * shown.getAttribute("width")}px` : "";
  cover();
}

// Zoom to this factor, keeping what is under the pointer in place.
function zoomTo(to, event) {
  const from = shown.clientWidth / shown.getAttribute("width");
  const box = shown.getBoundingClientRect();
  const [x, y] = [(event.clientX - box.left) / from, (event.clientY - box.top) / from];
  factor = Math.min(Math.max(to, 0.1), 64);
  zoom.value = ["1", "2", "4", "8"].find((step) => Number(step) === factor) ?? "free";
  zoomed();
  const now = shown.getBoundingClientRect();
  frame.scrollBy({ left: now.left + x * factor - event.clientX, top: now.top + y * factor - event.clientY, behavior: "instant" });
}

frame.addEventListener("wheel", (event) => {
  if (shown.hidden || event.deltaY === 0) return;
  event.preventDefault();
  zoomTo(shown.clientWidth / shown.getAttribute("width") * 2 ** (-event.deltaY / 400), event);
}, { passive: false });

// Drag to move a picture that is larger than its frame.
let drag = null;
frame.addEventListener("pointerdown", (event) => {
  if (event.pointerType === "mouse" && factor > 0) {
    drag = { x: event.clientX + frame.scrollLeft, y: event.clientY + frame.scrollTop };
    event.preventDefault();
  }
});
addEventListener("pointermove", (event) => {
  if (drag) frame.scrollTo({ left: drag.x - event.clientX, top: drag.y - event.clientY, behavior: "instant" });
});
addEventListener("pointerup", () => { drag = null; });

// Values of the pixel under the pointer; one request at a time.
let pointed = null, asking = false;
frame.addEventListener("pointermove", (event) => {
  const box = shown.getBoundingClientRect();
  const scale = shown.getAttribute("width") / box.width;
  const [x, y] = [Math.floor((event.clientX - box.left) * scale), Math.floor((event.clientY - box.top) * scale)];
  const inside = x >= 0 && y >= 0 && x < shown.getAttribute("width") && y < shown.getAttribute("height");
  pointed = inside && available > 0 ? `x=${x}&y=${y}&passes=${available}` : null;
  ask();
});
frame.addEventListener("pointerleave", () => { pointed = null; at("value").textContent = ""; });

async function ask() {
  if (asking || pointed === null) return;
  asking = true;
  const question = pointed;
  try {
    const pixel = await (await fetch(`/pixel?${question}`)).json();
    const short = (values) => values.map((value) => value === null ? "?" : Number(value.toPrecision(4))).join(", ");
    const layer = pixel.layers[view.value];
    const place = new URLSearchParams(question);
    at("value").textContent = `Pixel ${place.get("x")}, ${place.get("y")}: ` + (layer
      ? short(layer) : `${short(pixel.radiance)} ± ${short(pixel.standard_error)}`);
  } catch (error) {
    at("value").textContent = "";
  }
  asking = false;
  if (pointed !== question) ask();
}

// A held picture covers the left part of the current one.
const held = at("held");
function cover() {
  if (held.hidden) return;
  held.style.left = `${shown.offsetLeft}px`;
  held.style.top = `${shown.offsetTop}px`;
  held.style.width = `${shown.offsetWidth}px`;
  held.style.height = `${shown.offsetHeight}px`;
  held.style.clipPath = `inset(0 ${100 - Number(at("wipe").value)}% 0 0)`;
}
function hold(blob) {
  if (held.src) URL.revokeObjectURL(held.src);
  held.src = URL.createObjectURL(blob);
  held.hidden = false;
  at("wipe-row").hidden = false;
  cover();
}
at("hold").addEventListener("click", () => {
  if (current !== null) hold(current);
});
at("reference").addEventListener("change", (event) => {
  if (event.target.files.length > 0) hold(event.target.files[0]);
});
at("wipe").addEventListener("input", cover);
addEventListener("resize", cover);

for (const part of ["zooming", "wiping", "darker", "brighter", "extending"]) at(part).hidden = false;
at("apply").hidden = true;
at("controls").addEventListener("submit", (event) => event.preventDefault());
for (const input of [exposure, view, tone, white]) input.addEventListener("input", look);
for (const [button, step] of [["darker", -0.25], ["brighter", 0.25]]) {
  at(button).addEventListener("click", () => {
    exposure.value = Number(exposure.value) + step;
    look();
  });
}
zoom.addEventListener("input", () => {
  factor = zoom.value === "fit" ? 0 : Number(zoom.value);
  zoomed();
});

async function tell(address) {
  at("said").textContent = "…";
  try {
    const answer = await fetch(address, { method: "POST", headers: { accept: "text/plain" } });
    at("said").textContent = `${answer.ok ? "✓" : "✕"} ${await answer.text()}`;
    return answer.ok;
  } catch (error) {
    at("said").textContent = "✕ The coordinator was not reached.";
    return false;
  }
}
at("steering").addEventListener("submit", async (event) => {
  event.preventDefault();
  const address = event.submitter?.getAttribute("formaction") ?? "/write";
  if (address === "/cancel" && !confirm("End the job with the passes that are complete?")) return;
  if (await tell(address) && ["/pause", "/resume"].includes(address)) {
    at("pause").hidden = address === "/pause";
    at("resume").hidden = address === "/resume";
  }
});
at("extend").addEventListener("click", () => tell(`/extend?passes=${Number(at("passes").value)}`));

// The rate of each worker since the page was opened, as a line next to the number. Updates come a second apart.
const rates = new Map();
function drawRates() {
  const seen = new Map();
  for (const row of document.querySelectorAll("#workers tbody tr")) {
    const name = row.querySelector("th").textContent;
    seen.set(name, (seen.get(name) ?? 0) + 1);
    const key = `${name} ${seen.get(name)}`;
    const cell = row.querySelector("td[data-label='Rate']");
    const history = rates.get(key) ?? [];
    history.push(Number.parseFloat(cell.textContent) || 0);
    if (history.length > 120) history.shift();
    rates.set(key, history);
    if (history.length < 2) continue;
    const most = Math.max(...history, 1e-9);
    const points = history.map((rate, i) => `${(60 * i / (history.length - 1)).toFixed(1)},${(15 - 14 * rate / most).toFixed(1)}`);
    const line = `<svg class="rates" viewBox="0 0 60 16" aria-hidden="true"><polyline points="${points.join(" ")}"/></svg>`;
    cell.insertAdjacentHTML("afterbegin", line);
  }
}

const news = new EventSource("/live");
for (const place of ["state", "curve", "workers", "failures", "log", "frames"].filter(at)) {
  news.addEventListener(place, (event) => {
    at(place).innerHTML = event.data;
    if (place === "workers") drawRates();
    const title = at(place).querySelector("[data-title]");
    if (title) document.title = `${title.dataset.title} – ${name}`;
  });
}
news.addEventListener("image", (event) => {
  available = Number(event.data);
  look();
});
// Another frame is first in line: its page has another picture and another name.
news.addEventListener("next", () => {
  news.close();
  location.reload();
});
news.addEventListener("over", () => {
  news.close();
  at("steering").hidden = true;
  say("The job is over: this is how it ended.", true);
});
news.addEventListener("open", () => say(""));
news.addEventListener("error", () => say("No connection to the coordinator. Trying again…"));
