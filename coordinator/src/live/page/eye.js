// The camera that this page looks through. Between messages it is the page's own; the server hears where it is.

// A key or the wheel that has not been touched for so long has been let go.
const RESTED = 350;

export class Eye {
  // `moved`: after every change.
  constructor(wire, moved) {
    this.wire = wire;
    this.moved = moved;
    this.camera = null;
    this.gesture = null;
    this.sent = 0;            // the last change that was sent; scenes before it know less than the page
    this.fov = null;          // as the scene has it
    this.timer = null;
  }

  // Why it cannot be moved; null if it can.
  get fixed() {
    return this.camera === null ? "There is no scene yet." : this.camera.fixed ?? null;
  }

  hear(scene) {
    const heard = scene.camera;
    const isAhead = this.camera !== null && (this.gesture !== null || scene.seq < this.sent);
    const { origin, target, up, fov, tan_x, shift } = isAhead ? this.camera : heard;
    this.camera = { ...heard, origin, target, up, fov, tan_x, shift };
    this.fov = heard.fov;
    this.moved();
  }

  // The server did not take this change.
  refused(seq) {
    if (seq === this.sent) this.sent = 0;
  }

  // The connection is gone, and what was sent over it.
  forget() {
    clearTimeout(this.timer);
    this.gesture = null;
    this.sent = 0;
  }

  begin() {
    this.rest();
    this.gesture = this.wire.gesture();
  }

  go(camera, time) {
    if (this.fixed !== null) return;
    if (this.gesture === null) this.begin();
    this.camera = camera;
    const gesture = this.gesture;
    const make = () => {
      const { origin, target, fov } = this.camera;
      const wider = fov === this.fov ? {} : { fov };
      return { type: "camera", gesture, origin, target, ...wider };
    };
    this.wire.change("camera", time, make, (seq) => { this.sent = seq; });
    this.moved();
  }

  // As `go`, of what has no end of its own.
  nudge(camera, time) {
    this.go(camera, time);
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.rest(), RESTED);
  }

  rest() {
    clearTimeout(this.timer);
    if (this.gesture === null) return;
    this.gesture = null;
    this.wire.rest();
  }
}
