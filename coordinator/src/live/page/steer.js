// Pointer and wheel on the picture: they move the camera or drag objects.

import { Grip } from "./grip.js";
import { dolly, orbit, pan, widen } from "./sight.js";

// Pixels that a pointer may tremble, and milliseconds between the clicks of a double click.
const TREMBLE = { mouse: 3, pen: 5, touch: 9 };
const TWICE = 350;
const CANNOT_MOVE = "This cannot be moved here: the scene file has no plain position for it.";
const CANNOT_TURN = "This cannot be turned here: the scene file has no plain direction for it.";
// Degrees per picture height of pointer motion.
const SWEEP = 180;

export class Steer {
  // `says`: `pick` and `focus` with a place, `tell` with a message for the user, `beside` with text to show next to the
  // pointer, or null.
  constructor(stage, picture, eye, handles, wire, says) {
    Object.assign(this, { stage, picture, eye, handles, wire, says });
    this.pointers = new Map();
    this.drag = null;         // { move, end, cancel } while a pointer is down
    this.focuses = false;     // the next click sets the focus
    this.last = { time: -Infinity, x: 0, y: 0 };
    stage.addEventListener("pointerdown", (event) => this.down(event));
    stage.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) stage.addEventListener(name, (event) => this.up(event));
    stage.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    // Disable scrolling with the middle button.
    stage.addEventListener("mousedown", (event) => { if (event.button === 1) event.preventDefault(); });
    addEventListener("keydown", (event) => this.whileDragging(event), true);
    addEventListener("blur", () => {
      this.drag?.end(performance.now());
      this.drag = null;
    });
  }

  // Place in the picture; below 0 or above 1 outside it.
  place(event) {
    const box = this.picture.canvas.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  }

  // Abandon everything that was begun.
  forget() {
    this.drag?.forget?.();
    this.drag = null;
    this.pointers.clear();
    this.says.beside(null);
  }

  down(event) {
    if (this.drag !== null && this.pointers.size === 0) this.drag = null;
    const isFirst = this.pointers.size === 0;
    if (this.eye.camera === null || (!isFirst && event.pointerType !== "touch")) return;
    this.stage.focus({ preventScroll: true });
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    this.stage.setPointerCapture(event.pointerId);
    if (!isFirst) {
      if (this.pointers.size === 2 && this.drag?.mayPinch) this.drag = this.pinch(this.drag);
      return;
    }
    const grip = event.target.closest?.("[data-grip]");
    if (grip && event.button === 0 && !this.focuses) this.drag = this.take(event, grip);
    else if (event.button === 1 || (event.button === 0 && event.shiftKey)) this.drag = this.look(event, "pan");
    else if (event.button === 0) this.drag = this.look(event, "orbit");
    else this.pointers.delete(event.pointerId);
  }

  move(event) {
    if (!this.pointers.has(event.pointerId)) return;
    this.drag?.move(event);
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  }

  up(event) {
    if (!this.pointers.delete(event.pointerId)) return;
    const { drag } = this;
    if (this.pointers.size > 0) return;
    this.drag = null;
    if (event.type === "pointercancel") drag?.cancel(event.timeStamp);
    else drag?.end(event.timeStamp, event);
  }

  // Whether a pointer has moved far enough to count as a drag.
  watch(event) {
    const start = { x: event.clientX, y: event.clientY };
    let isMeant = false;
    return (now) => {
      isMeant ||= Math.hypot(now.clientX - start.x, now.clientY - start.y) > (TREMBLE[now.pointerType] ?? 3);
      return isMeant;
    };
  }

  // Move the camera, or, without a drag, click a place.
  look(event, how) {
    const { eye } = this;
    const isMeant = this.watch(event);
    const before = eye.camera;
    let hasBegun = false;
    let last = { x: event.clientX, y: event.clientY };
    const begin = () => {
      hasBegun = true;
      if (eye.fixed !== null) this.says.tell(eye.fixed);
      else eye.begin();
    };
    const end = (time, at) => {
      if (hasBegun) eye.rest();
      else if (at && event.button === 0) this.click(at);
    };
    return {
      mayPinch: true,
      hasBegun: () => hasBegun,
      move: (now) => {
        if (!isMeant(now)) return;
        if (!hasBegun) begin();
        const { width, height } = this.picture.box;
        const [dx, dy] = [now.clientX - last.x, now.clientY - last.y];
        last = { x: now.clientX, y: now.clientY };
        if (eye.fixed !== null) return;
        const camera = how === "pan"
          ? pan(eye.camera, dx / width, dy / height)
          : orbit(eye.camera, -SWEEP * dx / height, SWEEP * dy / height);
        eye.go(camera, now.timeStamp);
      },
      end,
      cancel: (time) => {
        if (hasBegun && eye.fixed === null) eye.go(before, time);
        end(time);
      },
    };
  }

  // Two fingers: spread to approach, move together to pan.
  pinch(before) {
    const { eye } = this;
    if (eye.fixed !== null) this.says.tell(eye.fixed);
    else if (!before.hasBegun()) eye.begin();
    const spread = ([a, b]) => ({
      size: Math.max(1, Math.hypot(a.x - b.x, a.y - b.y)), x: 0.5 * (a.x + b.x), y: 0.5 * (a.y + b.y),
    });
    const end = () => eye.rest();
    return {
      move: (event) => {
        if (this.pointers.size !== 2 || eye.fixed !== null) return;
        const was = spread([...this.pointers.values()]);
        this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
        const is = spread([...this.pointers.values()]);
        const { width, height } = this.picture.box;
        const moved = pan(eye.camera, (is.x - was.x) / width, (is.y - was.y) / height);
        eye.go(dolly(moved, was.size / is.size), event.timeStamp);
      },
      end,
      cancel: end,
    };
  }

  click(event) {
    const isSecond = event.timeStamp - this.last.time < TWICE
      && Math.hypot(event.clientX - this.last.x, event.clientY - this.last.y) < 12;
    this.last = { time: isSecond ? -Infinity : event.timeStamp, x: event.clientX, y: event.clientY };
    this.clickAt(this.place(event), isSecond, event.timeStamp);
  }

  clickAt(place, isDouble, time) {
    if (!place.every((v) => v >= 0 && v <= 1)) return;
    if (isDouble || this.focuses) this.says.focus(place, time);
    else this.says.pick(place);
    this.armFocus(false);
  }

  armFocus(is) {
    if (this.focuses === is) return;
    this.focuses = is;
    this.stage.classList.toggle("focuses", is);
    if (is) this.says.tell("Click what is to be in focus.");
  }

  // A grip on the object or target of this name, if it can be taken. `overSky`: turn as if dragged over the sky.
  hold(name, turns, overSky = false) {
    const thing = this.handles.things.get(name) ?? this.handles.things.get(name.replace(/\.target$/, ""));
    const place = this.handles.where(name);
    const sun = overSky ? thing?.kind : null;
    const point = place ?? (turns ? this.eye.camera.target : null);
    if (!thing || point === null || !(turns ? thing.turns : thing.moves)) return null;
    const grip = new Grip(this.wire, this.eye.camera, { turns, sun, thing: name, point }, {
      said: (words) => {
        this.says.beside(words);
        if (!turns) this.handles.put(name, grip.at);
        else this.handles.later();
      },
      sent: (seq) => { if (!turns) this.handles.put(name, grip.at, seq); },
    });
    this.handles.held = grip;
    return grip;
  }

  release() {
    this.handles.held = null;
    this.handles.later();
    this.says.beside(null);
  }

  // Drag an object, its target or its ring.
  take(event, node) {
    const { name, grip: kind } = node.dataset;
    const turns = kind === "ring" || kind === "sun";
    const isMeant = this.watch(event);
    const select = () => { if (kind === "thing" || kind === "sun") this.says.select(name); };
    let grip = null, wasTried = false;
    const pointer = (now) => ({ place: this.place(now), isLevel: now.shiftKey, snaps: now.ctrlKey });
    return {
      key: (letter, time) => grip?.constrain(letter, time),
      move: (now) => {
        if (!isMeant(now)) return;
        if (!wasTried) {
          wasTried = true;
          select();
          grip = this.hold(name, turns, kind === "sun");
          if (grip === null) this.says.tell(turns ? CANNOT_TURN : CANNOT_MOVE);
          grip?.pull({ ...pointer(event), isLevel: now.shiftKey }, event.timeStamp);
        }
        grip?.pull(pointer(now), now.timeStamp);
      },
      end: () => {
        if (!wasTried) select();
        grip?.end();
        this.release();
      },
      cancel: (time) => {
        grip?.cancel(time);
        this.release();
      },
      forget: () => { this.handles.held = null; },
    };
  }

  wheel(event) {
    event.preventDefault();
    const { eye } = this;
    if (event.deltaY === 0 || eye.camera === null || this.drag !== null) return;
    if (eye.fixed !== null) {
      this.says.tell(eye.fixed);
      return;
    }
    const unit = [1, 16, 400][event.deltaMode] ?? 1;
    const turned = Math.max(-300, Math.min(300, event.deltaY * unit));
    const isWider = event.ctrlKey || event.altKey;
    // A touchpad pinch arrives as short wheel turns with Ctrl.
    const camera = isWider ? widen(eye.camera, 2 ** (turned / 600)) : dolly(eye.camera, 2 ** (turned / 400));
    eye.nudge(camera, event.timeStamp);
  }

  // Keys that change the current drag.
  whileDragging(event) {
    if (this.drag === null || event.ctrlKey || event.metaKey) return;
    const letter = event.key.toLowerCase();
    if (event.key === "Escape") {
      this.drag.cancel(event.timeStamp);
      this.drag = null;
    } else if (["x", "y", "z", "v"].includes(letter) && this.drag.key) {
      if (!event.repeat) this.drag.key(letter, event.timeStamp);
    } else {
      return;
    }
    event.preventDefault();
    event.stopPropagation();
  }
}
