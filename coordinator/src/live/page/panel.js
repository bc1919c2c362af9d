// The panel with the scene's fields in groups. Controls are created when a group is opened, and kept while the scene
// has the fields.

import { element } from "./dom.js";
import { Field } from "./field.js";

// Kinds of groups that are open initially, up to a limit.
const OPEN = ["camera", "light", "render"];
const OPEN_AT_FIRST = 4;
// The most fields that a search shows.
const FOUND = 120;

class Group {
  constructor(key, panel) {
    this.key = key;
    this.panel = panel;
    this.records = [];
    this.fields = new Map();
    this.name = element("span");
    this.kind = element("span", { class: "soft" });
    this.body = element("div", { class: "fields" });
    const summary = element("summary", {}, this.name, " ", this.kind);
    this.node = element("details", { class: "group" }, summary, this.body);
    this.node.addEventListener("toggle", () => this.sync());
    summary.addEventListener("click", () => {
      const thing = this.records.find((record) => record.thing !== null)?.thing;
      if (!this.node.open && thing) panel.says.select(thing);
    });
  }

  hear(records, seq) {
    this.records = records;
    const { group, group_kind: kind } = records[0];
    if (this.name.textContent !== group) this.name.textContent = group;
    const words = kind === group ? "" : kind;
    if (this.kind.textContent !== words) this.kind.textContent = words;
    this.sync(seq);
  }

  // Update the controls for the scene; existing ones are kept.
  sync(seq = Infinity) {
    if (!this.node.open && this.fields.size === 0) return;
    const paths = new Set(this.records.map((record) => record.path));
    for (const [path, field] of this.fields) {
      if (paths.has(path)) continue;
      field.node.remove();
      this.fields.delete(path);
    }
    let before = null;
    for (const record of this.records) {
      let field = this.fields.get(record.path);
      if (field !== undefined && field.shape !== Field.shape(record) && !field.node.contains(document.activeElement)) {
        field.node.remove();
        field = undefined;
      }
      if (field === undefined) {
        field = new Field(record, this.panel.wire);
        this.fields.set(record.path, field);
      } else {
        field.update(record, seq);
      }
      const place = before === null ? this.body.firstChild : before.nextSibling;
      if (field.node !== place) this.body.insertBefore(field.node, place);
      before = field.node;
    }
  }
}

export class Panel {
  // `says.select`: the user opened an object's fields.
  constructor(place, search, wire, says) {
    this.place = place;
    this.search = search;
    this.wire = wire;
    this.says = says;
    this.groups = new Map();
    this.seq = 0;
    this.wasFilled = false;
    this.faulty = new Set();      // paths of fields with an error
    search.addEventListener("input", () => this.find());
  }

  hear(scene) {
    this.seq = scene.seq;
    const groups = new Map();
    for (const field of scene.fields) {
      const key = JSON.stringify([field.group_kind, field.group, field.thing]);
      if (!groups.has(key)) groups.set(key, []);
      groups.get(key).push(field);
    }
    for (const [key, group] of this.groups) {
      if (groups.has(key)) continue;
      group.node.remove();
      this.groups.delete(key);
    }
    let before = null, opened = 0;
    for (const [key, records] of groups) {
      let group = this.groups.get(key);
      if (group === undefined) {
        group = new Group(key, this);
        this.groups.set(key, group);
        if (!this.wasFilled && opened < OPEN_AT_FIRST && OPEN.includes(records[0].group_kind)) {
          group.node.open = true;
          opened += 1;
        }
      }
      group.hear(records, scene.seq);
      const place = before === null ? this.place.firstChild : before.nextSibling;
      if (group.node !== place) this.place.insertBefore(group.node, place);
      before = group.node;
    }
    this.wasFilled = true;
    if (this.search.value !== "") this.find();
  }

  // The group of a path, anywhere.
  groupOf(path) {
    for (const group of this.groups.values()) {
      if (group.records.some((record) => record.path === path)) return group;
    }
    return null;
  }

  // The field's latest value from the scene or the user; null if missing.
  value(path) {
    const group = this.groupOf(path);
    const field = group?.fields.get(path)?.field ?? group?.records.find((record) => record.path === path);
    return field ? field.value ?? field.default : null;
  }

  // As if typed by the user; works without controls.
  set(path, value, time) {
    const group = this.groupOf(path);
    const field = group?.fields.get(path);
    if (field !== undefined) {
      field.send(value, time);
      field.rest();
      return;
    }
    const record = group?.records.find((one) => one.path === path);
    if (record !== undefined) record.value = value;
    const gesture = this.wire.gesture();
    this.wire.change(`set ${path}`, time, () => ({ type: "set", gesture, path, value }));
    this.wire.rest();
  }

  // Show the fields of the first group that passes the test.
  reveal(test) {
    const group = [...this.groups.values()].find(test);
    if (group === undefined) return;
    group.node.open = true;
    group.sync(this.seq);
    for (const other of this.groups.values()) other.node.classList.toggle("is-selected", other === group);
    const [box, room] = [group.node.getBoundingClientRect(), this.place.getBoundingClientRect()];
    if (box.top < room.top || box.bottom > room.bottom) group.node.scrollIntoView({ block: "start" });
  }

  revealThing(id) {
    for (const group of this.groups.values()) group.node.classList.remove("is-selected");
    if (id !== null) this.reveal((group) => group.records.some((record) => record.thing === id));
  }

  revealMaterial(name) {
    this.reveal((group) => group.records[0].group_kind === "material" && group.records[0].group === name);
  }

  // Find groups and fields whose names contain all words of the search.
  find() {
    const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    let found = 0;
    for (const group of this.groups.values()) {
      const matches = group.records.filter((record) => {
        const text = `${record.group_kind} ${record.group} ${record.path}`.toLowerCase();
        return words.every((word) => text.includes(word));
      });
      group.node.hidden = matches.length === 0;
      if (words.length > 0 && matches.length > 0 && found < FOUND) {
        found += matches.length;
        group.node.open = true;
        group.sync(this.seq);
      }
      const paths = new Set(matches.map((record) => record.path));
      for (const [path, field] of group.fields) field.node.hidden = !paths.has(path);
    }
  }

  // Returns whether there is a field to show the error at.
  fail({ seq, path, message }) {
    this.refused(seq);
    const group = path === null || path === undefined ? null : this.groupOf(path);
    if (group === null) return false;
    group.node.hidden = false;
    group.node.open = true;
    if (!group.fields.has(path)) group.sync(this.seq);
    const field = group.fields.get(path);
    field.node.hidden = false;
    field.fail(message);
    this.faulty.add(path);
    field.node.scrollIntoView({ block: "nearest" });
    return true;
  }

  fine() {
    for (const path of this.faulty) {
      const group = this.groupOf(path);
      group?.fields.get(path)?.fail(null);
      group?.sync(this.seq);
    }
    this.faulty.clear();
  }

  *fields() {
    for (const group of this.groups.values()) yield* group.fields.values();
  }

  refused(seq) {
    for (const field of this.fields()) field.refused(seq);
  }

  forget() {
    for (const field of this.fields()) field.forget();
  }

  // Apply text that was typed but not sent.
  commit(event) {
    for (const field of this.fields()) field.commitTyped(event);
  }

  get isTyping() {
    for (const field of this.fields()) {
      if (field.isTouched) return true;
    }
    return false;
  }
}
