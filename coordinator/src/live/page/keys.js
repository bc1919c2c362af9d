// Keys on the picture: they move the camera, select objects, and move or turn the selected one.

import { dolly, orbit, pan, widen } from "./sight.js";

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const STEPS = { ...ARROWS, PageUp: [0, 0, 1], PageDown: [0, 0, -1] };

export class Keys {
  constructor(stage, steer, says) {
    Object.assign(this, { stage, steer, says, eye: steer.eye, handles: steer.handles });
    this.grip = null;         // the object that keys move or turn
    stage.addEventListener("keydown", (event) => this.key(event));
    stage.addEventListener("pointerdown", () => this.letGo(), true);
    stage.addEventListener("blur", () => this.letGo());
  }

  forget() {
    this.grip = null;
  }

  key(event) {
    const { key, timeStamp: time } = event;
    const isOurs = event.target === this.stage && !event.ctrlKey && !event.metaKey && !event.altKey;
    if (!isOurs || this.eye.camera === null) return;
    const does = this.grip === null ? this.cameraKey(key, event, time) : this.gripKey(key, event, time);
    if (does) event.preventDefault();
  }

  gripKey(key, event, time) {
    const letter = key.toLowerCase();
    if (key in STEPS) {
      const [right, up, away = 0] = STEPS[key];
      this.grip.step([right, up, away], event.shiftKey, time);
    } else if (["x", "y", "z", "v"].includes(letter)) {
      this.grip.constrain(letter, time);
      this.handles.later();
    } else if (key === "Escape") {
      this.grip.cancel(time);
      this.grip = null;
      this.steer.release();
    } else if (key !== "Shift") {
      this.letGo();
      return key === "Enter" || this.cameraKey(key, event, time);
    }
    return true;
  }

  cameraKey(key, event, time) {
    const { eye, says, steer } = this;
    const moved = this.motion(key, event.shiftKey);
    if (moved !== null) {
      if (eye.fixed !== null) says.tell(eye.fixed);
      else eye.nudge(moved, time);
      return true;
    }
    switch (key.toLowerCase()) {
      case "f": steer.armFocus(!steer.focuses); break;
      case "enter": steer.clickAt([0.5, 0.5], false, time); break;
      case "escape":
        if (steer.focuses) steer.armFocus(false);
        else says.select(null);
        break;
      case "g": this.grab(false); break;
      case "r": this.grab(true); break;
      case "h": says.handles(); break;
      case "n": this.cycle(1); break;
      case "p": this.cycle(-1); break;
      case "e": says.expose(event.shiftKey ? -0.25 : 0.25, time); break;
      default: return false;
    }
    return true;
  }

  // The camera after a key; null if the key does not move it.
  motion(key, pans) {
    const { camera } = this.eye;
    if (key in ARROWS) {
      const [right, up] = ARROWS[key];
      return pans ? pan(camera, -0.05 * right, 0.05 * up) : orbit(camera, 5 * right, 5 * up);
    }
    switch (key) {
      case "+": case "=": return dolly(camera, 0.9);
      case "-": case "_": return dolly(camera, 1 / 0.9);
      case "[": return widen(camera, 0.95);
      case "]": return widen(camera, 1 / 0.95);
      default: return null;
    }
  }

  // Take the selected object by keys.
  grab(turns) {
    const name = this.handles.selected;
    if (name === null) {
      this.says.tell("Nothing is selected: N goes through the things.");
      return;
    }
    this.grip = this.steer.hold(name, turns);
    const how = turns ? "turn" : "move";
    if (this.grip === null) {
      this.says.tell(`This cannot be ${turns ? "turned" : "moved"}.`);
      return;
    }
    this.says.tell(`Arrow keys ${how} it, finer with Shift. X, Y, Z bind it to an axis. Enter ends, Escape undoes.`);
    this.grip.say();
  }

  letGo() {
    if (this.grip === null) return;
    this.grip.end();
    this.grip = null;
    this.steer.release();
  }

  cycle(step) {
    const ids = [...this.handles.things.keys()];
    if (ids.length === 0) return;
    const at = ids.indexOf(this.handles.selected);
    const next = at < 0 ? (step > 0 ? 0 : ids.length - 1) : (at + step + ids.length) % ids.length;
    this.says.select(ids[next]);
  }
}
