// Undo and redo: of each step the pixels that it changed, with their values before and after.

/** The most bytes that are kept; the oldest steps go first. */
const MOST_BYTES = 64 * 1024 * 1024;

export class History {
  constructor(pattern) {
    this.kept = pattern.map((plane) => plane.slice());
    this.steps = [];
    this.undone = [];
    this.bytes = 0;
  }

  /** Records what changed since the last record. `changed` are the pixels that may have. */
  record(pattern, changed) {
    const differs = (pixel) => pattern.some((plane, channel) => plane[pixel] !== this.kept[channel][pixel]);
    const pixels = Uint32Array.from([...changed].filter(differs));
    if (pixels.length === 0) return;
    const at = (planes) => planes.map((plane) => Float32Array.from(pixels, (pixel) => plane[pixel]));
    const step = { pixels, before: at(this.kept), after: at(pattern) };
    this.steps.push(step);
    this.undone = [];
    this.put(this.kept, step.pixels, step.after);
    this.bytes += size(step);
    while (this.bytes > MOST_BYTES && this.steps.length > 1) this.bytes -= size(this.steps.shift());
  }

  /** Takes the last step back; returns the pixels that changed, or `null` where there is nothing to undo. */
  undo(pattern) {
    return this.move(pattern, this.steps, this.undone, "before");
  }

  /** Does the last step that was taken back again. */
  redo(pattern) {
    return this.move(pattern, this.undone, this.steps, "after");
  }

  move(pattern, from, to, values) {
    const step = from.pop();
    if (!step) return null;
    to.push(step);
    this.put(pattern, step.pixels, step[values]);
    this.put(this.kept, step.pixels, step[values]);
    return new Set(step.pixels);
  }

  put(planes, pixels, values) {
    planes.forEach((plane, channel) => pixels.forEach((pixel, index) => (plane[pixel] = values[channel][index])));
  }
}

function size({ pixels, before }) {
  return 4 * pixels.length * (1 + 2 * before.length);
}
