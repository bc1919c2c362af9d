// Handles drawn over the picture: for lights, the selected shape and, on request, other shapes.

import { add, axes, cross, dot, edge, length, project, subtract, times, unit } from "./sight.js";

// The most shapes with handles: the largest ones. A smaller limit applies to emissive shapes, which always have
// handles.
const MOST = 200;
const MOST_EMITTERS = 24;
const RING = { least: 34, most: 150 };
// Pixels between the picture's edge and the arrows of lights beyond it, and between the suns in its corner.
const MARGIN = 18;
const SUNS = { first: 52, step: 40 };
// Drawn around (0, 0).
const ICONS = {
  point: "M-5 0a5 5 0 1 0 10 0a5 5 0 1 0-10 0M0-8v-4M0 8v4M-8 0h-4M8 0h4"
    + "M-5.7-5.7l-2.8-2.8M5.7-5.7l2.8-2.8M-5.7 5.7l-2.8 2.8M5.7 5.7l2.8 2.8",
  spot: "M-4-7h8v5h-8zM-4-2L-9 9H9L4-2",
  directional: "M-8-8l5 16M0-8v16M8-8l-5 16M-6 4l3 4 2-4M-2 4l2 4 2-4M1 4l2 4 3-4",
  environment: "M-10 0a10 10 0 1 0 20 0a10 10 0 1 0-20 0M-10 0h20M0-10a5 10 0 0 0 0 20a5 10 0 0 0 0-20",
  light: "M-7-7H7V7H-7zM0 10v4M-4 10l-1 4M4 10l1 4",
  shape: "M0-7L7 0L0 7L-7 0z",
  selected: "M0-9v18M-9 0h18M-3-6l3-3 3 3M-3 6l3 3 3-3M-6-3l-3 3 3 3M6-3l3 3-3 3",
  away: "M-8-6L8 0L-8 6L-4 0z",
  target: "M-6 0a6 6 0 1 0 12 0a6 6 0 1 0-12 0M0-10v6M0 10v-6M-10 0h6M10 0h-6",
};

export const isLight = (thing) => thing.emits || thing.id.startsWith("lights.");
// Lights at infinity, which only turn.
const isSun = (thing) => isLight(thing) && ["directional", "environment"].includes(thing.kind);

// Restrictions on dragging it.
function limits(thing) {
  if (isSun(thing)) return thing.turns ? ": drag to turn" : ", cannot be turned";
  return thing.moves ? "" : ", cannot be moved";
}

function element(name, attributes, parent) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  parent?.append(made);
  return made;
}

export class Handles {
  constructor(svg) {
    this.svg = svg;
    this.lines = element("g", { class: "lines" }, svg);
    this.grips = element("g", {}, svg);
    this.camera = null;
    this.box = null;
    this.things = new Map();
    this.cones = new Map();     // half angles of spots, degrees
    this.chosen = [];           // objects with handles
    this.suns = [];             // lights at infinity without a place in the picture
    this.nodes = new Map();     // their elements
    this.selected = null;
    this.showsAll = false;
    this.moved = new Map();     // where the page has put objects: { point, seq }, by their names in messages
    this.held = null;           // the grip
    this.frame = null;
  }

  hear(scene) {
    this.things = new Map(scene.things.map((thing) => [thing.id, thing]));
    this.cones.clear();
    for (const field of scene.fields) {
      if (field.name !== "cutoff_angle" || field.thing === null) continue;
      const half = Number(field.value ?? field.default);
      this.cones.set(field.thing, Number.isFinite(half) ? half : 20);
    }
    for (const [name, { seq }] of this.moved) {
      if (scene.seq >= seq && this.held?.thing !== name) this.moved.delete(name);
    }
    if (!this.things.has(this.selected)) this.selected = null;
    this.choose();
  }

  refused(seq) {
    for (const [name, moved] of this.moved) {
      if (moved.seq === seq) this.moved.delete(name);
    }
    this.later();
  }

  forget() {
    this.moved.clear();
    this.held = null;
    this.later();
  }

  // Choose what has handles, so that pointer motion does not search all objects.
  choose() {
    const placed = [...this.things.values()].filter((thing) => thing.at !== null);
    const [lights, shapes] = [placed.filter(isLight), placed.filter((thing) => !isLight(thing))];
    const isShape = (thing) => thing.id.startsWith("shapes.");
    const most = this.showsAll ? MOST : MOST_EMITTERS;
    const lamps = lights.filter(isShape).sort((a, b) => b.radius - a.radius).slice(0, most);
    const others = this.showsAll ? shapes.sort((a, b) => b.radius - a.radius).slice(0, MOST) : [];
    const chosen = [...others, ...lights.filter((thing) => !isShape(thing)).slice(0, MOST), ...lamps];
    const selected = placed.filter((thing) => thing.id === this.selected && !chosen.includes(thing));
    this.chosen = [...chosen, ...selected];
    this.suns = [...this.things.values()].filter((thing) => isSun(thing) && thing.at === null).slice(0, MOST);
    const ids = new Set([...this.chosen, ...this.suns].map((thing) => thing.id));
    for (const [id, node] of this.nodes) {
      if (!ids.has(id)) {
        node.remove();
        this.nodes.delete(id);
      }
    }
    this.later();
  }

  select(id) {
    this.selected = this.things.has(id) ? id : null;
    this.choose();
  }

  toggleAll() {
    this.showsAll = !this.showsAll;
    this.choose();
    return this.showsAll;
  }

  look(camera) {
    this.camera = camera;
    this.later();
  }

  size(box) {
    this.box = box;
    this.later();
  }

  // Where the page has put an object, before the scene confirms it.
  put(name, point, seq = Infinity) {
    this.moved.set(name, { point, seq });
    this.later();
  }

  // The position of an object or its target, by its name in messages.
  where(name) {
    const moved = this.moved.get(name);
    if (moved !== undefined) return moved.point;
    const isTarget = name.endsWith(".target") && !this.things.has(name);
    const thing = this.things.get(isTarget ? name.slice(0, -".target".length) : name);
    return (isTarget ? thing?.target : thing?.at) ?? null;
  }

  // Whether an object is beyond the picture's edges.
  isOutside(name) {
    const point = this.where(name);
    if (point === null || this.camera === null) return false;
    const seen = project(this.camera, axes(this.camera), point);
    return seen === null || Math.abs(seen.x - 0.5) > 0.5 || Math.abs(seen.y - 0.5) > 0.5;
  }

  later() {
    this.frame ??= requestAnimationFrame(() => {
      this.frame = null;
      this.draw();
    });
  }

  draw() {
    if (this.camera === null || this.box === null) return;
    this.view = axes(this.camera);
    this.lines.replaceChildren();
    for (const thing of this.chosen) this.drawThing(thing);
    this.suns.forEach((thing, i) => this.drawSun(thing, i));
    this.drawAxis();
    this.drawSelected();
  }

  // Screen position; null behind the camera or far outside.
  screen(point) {
    const seen = point === null ? null : project(this.camera, this.view, point);
    if (seen === null || Math.abs(seen.x) > 20 || Math.abs(seen.y) > 20) return null;
    const { left, top, width, height } = this.box;
    return { x: left + seen.x * width, y: top + seen.y * height, depth: seen.depth };
  }

  // The part of a segment in front of the camera.
  segment(from, to, name) {
    const depth = (point) => dot(subtract(point, this.camera.origin), this.view.forward);
    const near = 1e-3 * Math.max(Math.abs(depth(from)), Math.abs(depth(to)));
    const [a, b] = [depth(from), depth(to)];
    if (a < near && b < near) return;
    const cut = (inside, outside, i, o) => add(inside, times(subtract(outside, inside), (i - near) / (i - o)));
    const ends = [a < near ? cut(to, from, b, a) : from, b < near ? cut(from, to, a, b) : to];
    const [p, q] = ends.map((point) => project(this.camera, this.view, point));
    if (p === null || q === null) return;
    const { left, top, width, height } = this.box;
    const bounded = (v) => Math.max(-1e5, Math.min(1e5, v)).toFixed(1);
    const at = ({ x, y }) => [bounded(left + x * width), bounded(top + y * height)];
    const [[x1, y1], [x2, y2]] = [at(p), at(q)];
    element("line", { x1, y1, x2, y2, class: name }, this.lines);
  }

  grip(key, kind, name, title) {
    let node = this.nodes.get(key);
    if (node === undefined) {
      const grip = kind === "target" || kind === "sun" ? kind : "thing";
      node = element("g", { class: `grip ${kind === "sun" ? "lamp sun" : kind}`, "data-grip": grip, "data-name": name }, this.grips);
      element("circle", { r: 15, class: "reach" }, node);
      element("path", { class: "halo" }, node);
      element("path", { class: "icon" }, node);
      element("title", {}, node);
      this.nodes.set(key, node);
    }
    if (node.lastChild.textContent !== title) node.lastChild.textContent = title;
    return node;
  }

  drawThing(thing) {
    const isSelected = thing.id === this.selected;
    const kind = isLight(thing) ? (thing.kind in ICONS ? thing.kind : "light") : isSelected ? "selected" : "shape";
    const point = this.where(thing.id);
    const isAway = isLight(thing) && this.isOutside(thing.id);
    const place = isAway ? this.atEdge(point) : this.screen(point);
    const canDrag = isSun(thing) ? thing.turns : thing.moves;
    const words = `${thing.name} (${thing.kind})${isAway ? ", outside of the picture" : ""}${limits(thing)}`;
    const node = this.grip(thing.id, isSun(thing) ? "sun" : isLight(thing) ? "lamp" : "shape", thing.id, words);
    node.classList.toggle("is-selected", isSelected);
    node.classList.toggle("is-still", !canDrag);
    node.style.display = place === null ? "none" : "";
    if (place !== null) {
      const turned = isAway ? ` rotate(${place.bearing.toFixed(1)})` : "";
      node.setAttribute("transform", `translate(${place.x.toFixed(2)} ${place.y.toFixed(2)})${turned}`);
      this.draws(node, isAway ? "away" : kind);
    }
    node.classList.toggle("is-away", isAway);
    const target = this.where(`${thing.id}.target`);
    if (target !== null) this.drawCone(thing, point, target, isSelected);
  }

  // Screen position at the picture's edge, towards something beyond it.
  atEdge(point) {
    const { left, top, width, height } = this.box;
    const margin = [Math.min(0.4, MARGIN / width), Math.min(0.4, MARGIN / height)];
    const { at: [x, y], bearing } = edge(this.camera, this.view, point, margin, width / height);
    return { x: left + x * width, y: top + y * height, bearing };
  }

  // In the corner of the picture, to be dragged over the sky.
  drawSun(thing, i) {
    const node = this.grip(thing.id, "sun", thing.id, `${thing.name} (${thing.kind})${limits(thing)}`);
    node.classList.toggle("is-selected", thing.id === this.selected);
    node.classList.toggle("is-still", !thing.turns);
    const { left, top } = this.box;
    node.setAttribute("transform", `translate(${left + SUNS.first + i * SUNS.step} ${top + SUNS.first})`);
    this.draws(node, thing.kind);
  }

  drawCone(thing, point, target, isSelected) {
    this.segment(point, target, isSelected ? "sight is-selected" : "sight");
    if (!isSelected || thing.kind !== "spot") return;
    const way = subtract(target, point);
    const half = Math.min(80, this.cones.get(thing.id) ?? 20) * Math.PI / 180;
    const forward = unit(way);
    const side = unit(cross(forward, Math.abs(forward[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0]));
    const other = cross(forward, side);
    const radius = length(way) * Math.tan(half);
    const rim = (i) => {
      const angle = i * Math.PI / 16;
      return add(target, times(add(times(side, Math.cos(angle)), times(other, Math.sin(angle))), radius));
    };
    for (let i = 0; i < 32; i++) {
      this.segment(rim(i), rim(i + 1), "cone");
      if (i % 8 === 0) this.segment(point, rim(i), "cone");
    }
  }

  // The axis that constrains a drag.
  drawAxis() {
    const axis = this.held?.axis ? this.held.direction() : null;
    if (axis === null || this.held.axis === "v") return;
    const far = times(axis, 4 * length(subtract(this.held.at, this.camera.origin)));
    this.segment(subtract(this.held.at, far), add(this.held.at, far), `axis ${this.held.axis}`);
  }

  // Ring and target of the selected object.
  drawSelected() {
    const thing = this.things.get(this.selected);
    const place = thing ? this.screen(this.where(thing.id)) : null;
    const target = thing ? this.screen(this.where(`${thing.id}.target`)) : null;
    if (this.ring === undefined) {
      this.ring = element("g", { class: "grip ring", "data-grip": "ring" });
      for (const name of ["reach", "halo", "icon"]) element("circle", { class: name }, this.ring);
      element("title", {}, this.ring).textContent = "Turn";
      this.grips.prepend(this.ring);
    }
    const hasRing = place !== null && thing.turns;
    this.ring.style.display = hasRing ? "" : "none";
    if (hasRing) {
      const seen = thing.radius / (place.depth * this.camera.tan_x) * 0.5 * this.box.width;
      const radius = Math.min(RING.most, Math.max(RING.least, Number.isFinite(seen) ? seen : 0));
      this.ring.dataset.name = thing.id;
      this.ring.setAttribute("transform", `translate(${place.x.toFixed(2)} ${place.y.toFixed(2)})`);
      for (const circle of this.ring.querySelectorAll("circle")) circle.setAttribute("r", radius.toFixed(1));
    }
    const node = this.grip("the target", "target", "", "What it is aimed at");
    node.style.display = target === null ? "none" : "";
    if (target !== null) {
      node.dataset.name = `${thing.id}.target`;
      node.setAttribute("transform", `translate(${target.x.toFixed(2)} ${target.y.toFixed(2)})`);
      this.draws(node, "target");
    }
  }

  draws(node, icon) {
    if (node.dataset.icon === icon) return;
    node.dataset.icon = icon;
    for (const path of node.querySelectorAll("path")) path.setAttribute("d", ICONS[icon]);
  }
}
