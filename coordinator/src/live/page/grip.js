// An object being moved or turned, by the pointer or by keys, with the total change since it was taken.

import {
  add, alongAxis, axes, cross, dot, length, onPlane, project, subtract, through, times, turnOf, unit,
} from "./sight.js";

const WORLD = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };
const SNAP = 15;
// Degrees per picture height of pointer motion.
const SKY = 90;

export class Grip {
  // `turns`: turn in place of move. `sun`: turn as if dragged over the sky. `point`: the object's position; `thing`:
  // its name in messages. `said` receives text to show next to the pointer, `sent` the numbers of changes.
  constructor(wire, camera, { turns, sun, thing, point }, { said, sent }) {
    this.wire = wire;
    this.camera = camera;
    this.view = axes(camera);
    this.turns = turns;
    this.sun = sun;           // the kind of light, if it is dragged over the sky
    this.thing = thing;
    this.point = point;
    this.about = null;        // the axis of a turn unless a key chose one
    this.says = { said, sent };
    this.gesture = wire.gesture();
    this.axis = null;         // x, y, z, or v for the line of sight
    this.by = [0, 0, 0];
    this.angle = 0;
    this.hasChanged = false;
    this.from = null;         // where the pointer took the object
    this.pointer = null;      // the pointer now: { place, isLevel, snaps }
    this.swept = 0;           // degrees around the object on the screen, counterclockwise
  }

  // Its current position.
  get at() {
    return this.turns ? this.point : add(this.point, this.by);
  }

  direction() {
    if (this.axis === "v") return times(this.view.forward, -1);
    return WORLD[this.axis] ?? this.about ?? (this.turns ? unit(this.camera.up) : null);
  }

  // The pointer has moved; its first place is where it took the object.
  pull(pointer, time) {
    if (this.turns && !this.sun) {
      if (this.pointer !== null) this.swept += this.sweep(this.pointer.place, pointer.place);
    } else if (this.from === null) {
      this.from = pointer.place;
    }
    this.pointer = pointer;
    this.follow(time);
  }

  // Degrees around the object from one place to another.
  sweep(from, to) {
    const centre = project(this.camera, this.view, this.point);
    if (centre === null) return 0;
    const bearing = ([x, y]) => Math.atan2((centre.y - y) * this.camera.height, (x - centre.x) * this.camera.width);
    const swept = (bearing(to) - bearing(from)) * 180 / Math.PI;
    return swept - 360 * Math.round(swept / 360);
  }

  // Constrain to this axis, or release it.
  constrain(axis, time) {
    this.axis = this.axis === axis ? null : axis;
    if (this.pointer !== null) this.follow(time);
    else this.say();
  }

  // Over the sky: what is in front of the camera follows the pointer.
  sweepSky(time) {
    const { camera, view } = this;
    const [dx, dy] = subtract([...this.pointer.place, 0], [...this.from, 0]);
    const around = -SKY * dx * camera.width / camera.height * (camera.flip_x ? -1 : 1);
    const over = -SKY * dy;
    const snapped = (angle) => this.pointer.snaps ? SNAP * Math.round(angle / SNAP) : angle;
    if (this.axis !== null || this.sun === "environment") {
      // An environment keeps its horizon unless a key chooses another axis.
      this.about = [0, 1, 0];
      this.turnTo(snapped(this.axis === null ? around : around + over), time);
      return;
    }
    const turned = turnOf([cross(view.forward, camera.up), snapped(over)], [camera.up, snapped(around)]);
    this.about = turned.axis;
    this.turnTo(turned.angle, time);
  }

  // A point in front of the camera at the same distance, for objects beside or behind it.
  reference() {
    const { origin } = this.camera;
    const away = subtract(this.point, origin);
    const least = 0.1 * length(away);
    const depth = dot(away, this.view.forward);
    return depth >= least ? this.point : add(this.point, times(this.view.forward, length(away) - depth));
  }

  follow(time) {
    if (this.sun && this.turns) {
      this.sweepSky(time);
      return;
    }
    if (this.turns) {
      const towards = dot(this.direction(), subtract(this.camera.origin, this.point)) >= 0 ? 1 : -1;
      const angle = this.swept * towards * (this.camera.flip_x ? -1 : 1);
      this.turnTo(this.pointer.snaps ? SNAP * Math.round(angle / SNAP) : angle, time);
      return;
    }
    const ways = [this.from, this.pointer.place].map((place) => through(this.camera, this.view, place));
    const axis = this.direction();
    if (axis !== null) {
      const [from, to] = ways.map((way) => alongAxis(this.camera, way, this.reference(), axis));
      if (from !== null && to !== null) this.moveTo(times(axis, to - from), time);
      return;
    }
    const normal = this.pointer.isLevel ? unit(this.camera.up) : this.view.forward;
    const [from, to] = ways.map((way) => onPlane(this.camera, way, this.reference(), normal));
    if (from !== null && to !== null) this.moveTo(subtract(to, from), time);
  }

  // By keys: steps to the right, up, and away.
  step([right, up, away], isFine, time) {
    if (this.turns) {
      this.turnTo(this.angle + (right + up + away) * (isFine ? 0.5 : 5), time);
      return;
    }
    const size = (isFine ? 0.002 : 0.02) * length(subtract(this.point, this.camera.origin));
    const axis = this.direction();
    const sideways = add(times(this.view.right, right), times(this.view.up, up));
    const way = axis === null ? add(sideways, times(this.view.forward, away)) : times(axis, right + up + away);
    this.moveTo(add(this.by, times(way, size)), time);
  }

  moveTo(by, time) {
    if (!by.every(Number.isFinite) || (!this.hasChanged && length(by) === 0)) return;
    this.by = by;
    this.send(time);
  }

  turnTo(angle, time) {
    if (!this.hasChanged && angle === 0) return;
    this.angle = angle;
    this.send(time);
  }

  send(time) {
    this.hasChanged = true;
    const { gesture, thing } = this;
    const make = () => this.turns
      ? { type: "turn", gesture, thing, axis: this.direction(), angle: this.angle }
      : { type: "move", gesture, thing, by: this.by };
    // Before sending: that may happen at once, and from then on the server decides the position.
    this.say();
    this.wire.change(this.turns ? "turn" : "move", time, make, this.says.sent);
  }

  say() {
    const about = this.axis === null ? "" : ` ${this.axis === "v" ? "line of sight" : this.axis.toUpperCase()}`;
    const number = (value) => (value < 0 ? "−" : "") + Math.abs(value).toFixed(3);
    const way = `${this.by.map(number).join("  ")}  (${length(this.by).toFixed(3)})`;
    this.says.said((this.turns ? `${this.angle.toFixed(1)}°`.replace("-", "−") : way) + about);
  }

  // Back to the position where it was taken.
  cancel(time) {
    [this.by, this.angle] = [[0, 0, 0], 0];
    if (this.hasChanged) this.send(time);
    this.end();
  }

  end() {
    if (this.hasChanged) this.wire.rest();
  }
}
