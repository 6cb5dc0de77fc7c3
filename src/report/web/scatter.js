// Points that stand for pixels: which pixel is under the pointer, and its coordinates.

import { formatNumber } from "./format.js";
import { addTold, placeIn } from "./curves.js";
import { coordinate } from "./values.js";

/** How far from a point the pointer still means it, in units of the drawing. */
const REACH = 14;

/** The number of the point that is nearest to a place; −1 where none is within reach. */
export function nearestPoint(points, [x, y], reach) {
  let [best, least] = [-1, reach * reach];
  points.forEach(([left, top], index) => {
    const distance = (left - x) ** 2 + (top - y) ** 2;
    if (distance < least) [best, least] = [index, distance];
  });
  return best;
}

/** Lets a plot of pixels tell which pixel a point is. */
export class Scatter {
  /** `eigenvectors` are their pictures, in order; `pin` shows a pixel of one of them. */
  constructor(svg, eigenvectors, pin) {
    const group = svg.querySelector("g[data-pixels]");
    this.pixels = group.dataset.pixels.split(" ").map(Number);
    this.axes = group.dataset.axes.split(",").map(Number);
    this.dots = [...group.querySelectorAll("circle")];
    this.points = this.dots.map((dot) => [Number(dot.getAttribute("cx")), Number(dot.getAttribute("cy"))]);
    Object.assign(this, { svg, eigenvectors });
    this.told = addTold(svg);
    svg.addEventListener("pointermove", (event) => this.point(event));
    svg.addEventListener("pointerleave", () => this.choose(-1));
    svg.addEventListener("click", () => this.at >= 0 && eigenvectors[0] && pin(eigenvectors[0], this.pixels[this.at]));
  }

  async point(event) {
    const at = nearestPoint(this.points, placeIn(this.svg, event), REACH);
    if (at !== this.at) await this.choose(at);
  }

  async choose(at) {
    this.dots[this.at]?.removeAttribute("stroke");
    this.at = at;
    this.dots[at]?.setAttribute("stroke", "currentColor");
    this.told.textContent = "\u00a0";
    const figures = this.axes.map((axis) => this.eigenvectors[axis]);
    if (at < 0 || figures.some((figure) => !figure)) return;
    const planes = await Promise.all(figures.map((figure) => figure.planes()));
    if (this.at !== at || planes.some((plane) => plane === null)) return;
    const pixel = this.pixels[at];
    const parts = figures.map((figure, index) => `${figure.about.name}: ${formatNumber(coordinate(figure.about, planes[index][0][pixel]))}`);
    this.told.textContent = `Pixel (${figures[0].placeOf(pixel).join(", ")}), ${parts.join(", ")}. A click shows it in all pictures.`;
  }
}
