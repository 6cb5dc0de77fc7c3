// Files, colours and numbers of pages.

import assert from "node:assert/strict";
import { test } from "node:test";

import { autoExposure, displayLevel, paintPlanes } from "../../src/report/web/color.js";
import { formatNumber, formatPixel } from "../../src/report/web/format.js";
import { decodeNpy, encodeNpy } from "../../src/report/web/numpy.js";
import { View } from "../../src/report/web/view.js";
import { encodeExr } from "../../src/paint/web/exr.js";
import { asPlanes, linearFromSrgb, planesToNpy } from "../../src/paint/web/files.js";

test("arrays are written and read back, and broken ones are refused by what is wrong", () => {
  const bytes = encodeNpy([2, 3], Float32Array.from([1, 2, 3, 4, 5, 6.5]));
  assert.equal((bytes.length - 24) % 64, 0);
  const { shape, values } = decodeNpy(bytes);
  assert.deepEqual([shape, [...values]], [[2, 3], [1, 2, 3, 4, 5, 6.5]]);
  assert.throws(() => decodeNpy(bytes.slice(0, 140)), /cut short/);
  assert.throws(() => decodeNpy(new Uint8Array(40)), /no .npy/);
});

test("a coloured pattern has its channels last in a file", () => {
  const planes = [[1, 2], [3, 4], [5, 6]].map((plane) => Float32Array.from(plane));
  const { shape, values } = decodeNpy(planesToNpy(planes, { width: 2, height: 1 }));
  assert.deepEqual([shape, [...values]], [[1, 2, 3], [1, 3, 5, 2, 4, 6]]);
});

test("a gray pattern takes the luminance of a picture", () => {
  const [gray] = asPlanes([1, 1, 1, 0, 1, 0], 3, 1, 2);
  assert.ok(Math.abs(gray[0] - 1) < 1e-6 && Math.abs(gray[1] - 0.7152) < 1e-6);
  assert.deepEqual(asPlanes([0.5, 0.25], 1, 3, 2).map((plane) => [...plane]), [[0.5, 0.25], [0.5, 0.25], [0.5, 0.25]]);
  assert.ok(Math.abs(linearFromSrgb(188) - 0.5029) < 1e-3);
});

test("an EXR file has its marks, its channels in order and its values", () => {
  const bytes = encodeExr([Float32Array.from([0.25, 2])], { width: 2, height: 1 });
  assert.deepEqual([...bytes.subarray(0, 8)], [0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0]);
  const view = new DataView(bytes.buffer);
  assert.deepEqual([view.getFloat32(bytes.length - 8, true), view.getFloat32(bytes.length - 4, true)], [0.25, 2]);
});

test("numbers have four digits and a true minus", () => {
  assert.deepEqual([0, 0.123456, -12.3456, 1e-7, 123456, NaN].map(formatNumber), ["0", "0.1235", "\u221212.35", "1.000e\u22127", "1.235e5", "NaN"]);
  assert.equal(formatPixel([0.5], "W/(m² sr)"), "0.5 W/(m² sr)");
  assert.equal(formatPixel([1, 2, 3], ""), "(1, 2, 3)");
});

test("exposure shows all but the brightest half per cent", () => {
  const values = Float32Array.from({ length: 1000 }, (_, index) => (index < 4 ? 1000 : 0.25));
  assert.equal(autoExposure([values]), 4);
  assert.equal(autoExposure([new Float32Array(4)]), 1);
  assert.equal(displayLevel(0.25, { exposure: 4, gamma: 2.2 }), 255);
});

test("signed planes are shown in two colours, others in gray", () => {
  const colors = Uint8Array.from([0, 0, 255, 255, 255, 255, 255, 0, 0]);
  const rgba = new Uint8ClampedArray(8);
  paintPlanes([Float32Array.from([-1, 1])], rgba, { exposure: 1, gamma: 2.2 }, colors);
  assert.deepEqual([...rgba], [0, 0, 255, 255, 255, 0, 0, 255]);
  paintPlanes([Float32Array.from([0, 1])], rgba, { exposure: 1, gamma: 2.2 }, colors);
  assert.deepEqual([...rgba], [0, 0, 0, 255, 255, 255, 255, 255]);
});

test("zooming keeps the place under the pointer, and never shows what is outside", () => {
  const view = new View();
  view.zoomAt(4, 0.25, 0.75);
  // The place in the frame: 0.5 + zoom · (place − centre).
  const shown = 0.5 + view.zoom * (0.25 - view.x);
  assert.ok(Math.abs(shown - 0.25) < 1e-12);
  view.pan(-5, 5);
  assert.deepEqual([view.x, view.y], [0.125, 0.875]);
  view.zoomAt(1e-3, 0.5, 0.5);
  assert.deepEqual([view.zoom, view.x, view.y], [1, 0.5, 0.5]);
});
