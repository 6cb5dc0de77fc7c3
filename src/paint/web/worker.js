// The worker of a page without server: it holds the matrix and answers the page.

import { decodeBase64, inflate, splitPlanes } from "../../report/web/values.js";
import { Layer, Matrix } from "./matrix.js";
import { solveBox } from "./solver.js";

/** Milliseconds between two reports of a solver that goes on. */
const REPORT_EVERY = 200;

const state = { layers: [], lights: [], light: 0, channels: 1, pattern: [], photo: [], ambient: [], task: 0 };

/** The bytes of a section. */
const unpack = (section) => inflate(decodeBase64(section));

/** The layers of a light: all of them for "all", all but the direct one for "global". */
function layersOf(light) {
  const holds = (layer) => light === "all" || layer === light || (light === "global" && layer !== "direct");
  return state.layers.filter((layer) => holds(layer.light)).map((layer) => layer.columns);
}

function matrix() {
  return new Matrix(layersOf(state.lights[state.light]), state.channels);
}

function isAll() {
  return state.lights[state.light] === "all";
}

function exactPhoto() {
  state.photo = matrix().multiply(state.pattern);
  if (!isAll()) return;
  state.photo.forEach((plane, channel) => plane.forEach((_, pixel) => (plane[pixel] += state.ambient[channel][pixel])));
}

const rounded = (planes) => planes.map((plane) => Float32Array.from(plane));

const tasks = {
  async open({ layers, lights, channels, ambient }) {
    Object.assign(state, { lights, channels });
    for (const layer of layers) {
      const positions = await unpack(layer.positions);
      const values = await Promise.all(layer.values.map(unpack));
      state.layers.push({ light: layer.light, columns: new Layer(layer, positions, values) });
    }
    const [{ columns: first }] = state.layers;
    const bytes = await unpack(ambient);
    state.ambient = splitPlanes(new Float32Array(bytes.buffer), first.rows);
    state.pattern = state.ambient.map(() => new Float32Array(first.columns));
    exactPhoto();
    return { planes: rounded(state.photo), exact: true };
  },

  update({ pixels, values, isFinished }) {
    const now = matrix();
    const isWhole = pixels === null || pixels.length * 3 > now.columns;
    values.forEach((plane, channel) => {
      if (pixels === null) state.pattern[channel].set(plane);
      else {
        pixels.forEach((pixel, index) => {
          const change = plane[index] - state.pattern[channel][pixel];
          state.pattern[channel][pixel] = plane[index];
          if (!isWhole && change !== 0) now.addColumn(channel, pixel, change, state.photo[channel]);
        });
      }
    });
    if (isWhole || isFinished) exactPhoto();
    return { planes: rounded(state.photo), exact: isWhole || isFinished };
  },

  light({ index }) {
    state.light = index;
    exactPhoto();
    return { planes: rounded(state.photo), exact: true };
  },

  column({ pixel }) {
    return { planes: rounded(matrix().column(pixel)) };
  },

  row({ pixel }) {
    return { planes: rounded(matrix().row(pixel)) };
  },

  /** Patterns for a wanted photo, channel by channel. Another task of this kind ends the one that runs. */
  async pattern({ target, weights, iterations }, report) {
    state.task += 1;
    const task = state.task;
    const all = new Matrix(layersOf("all"), state.channels);
    const planes = state.pattern.map((plane) => Float32Array.from(plane));
    const residuals = [];
    for (let channel = 0; channel < state.channels; channel += 1) {
      const wanted = target[channel].map((value, pixel) => value - state.ambient[channel][pixel]);
      let last = performance.now();
      const solved = solveBox(all, channel, { target: wanted, weights, bounds: [0, 1], iterations }, (x, residual) => {
        residuals[channel] = residual;
        if (performance.now() - last > REPORT_EVERY) {
          last = performance.now();
          planes[channel] = Float32Array.from(x);
          report({ planes, values: residuals, status: `relative residual ${Number(residual.toPrecision(4))}, going on` });
        }
        return residual > 1e-3;
      });
      planes[channel] = Float32Array.from(solved);
      if (task !== state.task) break;
    }
    const worst = Math.max(...residuals);
    return { planes, values: residuals, groups: [], status: `relative residual ${Number(worst.toPrecision(4))}` };
  },
};

self.onmessage = async ({ data: { id, task, ...rest } }) => {
  try {
    const found = await tasks[task](rest, (partial) => self.postMessage({ id, partial }));
    self.postMessage({ id, found });
  } catch (error) {
    self.postMessage({ id, error: String(error.message ?? error) });
  }
};
