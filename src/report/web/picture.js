// A picture with exact values: one canvas pixel for each sample, scaled without smoothing.

import { paintPlanes } from "./color.js";

/** A canvas that shows planes, and tells which pixel is under the pointer. */
export class Picture {
  /** `canvas` lies in a frame that cuts off what the view does not show. */
  constructor(canvas, { width, height }, view, signedColors) {
    this.canvas = canvas;
    this.width = width;
    this.height = height;
    this.view = view;
    this.signedColors = signedColors;
    this.tone = { exposure: 1, gamma: 1 };
    this.planes = [new Float32Array(width * height)];
    canvas.width = width;
    canvas.height = height;
    this.context = canvas.getContext("2d");
    this.image = this.context.createImageData(width, height);
    view.listeners.add(() => this.place());
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.place();
    this.draw();
  }

  /** Shows these planes. They are not copied. */
  show(planes, tone = this.tone) {
    this.planes = planes;
    this.tone = tone;
    this.draw();
  }

  /** Shows colours that are no light, such as labels: `paint` fills the RGBA bytes. */
  showPainted(paint) {
    paint(this.image.data);
    this.context.putImageData(this.image, 0, 0);
  }

  draw() {
    this.showPainted((rgba) => paintPlanes(this.planes, rgba, this.tone, this.signedColors));
  }

  place() {
    this.canvas.style.transform = this.view.transform();
  }

  /** The place under the pointer in pixels of the picture, as real numbers; it may lie outside. */
  placeOf(event) {
    const box = this.canvas.getBoundingClientRect();
    return [((event.clientX - box.left) / box.width) * this.width, ((event.clientY - box.top) / box.height) * this.height];
  }

  /** The pixel at a place, or −1 outside of the picture. */
  pixelAt([x, y]) {
    const [column, row] = [Math.floor(x), Math.floor(y)];
    const isInside = column >= 0 && row >= 0 && column < this.width && row < this.height;
    return isInside ? row * this.width + column : -1;
  }

  /** The values of a pixel, one for each plane. */
  values(pixel) {
    return this.planes.map((plane) => plane[pixel]);
  }

  wheel(event) {
    event.preventDefault();
    const [x, y] = this.placeOf(event);
    this.view.zoomAt(2 ** (-event.deltaY / 300), x / this.width, y / this.height);
  }
}
