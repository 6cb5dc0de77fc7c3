// Values as colours. A plane is an array with one value for each pixel, row by row; an image has one plane or three.

/** The share of the brightest values that automatic exposure lets saturate. */
const SATURATED = 0.005;

/** The exposure at which all but the brightest 0.5 % of the values are shown at most as white. */
export function autoExposure(planes) {
  const sizes = [];
  for (const plane of planes) {
    for (const value of plane) if (value !== 0 && Number.isFinite(value)) sizes.push(Math.abs(value));
  }
  if (sizes.length === 0) return 1;
  const sorted = Float64Array.from(sizes).sort();
  return 1 / sorted[Math.min(sorted.length - 1, Math.ceil(sorted.length * (1 - SATURATED)) - 1)];
}

/** The displayed level, 0 to 255, of a value. `gamma` is a number, or `"srgb"` for the curve of sRGB. */
export function displayLevel(value, { exposure, gamma }) {
  const bounded = Math.min(1, Math.max(0, value * exposure));
  if (gamma === "srgb") return Math.round(255 * (bounded <= 0.0031308 ? 12.92 * bounded : 1.055 * bounded ** (1 / 2.4) - 0.055));
  return Math.round(255 * bounded ** (1 / gamma));
}

/** Whether any value is negative. */
export function isSigned(planes) {
  return planes.some((plane) => plane.some((value) => value < 0));
}

/** Levels of the displayed gray between 0 and 1, by 4096 steps: a power for every pixel would take longer than the photo. */
const tables = new Map();
const STEPS = 4096;

function levels(gamma) {
  let table = tables.get(gamma);
  if (!table) {
    table = new Uint8Array(STEPS + 1);
    for (let step = 0; step <= STEPS; step += 1) table[step] = displayLevel(step / STEPS, { exposure: 1, gamma });
    tables.clear();
    tables.set(gamma, table);
  }
  return table;
}

/**
 * Paints planes into RGBA bytes. `signedColors` are the RGB colours from −1 to 1 in a row, for planes with negative values;
 * of three signed planes the mean is shown.
 */
export function paintPlanes(planes, rgba, tone, signedColors) {
  const [red, green, blue] = planes.length === 3 ? planes : [planes[0], planes[0], planes[0]];
  if (signedColors && isSigned(planes)) {
    const last = signedColors.length / 3 - 1;
    for (let pixel = 0; pixel < red.length; pixel += 1) {
      const mean = (red[pixel] + green[pixel] + blue[pixel]) / 3;
      const bounded = Math.min(1, Math.max(-1, mean * tone.exposure));
      const color = 3 * Math.round(0.5 * (1 + bounded) * last);
      rgba.set([signedColors[color], signedColors[color + 1], signedColors[color + 2], 255], 4 * pixel);
    }
    return;
  }
  const table = levels(tone.gamma);
  const scale = STEPS * tone.exposure;
  const level = (value) => table[Math.min(STEPS, Math.max(0, Math.round(value * scale)))];
  for (let pixel = 0, at = 0; pixel < red.length; pixel += 1, at += 4) {
    rgba[at] = level(red[pixel]);
    rgba[at + 1] = level(green[pixel]);
    rgba[at + 2] = level(blue[pixel]);
    rgba[at + 3] = 255;
  }
}

/** Paints labels into RGBA bytes. `colors` are RGB bytes of the labels 0 to 255. */
export function paintLabels(labels, rgba, colors) {
  labels.forEach((label, pixel) => rgba.set([colors[3 * label], colors[3 * label + 1], colors[3 * label + 2], 255], 4 * pixel));
}
