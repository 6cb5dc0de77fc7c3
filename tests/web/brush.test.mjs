// Tools and undo of the painting page.

import assert from "node:assert/strict";
import { test } from "node:test";

import { Stroke, checker, coverage, fill, flood, gradient } from "../../src/paint/web/brush.js";
import { History } from "../../src/paint/web/history.js";

const size = { width: 8, height: 6 };
const dark = () => [new Float32Array(48)];

test("a hard brush covers whole pixels and a soft one fades to its edge", () => {
  assert.equal(coverage(1.9, 2, 0), 1);
  assert.equal(coverage(2, 2, 0), 0);
  assert.equal(coverage(0, 2, 1), 1);
  assert.ok(Math.abs(coverage(1, 2, 1) - 0.5) < 1e-12);
});

test("a brush of one pixel sets the pixel that it is on, and no other", () => {
  const pattern = dark();
  const changed = new Stroke(pattern, size, { size: 1, softness: 1, value: [0.75] }).moveTo([2.9, 3.1]);
  assert.deepEqual([...changed], [3 * 8 + 2]);
  assert.equal(pattern[0][26], 0.75);
});

test("a stroke covers no more where it passes twice", () => {
  const pattern = dark();
  const stroke = new Stroke(pattern, size, { size: 4, softness: 1, value: [1] });
  stroke.moveTo([2, 3]);
  const once = pattern[0].slice();
  stroke.moveTo([2, 3]);
  assert.deepEqual(pattern[0], once);
  // A new stroke goes on from there.
  new Stroke(pattern, size, { size: 4, softness: 1, value: [1] }).moveTo([2, 3]);
  assert.ok(pattern[0].some((value, pixel) => value > once[pixel]));
});

test("a fast stroke has no gaps", () => {
  const pattern = dark();
  const stroke = new Stroke(pattern, size, { size: 2, softness: 0, value: [1] });
  stroke.moveTo([0.5, 3]);
  stroke.moveTo([7.5, 3]);
  for (let column = 0; column < 8; column += 1) assert.equal(pattern[0][3 * 8 + column], 1, `column ${column}`);
});

test("fill stops at other values and does not run around the edges", () => {
  const pattern = dark();
  for (let row = 0; row < 6; row += 1) pattern[0][row * 8 + 4] = 0.5;
  const changed = fill(pattern, size, 0, [1]);
  assert.equal(changed.size, 6 * 4);
  assert.equal(pattern[0][5], 0);
  assert.equal(fill(pattern, size, 0, [1]).size, 0);
});

test("gradient, checker and flood cover the whole pattern", () => {
  const pattern = dark();
  assert.equal(gradient(pattern, size, [0, 3], [8, 3], [1]).size, 48);
  assert.ok(Math.abs(pattern[0][0] - 0.5 / 8) < 1e-6 && Math.abs(pattern[0][7] - 7.5 / 8) < 1e-6);
  checker(pattern, size, 2, [1]);
  assert.deepEqual([0, 1, 2, 16].map((pixel) => pattern[0][pixel]), [1, 1, 0, 0]);
  flood(pattern, size, [0.25]);
  assert.ok(pattern[0].every((value) => value === 0.25));
});

test("undo and redo go back and forth to the bit", () => {
  const pattern = [new Float32Array(48), new Float32Array(48), new Float32Array(48)];
  const history = new History(pattern);
  const states = [pattern.map((plane) => plane.slice())];
  for (const value of [0.3, 0.7]) {
    history.record(pattern, new Stroke(pattern, size, { size: 5, softness: 0.7, value: [value, 0.1, 0] }).moveTo([3, 3]));
    states.push(pattern.map((plane) => plane.slice()));
  }
  assert.ok(history.undo(pattern).size > 0);
  assert.deepEqual(pattern, states[1]);
  history.undo(pattern);
  assert.deepEqual(pattern, states[0]);
  assert.equal(history.undo(pattern), null);
  history.redo(pattern);
  history.redo(pattern);
  assert.deepEqual(pattern, states[2]);
  assert.equal(history.redo(pattern), null);
});

test("a new step forgets what was taken back, and old steps go when memory is full", () => {
  const pattern = [new Float32Array(1 << 20)];
  const history = new History(pattern);
  for (let step = 1; step <= 7; step += 1) {
    history.record(pattern, flood(pattern, { width: 1024, height: 1024 }, [step]));
  }
  assert.ok(history.bytes <= 64 * 1024 * 1024);
  history.undo(pattern);
  history.record(pattern, flood(pattern, { width: 1024, height: 1024 }, [99]));
  assert.equal(history.redo(pattern), null);
});
