// One field of the scene: its controls show the server's values and send the user's changes.

import { element } from "./dom.js";
import { colourOf, rangeInWords, rounded, scaleOf, scrubbed, shown, stepOf, valuesOf } from "./numbers.js";

const SLIDER = 1000;
const NO_NUMBER = "This is not a number. Type one such as 0.5, 12 or 1e-3.";
let made = 0;

const isNothing = (value) => value === null || value === undefined;
const sizeOf = ({ value, default: usual }) => [value, usual].find(Array.isArray)?.length || 3;

export class Field {
  constructor(field, wire) {
    this.wire = wire;
    this.field = field;
    this.gesture = null;      // while a slider, a label or a colour is held
    this.sent = 0;            // the last change that no scene includes yet
    this.isTouched = false;   // there is text that has not been sent
    this.error = null;
    this.scale = null;
    this.build();
    this.update(field, Infinity);
  }

  // A change of these values requires new controls.
  static shape(field) {
    const { kind, value, default: usual, choices } = field;
    return JSON.stringify([kind, kind === "vector" ? sizeOf(field) : 0, typeof (value ?? usual) === "string", choices]);
  }

  build() {
    const { field } = this;
    made += 1;
    this.id = `field-${made}`;
    this.shape = Field.shape(field);
    this.inputs = [];
    const value = field.value ?? field.default;
    // A texture in place of a colour.
    const isWord = ["number", "color", "vector"].includes(field.kind) && typeof value === "string";
    this.kind = isWord ? "text" : field.kind;
    this.controls = element("div", { class: "controls" });
    switch (this.kind) {
      case "bool": this.addCheck(); break;
      case "choice": this.addChoice(); break;
      case "number": this.addSlider(); this.addNumbers([field.name]); break;
      case "color": this.addSwatch(); this.addNumbers(["red", "green", "blue"]); break;
      case "vector": this.addNumbers(Array.from({ length: sizeOf(field) }, (_, i) => "xyzw"[i] ?? `${i + 1}`)); break;
      default: this.addText();
    }
    this.inputs[0].id = this.id;
    // Long names wrap after underscores.
    const parts = field.name.split(/(?<=_)/).flatMap((part) => [part, element("wbr")]);
    this.label = element("label", { for: this.id }, ...parts.slice(0, -1));
    if (this.kind === "number" || this.kind === "color") this.addScrub();
    this.unit = element("span", { class: "unit soft" });
    const reset = { type: "button", class: "reset", "aria-label": `Reset ${field.name} to its default` };
    this.reset = element("button", reset, "↺");
    this.reset.addEventListener("click", (event) => {
      this.send(null, event.timeStamp);
      this.rest();
    });
    this.message = element("p", { class: "bad", role: "alert", id: `${this.id}-error`, hidden: true });
    const all = [this.label, this.controls, this.unit, this.reset, this.message];
    this.node = element("div", { class: `field ${this.kind}` }, ...all);
    this.node.dataset.path = field.path;
  }

  add(node, ...listeners) {
    for (const [name, listener] of listeners) node.addEventListener(name, listener);
    this.controls.append(node);
    return node;
  }

  addCheck() {
    this.inputs = [this.add(element("input", { type: "checkbox" }),
      ["change", (event) => this.say(event.target.checked, event)])];
  }

  addChoice() {
    const options = (this.field.choices ?? []).map((choice) => element("option", { value: choice }, choice));
    const select = element("select", {}, ...options);
    this.inputs = [this.add(select, ["change", (event) => this.say(event.target.value, event)])];
  }

  addText() {
    this.inputs = [this.add(element("input", { type: "text", autocomplete: "off", spellcheck: "false" }),
      ["input", () => { this.isTouched = true; }],
      ["change", (event) => this.commitTyped(event)],
      ["keydown", (event) => this.key(event)])];
  }

  addNumbers(names) {
    const plain = { type: "text", inputmode: "decimal", autocomplete: "off", spellcheck: "false" };
    const label = (name) => names.length > 1 ? `${this.field.name} ${name}` : null;
    this.inputs = names.map((name) => this.add(
      element("input", { ...plain, "aria-label": label(name) }),
      ["input", () => this.type()],
      ["change", (event) => this.commit(event)],
      ["keydown", (event) => this.key(event)],
      ["focus", (event) => event.target.select()]));
  }

  addSlider() {
    const slide = (event) => {
      if (this.scale === null) return;
      const value = this.scale.value(Number(event.target.value) / SLIDER);
      this.send(this.field.integer ? Math.round(value) : rounded(value), event.timeStamp);
    };
    const range = { type: "range", min: 0, max: SLIDER, step: "any", "aria-label": `${this.field.name}, slider` };
    this.slider = this.add(element("input", range),
      ["input", slide],
      ["change", () => this.rest()],
      ["keydown", (event) => this.slideByKey(event)],
      ["keyup", () => this.rest()]);
  }

  // A slider without steps handles keys itself.
  slideByKey(event) {
    const step = { ArrowLeft: -10, ArrowDown: -10, ArrowRight: 10, ArrowUp: 10, PageDown: -100, PageUp: 100 }[event.key];
    if (step === undefined || this.scale === null) return;
    event.preventDefault();
    this.slider.value = Number(this.slider.value) + step * (event.shiftKey ? 0.2 : 1);
    this.send(rounded(this.scale.value(Number(this.slider.value) / SLIDER)), event.timeStamp);
  }

  addSwatch() {
    let scale = null;         // fixed while the colour is chosen
    this.swatch = this.add(element("input", { type: "color", "aria-label": `${this.field.name}, colour` }),
      ["input", (event) => {
        scale ??= this.swatchScale();
        this.send(valuesOf(event.target.value, scale), event.timeStamp);
      }],
      ["change", () => {
        scale = null;
        this.rest();
      }]);
  }

  swatchScale() {
    const most = Math.max(...this.values());
    return Number.isFinite(this.field.max) && this.field.max <= 1 ? this.field.max || 1 : most > 0 ? most : 1;
  }

  // Drag the label to scale numbers or brighten colours.
  addScrub() {
    this.label.classList.add("scrub");
    let start = null;
    this.label.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || event.pointerType === "touch") return;
      start = { x: event.clientX, values: this.values(), hasMoved: false };
      this.label.setPointerCapture(event.pointerId);
    });
    this.label.addEventListener("pointermove", (event) => {
      if (start === null) return;
      const pixels = event.clientX - start.x;
      start.hasMoved ||= Math.abs(pixels) > 3;
      if (!start.hasMoved) return;
      const way = event.shiftKey ? 0.1 * pixels : pixels;
      if (this.kind === "number") {
        const value = scrubbed(this.field, start.values[0], way);
        this.send(this.field.integer ? Math.round(value) : rounded(value), event.timeStamp);
      } else {
        const most = Math.max(...start.values);
        const bound = Number.isFinite(this.field.max) && most > 0 ? this.field.max / most : Infinity;
        const factor = Math.min(bound, Math.exp(way / 100));
        this.send(start.values.map((v) => rounded(v * factor)), event.timeStamp);
      }
    });
    for (const name of ["pointerup", "pointercancel"]) {
      this.label.addEventListener(name, () => {
        if (start?.hasMoved) this.rest();
      });
    }
    // Suppress the click after a drag.
    this.label.addEventListener("click", (event) => {
      if (start?.hasMoved) event.preventDefault();
      start = null;
    });
  }

  // The displayed numbers.
  values() {
    const value = this.field.value ?? this.field.default ?? 0;
    if (Array.isArray(value)) return value.map(Number);
    return this.kind === "number" ? [Number(value)] : this.inputs.map(() => Number(value) || 0);
  }

  // The values in the inputs; empty or abbreviated ones keep their values. Null if invalid.
  written() {
    const before = this.values();
    const values = this.inputs.map((input, i) => {
      const text = input.value.trim();
      return text === "" || text === shown(before[i]) ? before[i] : Number(text.replace(",", "."));
    });
    if (!values.every(Number.isFinite)) return null;
    return this.kind === "number" ? values[0] : values;
  }

  // The page's own error message disappears when the text is valid.
  type() {
    this.isTouched = true;
    if (this.error === NO_NUMBER && this.written() !== null) this.fail(null);
  }

  commit(event) {
    if (!this.isTouched) return;
    if (this.inputs.every((input) => input.value.trim() === "") && !isNothing(this.field.default)) {
      this.say(null, event);
      return;
    }
    const value = this.written();
    if (value === null) this.fail(NO_NUMBER);
    else this.say(value, event);
  }

  // Apply the typed text.
  commitTyped(event) {
    if (!this.isTouched) return;
    if (this.kind === "text") this.say(this.inputs[0].value, event);
    else this.commit(event);
  }

  key(event) {
    if (event.key === "Enter") {
      this.commitTyped(event);
    } else if (event.key === "Escape") {
      if (!this.isTouched && this.error === null) return;
      this.isTouched = false;
      this.field = { ...this.field, ...this.heard };
      this.fail(null);
      this.show();
    } else if ((event.key === "ArrowUp" || event.key === "ArrowDown") && this.kind !== "text") {
      event.preventDefault();
      const at = this.inputs.indexOf(event.target);
      const values = [this.written() ?? this.values()].flat();
      const step = this.field.integer ? 1 : stepOf(this.field, values[at]) * (event.shiftKey ? 0.1 : 1);
      values[at] = Number((values[at] + (event.key === "ArrowUp" ? step : -step)).toPrecision(12));
      if (Number.isFinite(this.field.min)) values[at] = Math.max(values[at], this.field.min);
      if (Number.isFinite(this.field.max)) values[at] = Math.min(values[at], this.field.max);
      this.isTouched = false;
      this.send(this.kind === "number" ? values[0] : values, event.timeStamp);
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.rest(), 500);
    }
  }

  // A change that is a complete gesture.
  say(value, event) {
    this.isTouched = false;
    this.send(value, event.timeStamp);
    this.rest();
  }

  send(value, time) {
    if (this.error === NO_NUMBER) this.fail(null);
    this.gesture ??= this.wire.gesture();
    const { gesture } = this;
    const { path } = this.field;
    const make = () => ({ type: "set", gesture, path, value });
    this.sent = Infinity;
    this.wire.change(`set ${path}`, time, make, (seq) => { this.sent = seq; });
    // Shown at once; the next scene has the result.
    this.field = { ...this.field, value, given: value !== null };
    this.show();
  }

  rest() {
    clearTimeout(this.timer);
    if (this.gesture === null) return;
    this.gesture = null;
    this.wire.rest();
  }

  refused(seq) {
    if (this.sent === seq) this.sent = 0;
  }

  forget() {
    this.gesture = null;
    this.sent = 0;
    this.isTouched = false;
  }

  // The server's value, from a scene that includes the page's changes up to `seq`.
  update(field, seq) {
    this.heard = { value: field.value, given: field.given };
    const isBusy = this.gesture !== null || this.isTouched || seq < this.sent || this.error !== null;
    const { value, given } = isBusy ? this.field : field;
    this.field = { ...field, value, given };
    if (!isBusy) {
      this.sent = 0;
      this.show();
    }
    const range = rangeInWords(field);
    const title = [field.help, range && `Range: ${range}.`, field.path].filter(Boolean).join("\n");
    if (this.node.title !== title) this.node.title = title;
    const unit = [field.unit, range].filter(Boolean).join(" · ");
    if (this.unit.textContent !== unit) this.unit.textContent = unit;
  }

  show() {
    const { value, given, default: usual } = this.field;
    this.reset.hidden = !given || isNothing(usual);
    this.node.classList.toggle("is-default", !given);
    if (this.kind === "bool") {
      this.inputs[0].checked = Boolean(value ?? usual);
    } else if (this.kind === "choice") {
      this.inputs[0].value = value ?? usual ?? "";
    } else if (this.kind === "text") {
      this.write(this.inputs[0], given ? value ?? "" : "", isNothing(usual) ? "" : String(usual));
    } else {
      const values = this.values();
      const usuals = isNothing(usual) ? values : this.inputs.map((_, i) => Array.isArray(usual) ? usual[i] : usual);
      const placeholder = (i) => isNothing(usual) && isNothing(value) ? "none" : shown(Number(usuals[i]));
      this.inputs.forEach((input, i) => this.write(input, given ? shown(values[i]) : "", placeholder(i)));
      if (this.swatch) this.showSwatch(values);
      if (this.slider) this.showSlider(values[0]);
    }
  }

  write(input, text, placeholder) {
    if (this.isTouched) return;
    if (input.value !== text) input.value = text;
    if (input.placeholder !== placeholder) input.placeholder = placeholder;
  }

  showSwatch(values) {
    // Not while the browser's colour picker is open.
    if (this.gesture === null) this.swatch.value = colourOf(values, this.swatchScale());
  }

  showSlider(value) {
    const isHeld = this.gesture !== null;
    if (!isHeld && !this.scale?.holds(value)) this.scale = scaleOf(this.field, value);
    this.slider.hidden = this.scale === null;
    const isSliding = isHeld && document.activeElement === this.slider;
    if (this.scale !== null && !isSliding) this.slider.value = SLIDER * this.scale.place(value);
    this.slider.setAttribute("aria-valuetext", `${shown(value)} ${this.field.unit ?? ""}`.trim());
  }

  // Shows an error; null clears it.
  fail(message) {
    this.error = message;
    this.message.hidden = message === null;
    this.message.textContent = message ?? "";
    for (const input of this.inputs) {
      if (message === null) {
        input.removeAttribute("aria-invalid");
        input.removeAttribute("aria-describedby");
      } else {
        input.setAttribute("aria-invalid", "true");
        input.setAttribute("aria-describedby", this.message.id);
      }
    }
  }
}
