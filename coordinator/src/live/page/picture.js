// The picture on its canvas: as large as its place allows, never blank, and never replaced by an older one.

const SETTLED = 150;

export class Picture {
  // `drawn` receives the header of each picture drawn; `sized` is called when the picture's box changes, and `wanted`
  // with the useful picture width in device pixels.
  constructor(place, canvas, { drawn, done, sized, wanted }) {
    this.place = place;
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.says = { drawn, done, sized, wanted };
    this.aspect = 16 / 9;
    this.box = { left: 0, top: 0, width: 0, height: 0 };   // the picture's box in its place, CSS pixels
    this.bitmap = null;
    this.shown = null;        // header of the picture shown
    this.last = Promise.resolve();
    this.timer = null;
    new ResizeObserver(() => this.fit()).observe(place);
    this.watchDensity();
  }

  // Another screen, or another zoom of the page.
  watchDensity() {
    const density = matchMedia(`(resolution: ${devicePixelRatio}dppx)`);
    density.addEventListener("change", () => {
      this.fit();
      this.watchDensity();
    }, { once: true });
  }

  shape(width, height) {
    if (!(width > 0 && height > 0) || this.aspect === width / height) return;
    this.aspect = width / height;
    this.place.style.setProperty("--aspect", String(this.aspect));
    this.fit();
  }

  fit() {
    const [room_x, room_y] = [this.place.clientWidth, this.place.clientHeight];
    if (room_x === 0 || room_y === 0) return;
    const width = Math.min(room_x, room_y * this.aspect);
    const height = width / this.aspect;
    this.box = { left: 0.5 * (room_x - width), top: 0.5 * (room_y - height), width, height };
    for (const side of ["left", "top", "width", "height"]) this.canvas.style[side] = `${this.box[side]}px`;
    const pixels = [width, height].map((side) => Math.max(1, Math.round(side * devicePixelRatio)));
    if (this.canvas.width !== pixels[0] || this.canvas.height !== pixels[1]) {
      // Resizing clears the canvas, so redraw before it is displayed.
      [this.canvas.width, this.canvas.height] = pixels;
      this.paint();
      const isFirst = this.timer === null;
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.says.wanted(this.canvas.width), isFirst ? 0 : SETTLED);
    }
    this.says.sized(this.box);
  }

  paint() {
    if (this.bitmap === null) return;
    this.context.imageSmoothingEnabled = true;
    this.context.imageSmoothingQuality = "high";
    this.context.drawImage(this.bitmap, 0, 0, this.canvas.width, this.canvas.height);
  }

  // A new connection may count from the start.
  forget() {
    this.shown = null;
  }

  isOlder(header) {
    if (this.shown === null) return false;
    const order = ({ revision, passes, step }) => [revision, passes, passes > 0 ? 0 : step];
    const [now, then] = [order(header), order(this.shown)];
    const first = now.findIndex((value, i) => value !== then[i]);
    return first >= 0 && now[first] < then[first];
  }

  // One after another, in the order of arrival.
  take(header, blob) {
    this.last = this.last.then(() => this.show(header, blob));
  }

  async show(header, blob) {
    try {
      if (!this.isOlder(header)) {
        const bitmap = await createImageBitmap(blob);
        this.bitmap?.close();
        this.bitmap = bitmap;
        this.shown = header;
        this.paint();
        this.says.drawn(header);
        return;
      }
    } catch (error) {
      console.warn("A picture was ignored:", error, header);
    }
    // The server sends the next picture only when this one is done.
    this.says.done(header);
  }
}
