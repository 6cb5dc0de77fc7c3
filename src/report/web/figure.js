// A picture of the page: its values, its marks, and what is drawn over it.

import { paintPlanes } from "./color.js";
import { formatPixel } from "./format.js";
import { tellValues, unpackPlanes } from "./values.js";

/** Digits of the values that a picture tells: as many as single precision holds for sure. */
const DIGITS = 6;

/** A picture and what the page knows of it. */
export class Figure {
  /** `view` is the zoom of the section. */
  constructor(element, view) {
    this.element = element;
    this.about = JSON.parse(element.dataset.picture);
    this.view = view;
    this.frame = element.querySelector(".frame");
    this.img = this.frame.querySelector("img");
    this.caption = element.querySelector("figcaption").textContent;
    this.frame.classList.add("live");
    this.frame.tabIndex = 0;
    this.frame.setAttribute("role", "group");
    this.frame.setAttribute("aria-label", `${this.caption}. Arrow keys tell values, Space compares pictures, Enter enlarges.`);
    element.setAttribute("style", `--ratio: ${this.about.width / this.about.height}`);
    const rect = (name) => `<rect class="${name}" width="2" height="2"/>`;
    const size = `0 0 ${this.about.width} ${this.about.height}`;
    this.frame.insertAdjacentHTML("beforeend", `<svg class="marks" viewBox="${size}" aria-hidden="true">${rect("under")}${rect("over")}</svg>`);
    this.marks = this.frame.querySelector(".marks");
    this.mark(-1);
    view.listeners.add(() => this.place());
  }

  /** The values, one plane or three; `null` where the page does not hold them. */
  planes() {
    this.loaded ??= this.load();
    return this.loaded;
  }

  async load() {
    const { values, width, height } = this.about;
    // Browsers from before 2023 may not inflate.
    if (!values || typeof DecompressionStream === "undefined") return null;
    this.ready = await unpackPlanes(document.getElementById(values).textContent, width * height);
    return this.ready;
  }

  /** What a pixel's value is, in words. */
  async tell(pixel) {
    const planes = await this.planes();
    if (!planes) return this.about.file ? `its value is in ${this.about.file}` : "";
    const values = planes.map((plane) => plane[pixel]);
    return tellValues(this.about, values, (numbers, unit) => formatPixel(numbers, unit, DIGITS), (label) => this.nameOf(label));
  }

  /** The name of a label: the legend lists those that occur in ascending order. */
  nameOf(label) {
    if (!this.names) {
      const there = [...new Set(this.ready[0])].sort((a, b) => a - b);
      const texts = Array.from(this.element.querySelectorAll(".swatches li"), (swatch) => swatch.textContent.trim());
      this.names = new Map(there.map((of, index) => [of, (texts[index] ?? "").replace(/^(group \d+|masked): .*$/, "$1")]));
    }
    return (label === this.about.masked ? "masked" : this.names.get(label)) || `region ${label}`;
  }

  /** The pixel under a pointer; −1 outside. */
  pixelAt(event) {
    const box = this.img.getBoundingClientRect();
    const column = Math.floor(((event.clientX - box.left) / box.width) * this.about.width);
    const row = Math.floor(((event.clientY - box.top) / box.height) * this.about.height);
    const isInside = column >= 0 && row >= 0 && column < this.about.width && row < this.about.height;
    return isInside ? row * this.about.width + column : -1;
  }

  placeOf(pixel) {
    return [pixel % this.about.width, Math.floor(pixel / this.about.width)];
  }

  /** Draws a frame around a pixel; −1 takes it away. */
  mark(pixel) {
    this.marks.classList.toggle("off", pixel < 0);
    const [x, y] = this.placeOf(Math.max(0, pixel));
    for (const rect of this.marks.children) {
      rect.setAttribute("x", String(x - 0.5));
      rect.setAttribute("y", String(y - 0.5));
    }
  }

  /** Zooms and moves the picture as the view says. */
  place() {
    for (const layer of [this.img, this.marks, this.canvas, this.flipped]) {
      if (layer) layer.style.transform = this.view.transform();
    }
    this.frame.classList.toggle("moved", this.view.zoom > 1);
  }

  layer(name) {
    const canvas = document.createElement("canvas");
    canvas.className = name;
    canvas.width = this.about.width;
    canvas.height = this.about.height;
    canvas.style.transform = this.view.transform();
    this.frame.insertBefore(canvas, this.marks);
    return canvas;
  }

  /** Shows light at another exposure; 0 is that of the picture. */
  async develop(stops) {
    if (this.about.kind !== "light") return;
    this.stops = stops;
    const planes = await this.planes();
    // Another exposure may have been chosen in the meantime.
    if (!planes || this.stops !== stops) return;
    const white = this.about.white / 2 ** stops;
    const end = this.element.querySelector(".scale span b:last-child");
    this.end ??= end?.textContent;
    if (end) end.textContent = stops === 0 ? this.end : formatPixel([white], "", 3);
    this.canvas ??= this.layer("developed");
    this.canvas.hidden = stops === 0;
    if (stops === 0) return;
    const context = this.canvas.getContext("2d");
    const image = context.createImageData(this.about.width, this.about.height);
    paintPlanes(planes, image.data, { exposure: 1 / white, gamma: "srgb" });
    context.putImageData(image, 0, 0);
  }

  /** Shows another picture in this one's place; `null` shows this one again. */
  async flip(other) {
    this.isFlipped = other !== null;
    if (other) {
      const shown = other.canvas && !other.canvas.hidden ? other.canvas : other.img;
      if (shown === other.img) await shown.decode().catch(() => {});
      if (!this.isFlipped) return;
      this.flipped ??= this.layer("flipped");
      const context = this.flipped.getContext("2d");
      context.imageSmoothingEnabled = false;
      context.drawImage(shown, 0, 0, this.about.width, this.about.height);
    }
    if (this.flipped) this.flipped.hidden = !other;
  }
}
