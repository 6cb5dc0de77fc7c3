// From changes of the pattern to photos: one request is under way at a time, and what comes meanwhile is sent together afterwards.

/** Keeps a source busy with the newest pattern. */
export class Conductor {
  /** `onPhoto(planes, isExact)` is called with each photo. */
  constructor(source, pattern, onPhoto) {
    this.source = source;
    this.pattern = pattern;
    this.onPhoto = onPhoto;
    this.changed = new Set();
    this.isFinished = false;
    this.isWhole = false;
    this.isBusy = false;
    this.settled = [];
  }

  /** These pixels of the pattern have changed. */
  change(pixels) {
    for (const pixel of pixels) this.changed.add(pixel);
    // A long list costs more than the pattern.
    this.isWhole ||= this.changed.size * 2 > this.pattern[0].length;
    return this.go();
  }

  /** The stroke has ended: the exact photo is wanted. */
  finish() {
    this.isFinished = true;
    return this.go();
  }

  /** Resolves when nothing is under way. */
  whenSettled() {
    return this.isBusy ? new Promise((resolve) => this.settled.push(resolve)) : Promise.resolve();
  }

  async go() {
    if (this.isBusy) return;
    this.isBusy = true;
    while (this.changed.size > 0 || this.isFinished) {
      const pixels = this.isWhole ? null : Uint32Array.from(this.changed);
      const at = (plane) => (pixels === null ? plane.slice() : Float32Array.from(pixels, (pixel) => plane[pixel]));
      const { isFinished } = this;
      this.changed = new Set();
      this.isFinished = false;
      this.isWhole = false;
      const shown = await this.source.update({ pixels, values: this.pattern.map(at), isFinished });
      if (shown) this.onPhoto(shown.planes, shown.exact);
    }
    this.isBusy = false;
    this.settled.splice(0).forEach((resolve) => resolve());
  }
}
