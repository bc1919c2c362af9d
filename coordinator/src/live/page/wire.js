// The WebSocket: sends changes, at most one of each kind per animation frame, and receives messages. Measures how long
// changes take to become visible.

const LONGEST_WAIT = 8000;
// Entries kept in the timeline.
const ENTRIES = 20000;

export class Wire {
  // `hears`: a function for each message type, `frame` for pictures, `opened` and `closed`.
  constructor(hears) {
    this.hears = hears;
    this.socket = null;
    this.seq = 0;
    this.gestures = 0;
    // Two pages must not share a gesture.
    this.page = Math.random().toString(36).slice(2, 8);
    this.waiting = new Map();     // changes for the next animation frame, by key
    this.isSpent = false;         // a message was sent in this animation frame
    this.unseen = [];             // changes that no picture has shown, oldest first
    this.marks = 0;
    this.wait = 0;
    this.retry = null;
  }

  connect() {
    clearTimeout(this.retry);
    const address = new URL("/look", location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.wait = 0;
      this.hears.opened();
    };
    socket.onmessage = (event) => this.receive(event.data);
    socket.onclose = (event) => {
      if (this.socket !== socket) return;
      this.socket = null;
      this.waiting.clear();
      this.unseen.length = 0;
      this.wait = Math.min(Math.max(500, 2 * this.wait), LONGEST_WAIT);
      this.retry = setTimeout(() => this.connect(), this.wait * (0.75 + 0.5 * Math.random()));
      this.hears.closed(event.reason, this.wait);
    };
  }

  // At once, if there is no connection.
  hurry() {
    if (this.socket === null) this.connect();
  }

  receive(data) {
    try {
      if (typeof data === "string") {
        const message = JSON.parse(data);
        const hear = Object.hasOwn(this.hears, message?.type) ? this.hears[message.type] : null;
        if (!hear) throw new Error("no such type of message");
        if (message.type === "error") this.unseen = this.unseen.filter((change) => change.seq !== message.seq);
        hear(message);
      } else {
        const size = new DataView(data).getUint32(0, true);
        const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, size)));
        for (const name of ["frame", "revision", "seq", "step", "passes", "width", "height"]) {
          if (!Number.isFinite(header[name])) throw new Error(`a picture without ${name}`);
        }
        this.hears.frame(header, new Blob([new Uint8Array(data, 4 + size)], { type: "image/jpeg" }));
      }
    } catch (error) {
      console.warn("A message was ignored:", error, typeof data === "string" ? data.slice(0, 500) : data);
    }
  }

  get isOpen() {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  // A message that is not a change.
  tell(message) {
    if (this.isOpen) this.socket.send(JSON.stringify(message));
  }

  gesture() {
    this.flush();
    this.gestures += 1;
    return `${this.page}-${this.gestures}`;
  }

  // A change made at `time`. It replaces a waiting change with the same `key`, and takes over that one's time. `make`
  // creates the message; `sent` receives its number.
  change(key, time, make, sent) {
    const first = this.waiting.get(key);
    this.waiting.set(key, { time: first ? first.time : time, make, sent });
    if (!this.isSpent) this.flush();
  }

  // A change that is a separate step, such as undo.
  changeNow(message, time) {
    this.flush();
    this.send({ time, make: () => message });
  }

  rest() {
    this.flush();
    this.tell({ type: "rest" });
  }

  flush() {
    if (this.waiting.size === 0) return;
    const changes = [...this.waiting.values()];
    this.waiting.clear();
    for (const change of changes) this.send(change);
    if (this.isSpent) return;
    this.isSpent = true;
    requestAnimationFrame(() => {
      this.isSpent = false;
      this.flush();
    });
  }

  send({ time, make, sent }) {
    if (!this.isOpen) return;
    this.seq += 1;
    const start = Math.max(0, Math.min(time, performance.now()));
    performance.mark(`change ${this.seq}`, { startTime: start });
    this.unseen.push({ seq: this.seq, start });
    this.socket.send(JSON.stringify({ ...make(), seq: this.seq }));
    sent?.(this.seq);
  }

  // This picture has been drawn.
  drawn(header) {
    this.tell({ type: "drawn", frame: header.frame });
    this.marks += 1;
    if (this.marks > ENTRIES) {
      performance.clearMarks();
      performance.clearMeasures();
      this.marks = 0;
    }
    performance.mark("picture", { detail: header });
    const seen = this.unseen.filter((change) => change.seq <= header.seq);
    if (seen.length === 0) return;
    this.unseen = this.unseen.filter((change) => change.seq > header.seq);
    const start = Math.min(...seen.map((change) => change.start));
    const { seq, frame, step, passes } = header;
    requestAnimationFrame(() => {
      performance.measure("change to picture", { start, end: performance.now(), detail: { seq, frame, step, passes } });
    });
  }
}
