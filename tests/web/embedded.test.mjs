// A page without server: what it keeps, and what it asks of its worker.

import assert from "node:assert/strict";
import { test } from "node:test";
import { deflateSync } from "node:zlib";

import { EmbeddedSource } from "../../src/paint/web/embedded.js";

/** A source of four pixels. Its worker is `globalThis.Worker`, which only keeps what it was sent. */
function source(kept, sections) {
  globalThis.Worker = class {
    sent = [];

    postMessage(message) {
      this.sent.push(message);
    }
  };
  const layer = { light: "all", rows: 4, columns: 4, positions: 0, values: [1] };
  const info = { camera: [2, 2], projector: [2, 2], channels: 1, lights: ["all"], layers: [layer], ambient: 2, isSquare: true, kept };
  return new EmbeddedSource(info, "", (number) => sections[number]);
}

const packed = (values) => deflateSync(new Uint8Array(values.buffer)).toString("base64");

test("groups and eigenvectors are unpacked when they are asked for, plane by plane", async () => {
  const labels = Uint8Array.from([0, 1, 1, 255, 0, 1, 2, 255]);
  const vector = Float32Array.from([0.5, -0.5, 0.1, -1e-30]);
  const kept = {
    groups: { groups: [2, 3], values: [1, 0.9], status: "8 photos", section: 3 },
    eigenvectors: { groups: [], values: [2.5], status: "4 photos", section: 4 },
  };
  const page = source(kept, { 3: packed(labels), 4: packed(vector) });
  const groups = await page.question({ ask: "groups", groups: [6] });
  assert.deepEqual([groups.groups, groups.status], [[2, 3], "8 photos"]);
  assert.deepEqual(groups.planes.map((plane) => [...plane]), [[0, 1, 1, 255], [0, 1, 2, 255]]);
  const found = await page.question({ ask: "eigenvectors", light: "all", count: 12 });
  assert.deepEqual([found.values, found.planes.map((plane) => [...plane])], [[2.5], [[...vector]]]);
});

test("what is not in the file is refused", async () => {
  const page = source({}, {});
  assert.deepEqual(["groups", "eigenvectors", "pattern"].map((ask) => page.knows(ask)), [false, false, true]);
  await assert.rejects(page.question({ ask: "groups", groups: [2] }), /not in this file/);
});

test("the worker is sent the texts of the matrix", () => {
  const page = source({}, ["positions", "values", "ambient"]);
  page.open();
  const [{ layers, ambient, lights }] = page.worker.sent;
  assert.deepEqual([layers[0].positions, layers[0].values, ambient, lights], ["positions", ["values"], "ambient", ["all"]]);
});
