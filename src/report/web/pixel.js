// One pixel in all pictures: its groups, its coordinates, its light, and its row of the matrix as far as eigenvectors tell.

import { autoExposure, paintPlanes } from "./color.js";
import { formatNumber } from "./format.js";
import { coordinate, rowOf } from "./values.js";

/** A card with everything that the page knows of a pixel. */
export class PixelCard {
  /** `paint` is the address of a page that holds the matrix; empty where there is none. */
  constructor(figures, paint) {
    Object.assign(this, { figures, paint, pixel: -1 });
    this.element = document.createElement("aside");
    this.element.id = "pixel";
    this.element.hidden = true;
    this.element.tabIndex = 0;
    this.element.setAttribute("aria-label", "A pixel in all pictures");
    this.element.addEventListener("keydown", (event) => event.key === "Escape" && this.hide());
    document.body.append(this.element);
  }

  hide() {
    this.pixel = -1;
    this.element.hidden = true;
    this.figures.forEach((figure) => figure.mark(-1));
    if (this.before?.isConnected && this.element.contains(document.activeElement)) this.before.focus();
  }

  /** Shows a pixel of a picture, and marks it in all pictures of that size; the same pixel again hides the card. */
  async show(figure, pixel, before = null) {
    if (pixel < 0 || pixel === this.pixel) {
      this.hide();
      return;
    }
    Object.assign(this, { pixel, before });
    const { width, height } = figure.about;
    const alike = this.figures.filter(({ about }) => about.width === width && about.height === height);
    this.figures.forEach((other) => other.mark(alike.includes(other) ? pixel : -1));
    const parts = await Promise.all(this.sections(alike).map(([title, of]) => this.table(title, of, pixel)));
    const row = await this.row(alike, pixel);
    if (this.pixel !== pixel) return;
    const [x, y] = figure.placeOf(pixel);
    const [first, ...others] = parts;
    this.element.replaceChildren(this.header(x, y), first, ...row, ...this.link(x, y), ...others);
    this.element.hidden = false;
  }

  header(x, y) {
    const header = document.createElement("header");
    const title = document.createElement("h2");
    title.textContent = `Column ${x}, row ${y}`;
    const close = document.createElement("button");
    close.type = "button";
    close.textContent = "Close";
    close.addEventListener("click", () => this.hide());
    header.append(title, close);
    return header;
  }

  /** Pictures by the title of their section. */
  sections(figures) {
    const found = new Map();
    for (const figure of figures) {
      const title = figure.home.querySelector("h2").textContent;
      found.set(title, [...(found.get(title) ?? []), figure]);
    }
    return [...found];
  }

  async table(title, figures, pixel) {
    const part = document.createElement("div");
    const heading = document.createElement("h3");
    heading.textContent = title;
    const table = document.createElement("table");
    for (const figure of figures) {
      const row = table.insertRow();
      const name = document.createElement("th");
      name.scope = "row";
      name.textContent = figure.about.name || figure.caption;
      row.append(name);
      row.insertCell().textContent = await this.text(figure, pixel);
    }
    part.append(heading, table);
    return part;
  }

  async text(figure, pixel) {
    const text = await figure.tell(pixel);
    const weighted = figure.ready ? coordinate(figure.about, figure.ready[0][pixel]) : null;
    return weighted === null ? text : `${text}, coordinate ${formatNumber(weighted)}`;
  }

  /** The pixel's row as far as eigenvectors tell, where the page has them with the light that they are of. */
  async row(figures, pixel) {
    const vectors = figures.filter(({ about }) => about.kind === "eigenvector" && about.eigenvalue !== null);
    const degree = figures.find(({ about }) => about.name === "degree");
    if (!degree || vectors.length < 2) return [];
    const planes = await Promise.all([degree, ...vectors].map((figure) => figure.planes()));
    if (planes.some((of) => of === null)) return [];
    const [[light], ...entries] = planes;
    const row = rowOf(pixel, light, entries.map(([plane]) => plane), vectors.map(({ about }) => about.eigenvalue));
    const canvas = document.createElement("canvas");
    Object.assign(canvas, { width: degree.about.width, height: degree.about.height });
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", "The pixel's row of the matrix, of low rank");
    const context = canvas.getContext("2d");
    const image = context.createImageData(canvas.width, canvas.height);
    paintPlanes([row], image.data, { exposure: autoExposure([row]), gamma: "srgb" });
    context.putImageData(image, 0, 0);
    const heading = document.createElement("h3");
    heading.textContent = "Its row of the matrix, of low rank";
    const note = document.createElement("p");
    note.textContent = `Where the light of this pixel goes and comes from, as far as ${vectors.length} eigenvectors tell; what they leave out is missing.`;
    return [heading, canvas, note];
  }

  link(x, y) {
    if (!this.paint) return [];
    const note = document.createElement("p");
    const link = document.createElement("a");
    link.href = `${this.paint}#pixel=${x},${y}`;
    link.textContent = "The exact row, on the page that holds the matrix";
    note.append(link);
    return [note];
  }
}
