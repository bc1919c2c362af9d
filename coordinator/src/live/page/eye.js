// The page's camera. It moves without waiting for the server, which is told its position.

// A key or the wheel counts as released after this many milliseconds.
const RESTED = 350;

export class Eye {
  // `moved` is called after every change.
  constructor(wire, moved) {
    this.wire = wire;
    this.moved = moved;
    this.camera = null;
    this.gesture = null;
    this.sent = 0;            // the last change sent; earlier scenes lack it
    this.fov = null;          // the scene's value
    this.timer = null;
  }

  // Why the camera cannot be moved; null if it can.
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

  // The server refused this change.
  refused(seq) {
    if (seq === this.sent) this.sent = 0;
  }

  // The connection and the changes sent over it are lost.
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

  // Like `go`, for input without an explicit end.
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
