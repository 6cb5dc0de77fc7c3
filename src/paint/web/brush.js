// What the tools do to a pattern. A pattern is a list of planes, one or three, of `width·height` values each.

/** The share of its value that a brush leaves at a distance from its middle: 1 inside, 0 from the radius on. */
export function coverage(distance, radius, softness) {
  // A brush of one pixel always covers the pixel that it is on.
  const edge = Math.max(radius, 0.5);
  const inner = edge * (1 - softness);
  if (distance < inner) return 1;
  if (distance >= edge) return 0;
  const t = (edge - distance) / (edge - inner);
  return t * t * (3 - 2 * t);
}

/** A stroke in progress: where it passes twice, it covers no more than once. */
export class Stroke {
  /** `brush` has `size` (a diameter in pixels), `softness` (0 to 1) and `value` (a number for each plane). */
  constructor(pattern, { width, height }, brush) {
    this.pattern = pattern;
    this.width = width;
    this.height = height;
    this.brush = brush;
    this.base = pattern.map((plane) => plane.slice());
    this.covered = new Float32Array(width * height);
    this.last = null;
  }

  /** Goes on to a place; returns the pixels that changed. */
  moveTo(place) {
    const from = this.last ?? place;
    const [dx, dy] = [place[0] - from[0], place[1] - from[1]];
    const steps = Math.max(1, Math.ceil(Math.hypot(dx, dy) / Math.max(0.5, this.brush.size / 8)));
    const changed = new Set();
    for (let step = this.last ? 1 : 0; step <= steps; step += 1) {
      this.dab(from[0] + (dx * step) / steps, from[1] + (dy * step) / steps, changed);
    }
    this.last = place;
    return changed;
  }

  dab(x, y, changed) {
    const radius = this.brush.size / 2;
    const [left, right] = [Math.max(0, Math.floor(x - radius)), Math.min(this.width - 1, Math.floor(x + radius))];
    const [top, bottom] = [Math.max(0, Math.floor(y - radius)), Math.min(this.height - 1, Math.floor(y + radius))];
    for (let row = top; row <= bottom; row += 1) {
      for (let column = left; column <= right; column += 1) {
        const isUnder = Math.floor(x) === column && Math.floor(y) === row;
        const distance = isUnder && radius <= 0.75 ? 0 : Math.hypot(column + 0.5 - x, row + 0.5 - y);
        this.cover(row * this.width + column, coverage(distance, radius, this.brush.softness), changed);
      }
    }
  }

  cover(pixel, share, changed) {
    if (share <= this.covered[pixel]) return;
    this.covered[pixel] = share;
    this.pattern.forEach((plane, channel) => {
      const base = this.base[channel][pixel];
      plane[pixel] = base + share * (this.brush.value[channel] - base);
    });
    changed.add(pixel);
  }
}

/** Fills the connected pixels that are as the one that is given; returns those that changed. */
export function fill(pattern, { width, height }, start, value) {
  const as = (pixel) => pattern.every((plane) => plane[pixel] === plane[start]);
  const changed = new Set();
  if (pattern.every((plane, channel) => plane[start] === Math.fround(value[channel]))) return changed;
  const isSame = Uint8Array.from({ length: width * height }, (_, pixel) => (as(pixel) ? 1 : 0));
  const waiting = [start];
  isSame[start] = 0;
  while (waiting.length > 0) {
    const pixel = waiting.pop();
    changed.add(pixel);
    const column = pixel % width;
    const next = [pixel - width, pixel + width];
    if (column > 0) next.push(pixel - 1);
    if (column + 1 < width) next.push(pixel + 1);
    for (const neighbour of next) {
      if (isSame[neighbour] === 1) {
        isSame[neighbour] = 0;
        waiting.push(neighbour);
      }
    }
  }
  for (const pixel of changed) pattern.forEach((plane, channel) => (plane[pixel] = value[channel]));
  return changed;
}

/** A linear change over the whole pattern, from 0 at one place to the value at another. */
export function gradient(pattern, { width, height }, from, to, value) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const length = dx * dx + dy * dy;
  return whole(pattern, width, height, (column, row) => {
    const along = length > 0 ? ((column + 0.5 - from[0]) * dx + (row + 0.5 - from[1]) * dy) / length : 1;
    const share = Math.min(1, Math.max(0, along));
    return value.map((level) => share * level);
  });
}

/** A checkerboard over the whole pattern with squares of `size` pixels, of the value and 0. */
export function checker(pattern, { width, height }, size, value) {
  const square = Math.max(1, Math.round(size));
  return whole(pattern, width, height, (column, row) =>
    (Math.floor(column / square) + Math.floor(row / square)) % 2 === 0 ? value : value.map(() => 0),
  );
}

/** Every pixel of one value. */
export function flood(pattern, { width, height }, value) {
  return whole(pattern, width, height, () => value);
}

function whole(pattern, width, height, valueAt) {
  const changed = new Set();
  for (let pixel = 0; pixel < width * height; pixel += 1) {
    const value = valueAt(pixel % width, Math.floor(pixel / width));
    pattern.forEach((plane, channel) => (plane[pixel] = value[channel]));
    changed.add(pixel);
  }
  return changed;
}
