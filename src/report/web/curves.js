// Curves that tell their values under the pointer, or at a cursor that arrow keys move.

import { formatDigits } from "./format.js";

/** The points of a curve: values `x`, `y` and their places in the drawing. */
export function readPoints(text) {
  return text
    .split(",")
    .filter((point) => point !== "")
    .map((point) => {
      const [x, y, left, top] = point.split(" ").map(Number);
      return { x, y, left, top };
    });
}

/** All values along the horizontal axis that some curve has a point at, in order. */
export function stopsOf(curves) {
  return [...new Set(curves.flatMap(({ points }) => points.map(({ x }) => x)))].sort((a, b) => a - b);
}

/** The point of each curve at `x`; curves without one are left out. */
export function pointsAt(curves, x) {
  return curves.flatMap((curve) => curve.points.filter((point) => point.x === x).map((point) => ({ ...point, ...curve, points: null })));
}

/** Text below a plot, for what the pointer shows. */
export function addTold(svg) {
  const told = document.createElement("p");
  told.className = "told";
  told.setAttribute("aria-live", "polite");
  told.textContent = "\u00a0";
  svg.after(told);
  return told;
}

/** The pointer's place in the units of a drawing. */
export function placeIn(svg, event) {
  const box = svg.getBoundingClientRect();
  const { width, height } = svg.viewBox.baseVal;
  return [((event.clientX - box.left) / box.width) * width, ((event.clientY - box.top) / box.height) * height];
}

function draw(svg, name, attributes) {
  const made = document.createElementNS(svg.namespaceURI, name);
  Object.entries(attributes).forEach(([key, value]) => made.setAttribute(key, String(value)));
  return made;
}

/** Lets a plot of curves tell values. */
export class Curves {
  constructor(svg) {
    this.svg = svg;
    this.curves = Array.from(svg.querySelectorAll("g[data-points]"), ({ dataset: { name, color, points } }) => ({ name, color, points: readPoints(points) }));
    this.stops = stopsOf(this.curves);
    if (this.stops.length === 0) return;
    this.told = addTold(svg);
    this.pointed = draw(svg, "g", { class: "pointed" });
    svg.append(this.pointed);
    svg.tabIndex = 0;
    svg.addEventListener("pointermove", (event) => this.point(event));
    svg.addEventListener("pointerleave", () => this.clear());
    svg.addEventListener("blur", () => this.clear());
    svg.addEventListener("keydown", (event) => this.key(event));
  }

  clear() {
    this.pointed.replaceChildren();
    this.told.textContent = "\u00a0";
  }

  point(event) {
    const [left] = placeIn(this.svg, event);
    const all = this.curves.flatMap(({ points }) => points);
    const closest = all.reduce((best, point) => (Math.abs(point.left - left) < Math.abs(best.left - left) ? point : best), all[0]);
    this.show(closest.x);
  }

  key(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.key === "Escape") this.clear();
    if (!step) return;
    event.preventDefault();
    const at = this.at === undefined ? (step > 0 ? -1 : this.stops.length) : this.stops.indexOf(this.at);
    this.show(this.stops[Math.min(this.stops.length - 1, Math.max(0, at + step))]);
  }

  /** Tells the value of each curve at `x`. */
  show(x) {
    this.at = x;
    const found = pointsAt(this.curves, x);
    const [, top, , bottom] = this.svg.dataset.frame.split(",").map(Number);
    const line = draw(this.svg, "line", { x1: found[0].left, x2: found[0].left, y1: top, y2: bottom, stroke: "currentColor", "stroke-opacity": 0.5 });
    const dots = found.map(({ left, top: y, color }) => draw(this.svg, "circle", { cx: left, cy: y, r: 5, fill: color, stroke: "currentColor" }));
    this.pointed.replaceChildren(line, ...dots);
    const parts = found.flatMap(({ y, name, color }) => {
      const swatch = document.createElement("i");
      swatch.style.background = color;
      return [swatch, `${name ? `${name} ` : ""}${formatDigits(y, 5)}`];
    });
    this.told.replaceChildren(`${this.svg.dataset.x} ${formatDigits(x, 5)}`, ...parts);
  }
}
