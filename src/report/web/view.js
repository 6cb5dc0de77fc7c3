// Zoom and pan, which several pictures share.

const LARGEST = 64;

/** What part of a picture is seen. `x` and `y` are the picture's centre of view in shares of its size. */
export class View {
  constructor() {
    this.listeners = new Set();
    this.reset();
  }

  /** Shows the whole picture. */
  reset() {
    this.zoom = 1;
    this.x = 0.5;
    this.y = 0.5;
    this.changed();
  }

  /** Zooms by a factor; the place `(x, y)`, in shares of the picture, stays where it is. */
  zoomAt(factor, x, y) {
    const zoom = Math.min(LARGEST, Math.max(1, this.zoom * factor));
    const kept = this.zoom / zoom;
    this.x = x + (this.x - x) * kept;
    this.y = y + (this.y - y) * kept;
    this.zoom = zoom;
    this.bound();
    this.changed();
  }

  /** Moves the view, in shares of the picture. */
  pan(x, y) {
    this.x += x;
    this.y += y;
    this.bound();
    this.changed();
  }

  /** The CSS transform of a picture whose box is as large as its frame. */
  transform() {
    const shift = (at) => `${(100 * (0.5 - at) * this.zoom).toFixed(4)}%`;
    return `translate(${shift(this.x)}, ${shift(this.y)}) scale(${this.zoom})`;
  }

  bound() {
    const half = 0.5 / this.zoom;
    this.x = Math.min(1 - half, Math.max(half, this.x));
    this.y = Math.min(1 - half, Math.max(half, this.y));
  }

  changed() {
    this.listeners.forEach((listener) => listener(this));
  }
}
