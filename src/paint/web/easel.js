// The pattern in the page: tools, strokes, undo, and the pointer or the keyboard that moves them.

import { Stroke, checker, fill, flood, gradient } from "./brush.js";
import { History } from "./history.js";

const HELP = {
  brush: "Drag to paint. In signed patterns a negative value is painted blue.",
  erase: "Drag to set pixels to zero.",
  line: "Press at one end and release at the other.",
  fill: "Press to fill all connected pixels of the same value.",
  gradient: "Press where it is zero and release where it has the brush's value.",
  checker: "Press to cover the pattern with squares of the brush's size.",
  look: "Point at the pattern: the photo shows the light of that pixel. Point at the photo: the pattern shows what lights it.",
  pan: "Drag to move both pictures. The wheel zooms.",
};

const KEYS = { b: "brush", e: "erase", l: "line", f: "fill", g: "gradient", c: "checker", p: "look", h: "pan" };

/** The pattern with its tools. `onChange(pixels)` is called with changed pixels, `onFinish()` at the end of a stroke. */
export class Easel {
  constructor(picture, pattern, isSigned, { onChange, onFinish }) {
    Object.assign(this, { picture, pattern, onChange, onFinish });
    this.size = { width: picture.width, height: picture.height };
    this.history = new History(pattern);
    this.stroke = null;
    this.from = null;
    this.touched = new Set();
    this.controls = Object.fromEntries(["size", "softness", "value", "color"].map((id) => [id, document.querySelector(`#${id}`)]));
    this.controls.size.max = Math.max(this.size.width, this.size.height);
    this.controls.size.value = Math.max(1, Math.round(this.size.width / 10));
    if (isSigned) this.controls.value.min = -1;
    if (pattern.length === 1) document.querySelector("#color-row").hidden = true;
    this.listen();
  }

  listen() {
    for (const id of ["size", "softness", "value"]) {
      const show = () => (this.controls[id].nextElementSibling.textContent = this.controls[id].value);
      this.controls[id].addEventListener("input", show);
      show();
    }
    const help = () => (document.querySelector("#tool-help").textContent = HELP[this.tool()]);
    document.querySelector("#tools").addEventListener("change", help);
    help();
    const button = (id, act) => document.querySelector(id).addEventListener("click", act);
    button("#undo", () => this.undo());
    button("#redo", () => this.redo());
    button("#clear", () => this.whole(() => flood(this.pattern, this.size, this.pattern.map(() => 0))));
    button("#white", () => this.whole(() => flood(this.pattern, this.size, this.pattern.map(() => 1))));
    document.addEventListener("keydown", (event) => this.shortcut(event));
  }

  tool() {
    return document.querySelector("input[name=tool]:checked").value;
  }

  choose(tool) {
    const input = document.querySelector(`input[name=tool][value=${tool}]`);
    input.checked = true;
    input.dispatchEvent(new Event("change", { bubbles: true }));
  }

  /** What the brush paints: a value for each plane. */
  value() {
    if (this.tool() === "erase") return this.pattern.map(() => 0);
    const value = Number(this.controls.value.value);
    if (this.pattern.length === 1) return [value];
    const color = this.controls.color.value;
    return [1, 3, 5].map((at) => (value * Number.parseInt(color.slice(at, at + 2), 16)) / 255);
  }

  brush() {
    return { size: Number(this.controls.size.value), softness: Number(this.controls.softness.value), value: this.value() };
  }

  /** Begins at a place of the pattern. */
  press(place) {
    const tool = this.tool();
    this.from = place;
    if (tool === "brush" || tool === "erase" || tool === "line") {
      this.stroke = new Stroke(this.pattern, this.size, this.brush());
      if (tool !== "line") this.changed(this.stroke.moveTo(place));
    } else if (tool === "fill") {
      const pixel = this.picture.pixelAt(place);
      if (pixel >= 0) this.changed(fill(this.pattern, this.size, pixel, this.value()));
    } else if (tool === "checker") {
      this.changed(checker(this.pattern, this.size, this.brush().size, this.value()));
    }
  }

  /** Goes on to a place. */
  drag(place) {
    if (this.stroke && this.tool() !== "line") this.changed(this.stroke.moveTo(place));
  }

  /** Ends at a place. */
  release(place) {
    if (this.from === null) return;
    if (this.tool() === "gradient") this.changed(gradient(this.pattern, this.size, this.from, place, this.value()));
    if (this.stroke && this.tool() === "line") {
      this.changed(this.stroke.moveTo(this.from));
      this.changed(this.stroke.moveTo(place));
    }
    [this.stroke, this.from] = [null, null];
    this.end();
  }

  /** Replaces the pattern as one step that can be undone. */
  replace(planes) {
    this.whole(() => {
      planes.forEach((plane, channel) => this.pattern[channel].set(plane));
      return this.pattern[0].keys();
    });
  }

  whole(act) {
    this.changed(new Set(act()));
    this.end();
  }

  /** Shows a pattern that came from elsewhere. A stroke that is under way goes on over its own. */
  accept(planes) {
    if (this.from !== null) return;
    planes.forEach((plane, channel) => this.pattern[channel].set(plane));
    this.history.record(this.pattern, this.pattern[0].keys());
  }

  undo() {
    this.step(this.history.undo(this.pattern));
  }

  redo() {
    this.step(this.history.redo(this.pattern));
  }

  step(changed) {
    if (changed === null) return;
    this.onChange(changed);
    this.onFinish();
  }

  changed(pixels) {
    for (const pixel of pixels) this.touched.add(pixel);
    this.onChange(pixels);
  }

  end() {
    if (this.touched.size === 0) return;
    this.history.record(this.pattern, this.touched);
    this.touched = new Set();
    this.onFinish();
  }

  shortcut(event) {
    const isTyping = event.target.matches("select, input:not([type=radio]):not([type=range]):not([type=checkbox])");
    if (isTyping || event.altKey) return;
    if (event.ctrlKey || event.metaKey) {
      const key = event.key.toLowerCase();
      if (key === "z" || key === "y") {
        event.preventDefault();
        if (key === "y" || event.shiftKey) this.redo();
        else this.undo();
      }
    } else if (KEYS[event.key]) {
      this.choose(KEYS[event.key]);
    } else if (event.key === "[" || event.key === "]") {
      this.controls.size.stepUp(event.key === "]" ? 1 : -1);
      this.controls.size.dispatchEvent(new Event("input"));
    }
  }
}
