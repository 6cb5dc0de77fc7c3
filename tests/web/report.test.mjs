// Values, curves and sliders of a report.

import assert from "node:assert/strict";
import { test } from "node:test";
import { deflateSync } from "node:zlib";

import { displayLevel } from "../../src/report/web/color.js";
import { pointsAt, readPoints, stopsOf } from "../../src/report/web/curves.js";
import { formatDigits, formatNumber, formatPixel } from "../../src/report/web/format.js";
import { nearestPoint } from "../../src/report/web/scatter.js";
import { seriesOf } from "../../src/report/web/toolbar.js";
import { coordinate, joinBytes, rowOf, tellValues, unpackPlanes } from "../../src/report/web/values.js";

/** Packs floats as src/report/html/values.rs does. */
function packed(planes) {
  const floats = new DataView(new ArrayBuffer(4 * planes.flat().length));
  planes.flat().forEach((value, index) => floats.setFloat32(4 * index, value, true));
  const count = planes.flat().length;
  const bytes = Uint8Array.from({ length: 4 * count }, (_, at) => floats.getUint8(4 * (at % count) + Math.floor(at / count)));
  return deflateSync(bytes).toString("base64");
}

test("values come back without loss, plane by plane", async () => {
  const planes = [[0, -1.5, 0.1, 1e-30], [3e38, 1, -0, 7]];
  const found = await unpackPlanes(packed(planes), 4);
  assert.deepEqual(found.map((plane) => [...plane]), planes.map((plane) => plane.map(Math.fround)));
  assert.equal((await unpackPlanes(packed([planes[0]]), 4)).length, 1);
  await assert.rejects(unpackPlanes("bm8gemxpYg==", 4));
});

test("bytes that were set apart are joined in the order of little-endian floats", () => {
  // 1.0 is 00 00 80 3f and −2.0 is 00 00 00 c0.
  assert.deepEqual([...joinBytes(Uint8Array.from([0, 0, 0, 0, 0x80, 0, 0x3f, 0xc0]))], [1, -2]);
});

test("numbers have as many digits as are asked for", () => {
  assert.equal(formatNumber(0.123456789), "0.1235");
  assert.equal(formatDigits(0.123456789, 6), "0.123457");
  assert.equal(formatDigits(-1.5e-7, 2), "\u22121.5e\u22127");
  assert.equal(formatPixel([0.25, 1, 2], "W/(m² sr)", 6), "(0.25, 1, 2) W/(m² sr)");
});

test("the curve of sRGB is that of the pictures", () => {
  const level = (value) => displayLevel(value, { exposure: 1, gamma: "srgb" });
  assert.deepEqual([0, 0.001, 0.2158605, 1, 2, -1].map(level), [0, 3, 128, 255, 255, 0]);
  assert.equal(displayLevel(0.25, { exposure: 1, gamma: 2 }), 128);
});

test("labels are told by name, light by value and unit", () => {
  const nameOf = (label) => `group ${label}`;
  assert.equal(tellValues({ kind: "label" }, [3], formatPixel, nameOf), "group 3");
  assert.equal(tellValues({ kind: "light", unit: "W" }, [0.5], formatPixel, nameOf), "0.5 W");
});

test("coordinates are clamped and weighted, where there are groups", () => {
  assert.equal(coordinate({ weight: 2, range: [-1, 1] }, 5), 2);
  assert.equal(coordinate({ weight: 2, range: [-1, 1] }, -0.25), -0.5);
  assert.equal(coordinate({ weight: null, range: [0, 0] }, 5), null);
  assert.equal(coordinate({}, 5), null);
});

test("all eigenvectors together tell a row of the matrix exactly", () => {
  // G = [[0, 2], [2, 1]] has degrees 2 and 3; D^-½ G D^-½ has the eigenvalue 1 for √d, and −2/3 for the vector across it.
  const degree = [2, 3];
  const vectors = [[1, 1].map((one) => one / Math.sqrt(5)), [Math.sqrt(3 / 10), -Math.sqrt(2 / 15)]];
  const row = (pixel) => [...rowOf(pixel, degree, vectors, [1, -2 / 3])];
  [[0, 2], [2, 1]].forEach((expected, pixel) => row(pixel).forEach((value, at) => assert.ok(Math.abs(value - expected[at]) < 1e-6, `${row(pixel)}`)));
});

test("a curve tells its values where it has points", () => {
  const curves = [
    { name: "a", color: "red", points: readPoints("1e0 5e-1 10.0 20.0,2e0 2.5e-1 30.0 40.0") },
    { name: "b", color: "blue", points: readPoints("2e0 7e-1 30.0 12.0") },
    { name: "none", color: "gray", points: readPoints("") },
  ];
  assert.deepEqual(stopsOf(curves), [1, 2]);
  assert.deepEqual(pointsAt(curves, 2).map(({ name, y, left }) => [name, y, left]), [["a", 0.25, 30], ["b", 0.7, 30]]);
  assert.deepEqual(pointsAt(curves, 1).map(({ name }) => name), ["a"]);
});

test("the point under the pointer is the nearest one within reach", () => {
  const points = [[0, 0], [10, 0], [10, 4]];
  assert.equal(nearestPoint(points, [9, 3], 5), 2);
  assert.equal(nearestPoint(points, [9, 1], 5), 1);
  assert.equal(nearestPoint(points, [40, 40], 5), -1);
});

test("a slider stands for several pictures of a series, not for one", () => {
  const figure = (series) => ({ about: { series } });
  const found = seriesOf(["eigenvector", "", "eigenvector", "number of groups"].map(figure));
  assert.deepEqual(found.map(([series, of]) => [series, of.length]), [["eigenvector", 2]]);
});
