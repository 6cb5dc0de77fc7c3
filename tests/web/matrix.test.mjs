// The matrix in a page without server, and the solver on it.

import assert from "node:assert/strict";
import { test } from "node:test";

import { Layer, Matrix } from "../../src/paint/web/matrix.js";
import { solveBox } from "../../src/paint/web/solver.js";

/** Packs a dense matrix by its columns, as src/paint/embedded.rs does. */
function packed(dense, symmetric) {
  const size = dense.length;
  const columns = dense[0].length;
  const positions = [];
  const put = (value) => {
    while (value > 127) {
      positions.push((value & 127) | 128);
      value >>= 7;
    }
    positions.push(value);
  };
  const kept = Array.from({ length: columns }, (_, column) =>
    Array.from({ length: size }, (__, row) => row).filter((row) => dense[row][column] !== 0 && (!symmetric || row >= column)),
  );
  kept.forEach((rows) => put(rows.length));
  kept.forEach((rows) => rows.reduce((last, row) => (put(row - last), row), 0));
  const values = Float32Array.from(kept.flatMap((rows, column) => rows.map((row) => dense[row][column])));
  const layer = { rows: size, columns, symmetric, precision: "single", scales: [1] };
  return new Layer(layer, Uint8Array.from(positions), [new Uint8Array(values.buffer)]);
}

/** A symmetric matrix with a few entries, some of them far apart. Its diagonal exceeds the rest of each row by 1 and more. */
function dense(size) {
  const matrix = Array.from({ length: size }, () => Array.from({ length: size }, () => 0));
  for (let row = 0; row < size; row += 1) {
    matrix[row][row] = 2 + (row % 3);
    for (const column of [(row * 7) % size, (row + 150) % size]) {
      matrix[row][column] += 0.25;
      matrix[column][row] += 0.25;
    }
  }
  return matrix;
}

const product = (matrix, x) => matrix.map((row) => row.reduce((sum, value, column) => sum + value * x[column], 0));

test("both halves of a symmetric matrix come back, with distances of more than one byte", () => {
  const all = dense(300);
  const matrix = new Matrix([packed(all, true)], 1);
  const x = Float32Array.from({ length: 300 }, (_, index) => Math.fround(Math.sin(index)));
  const expected = product(all, x);
  matrix.multiply([x])[0].forEach((value, row) => assert.ok(Math.abs(value - expected[row]) < 1e-9));
  assert.deepEqual([...matrix.column(17)[0]], all.map((row) => row[17]));
  assert.deepEqual([...matrix.row(17)[0]], all[17]);
});

test("a matrix that is not symmetric has rows and columns of its own, and layers add up", () => {
  const all = [[1, 0, 2], [0, 3, 0]];
  const matrix = new Matrix([packed(all, false), packed(all, false)], 1);
  assert.deepEqual([...matrix.multiply([[1, 1, 1]])[0]], [6, 6]);
  assert.deepEqual([...matrix.multiplyTransposed([[1, 1]])[0]], [2, 6, 4]);
  assert.deepEqual([...matrix.row(0)[0]], [2, 0, 4]);
});

test("strokes add up to the whole product", () => {
  const matrix = new Matrix([packed(dense(300), true)], 1);
  const pattern = [new Float64Array(300)];
  const photo = matrix.multiply(pattern)[0];
  for (let step = 0; step < 400; step += 1) {
    const [pixel, value] = [(step * 37) % 300, Math.fround(Math.abs(Math.sin(step)))];
    matrix.addColumn(0, pixel, value - pattern[0][pixel], photo);
    pattern[0][pixel] = value;
  }
  matrix.multiply(pattern)[0].forEach((value, pixel) => assert.ok(Math.abs(value - photo[pixel]) < 1e-10));
});

test("half floats are read, the smallest among them", () => {
  const layer = { rows: 4, columns: 1, symmetric: false, precision: "half", scales: [2] };
  const bits = new Uint8Array([0x00, 0x3c, 0x01, 0x00, 0x00, 0xc2, 0xff, 0x7b]);
  const matrix = new Matrix([new Layer(layer, Uint8Array.from([4, 0, 1, 1, 1]), [bits])], 1);
  assert.deepEqual([...matrix.column(0)[0]], [2, 2 ** -23, -6, 131008]);
});

test("the solver stays within its bounds and finds what the box allows", () => {
  const all = dense(60);
  const matrix = new Matrix([packed(all, true)], 1);
  const truth = Float64Array.from({ length: 60 }, (_, index) => (index % 4) / 3);
  const target = Float64Array.from(product(all, truth));
  const weights = new Float64Array(60).fill(1);
  let last = 1;
  const solved = solveBox(matrix, 0, { target, weights, bounds: [0, 1], iterations: 300 }, (_, residual) => {
    last = residual;
    return residual > 1e-6;
  });
  assert.ok(last < 1e-5, `relative residual ${last}`);
  solved.forEach((value, index) => assert.ok(value >= 0 && value <= 1 && Math.abs(value - truth[index]) < 1e-3));
});

test("where nothing counts the pattern stays dark", () => {
  const matrix = new Matrix([packed(dense(60), true)], 1);
  const weights = Float64Array.from({ length: 60 }, (_, index) => (index < 5 ? 1 : 0));
  const target = new Float64Array(60).fill(1);
  const solved = solveBox(matrix, 0, { target, weights, bounds: [0, 1], iterations: 50 }, () => true);
  assert.ok(solved.some((value) => value > 0) && solved.some((value) => value === 0));
});
