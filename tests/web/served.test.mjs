// Messages between page and server, and the order of photos.

import assert from "node:assert/strict";
import { test } from "node:test";

import { Conductor } from "../../src/paint/web/conductor.js";
import { ServedSource, encodeChanges, encodeMessage } from "../../src/paint/web/served.js";

test("changes are written as the server reads them", () => {
  const content = encodeChanges(Uint32Array.from([3]), [Float32Array.from([0.5])]);
  const bytes = encodeMessage(1, { number: 7 }, content);
  assert.deepEqual([...bytes], [1, 0, 0, 0, 7, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0x3f]);
});

test("what changes while a photo is under way is sent together afterwards", async () => {
  const sent = [];
  const source = {
    update(request) {
      return new Promise((resolve) => sent.push({ ...request, resolve }));
    },
  };
  const pattern = [new Float32Array(100)];
  const photos = [];
  const conductor = new Conductor(source, pattern, (planes, exact) => photos.push([planes, exact]));
  conductor.change([1]);
  pattern[0][2] = 0.5;
  conductor.change([2]);
  pattern[0][2] = 0.75;
  conductor.change([2, 3]);
  conductor.finish();
  assert.equal(sent.length, 1);
  sent[0].resolve({ planes: "first", exact: false });
  await new Promise((resolve) => setTimeout(resolve));
  assert.deepEqual([[...sent[1].pixels], [...sent[1].values[0]], sent[1].isFinished], [[2, 3], [0.75, 0], true]);
  sent[1].resolve({ planes: "second", exact: true });
  await conductor.whenSettled();
  assert.deepEqual(photos, [["first", false], ["second", true]]);
});

/** A photo of one pixel as the server sends it. */
function photo(kind, number, value) {
  const bytes = encodeMessage(kind, { number }, Float32Array.from([value]));
  return bytes.buffer;
}

function source() {
  const made = new ServedSource({ projector: [1, 1], camera: [1, 1] }, "");
  made.socket = { send() {} };
  made.shown = [];
  made.onShown = (shown) => made.shown.push(shown);
  return made;
}

test("a page waits for the photo that has its own change", async () => {
  const page = source();
  const first = page.update({ pixels: Uint32Array.from([0]), values: [[1]], isFinished: false });
  page.hear(photo(1, 0, 5));
  assert.equal(page.shown.length, 1, "an older photo is shown, and not waited for");
  page.hear(photo(1, 1, 6));
  assert.deepEqual([...(await first).planes[0]], [6]);
});

test("what somebody else paints is shown with its pattern", async () => {
  const page = source();
  const own = page.update({ pixels: Uint32Array.from([0]), values: [[1]], isFinished: true });
  page.hear(photo(2, 0, 0.25));
  page.hear(photo(1, 40, 7));
  assert.equal(await own, null);
  assert.deepEqual([[...page.shown[0].pattern[0]], [...page.shown[0].planes[0]]], [[0.25], [7]]);
});

test("an error of a question is that question's", async () => {
  const page = source();
  const asked = page.question({ ask: "groups", groups: [2] });
  page.hearText({ error: "no", number: 1 });
  await assert.rejects(asked, /no/);
});
