// OpenEXR files without compression, with 32-bit floats.

class Writer {
  constructor() {
    this.parts = [];
    this.length = 0;
  }

  bytes(bytes) {
    this.parts.push(bytes);
    this.length += bytes.length;
  }

  text(text) {
    this.bytes(new TextEncoder().encode(`${text}\0`));
  }

  numbers(setter, size, values) {
    const view = new DataView(new ArrayBuffer(size * values.length));
    values.forEach((value, index) => view[setter](size * index, value, true));
    this.bytes(new Uint8Array(view.buffer));
  }

  ints(...values) {
    this.numbers("setInt32", 4, values);
  }

  attribute(name, type, size, write) {
    this.text(name);
    this.text(type);
    this.ints(size);
    write();
  }

  joined() {
    const all = new Uint8Array(this.length);
    let at = 0;
    for (const part of this.parts) {
      all.set(part, at);
      at += part.length;
    }
    return all;
  }
}

/** The bytes of an image: planes of `width·height` values, one (Y) or three (R, G, B). */
export function encodeExr(planes, { width, height }) {
  // Channels stand in the order of the alphabet.
  const channels = planes.length === 3 ? [["B", planes[2]], ["G", planes[1]], ["R", planes[0]]] : [["Y", planes[0]]];
  const writer = new Writer();
  writer.ints(20000630, 2);
  writer.attribute("channels", "chlist", 18 * channels.length + 1, () => {
    for (const [name] of channels) {
      writer.text(name);
      writer.ints(2);
      writer.bytes(new Uint8Array(4));
      writer.ints(1, 1);
    }
    writer.bytes(new Uint8Array(1));
  });
  const box = () => writer.ints(0, 0, width - 1, height - 1);
  writer.attribute("compression", "compression", 1, () => writer.bytes(new Uint8Array(1)));
  writer.attribute("dataWindow", "box2i", 16, box);
  writer.attribute("displayWindow", "box2i", 16, box);
  writer.attribute("lineOrder", "lineOrder", 1, () => writer.bytes(new Uint8Array(1)));
  writer.attribute("pixelAspectRatio", "float", 4, () => writer.numbers("setFloat32", 4, [1]));
  writer.attribute("screenWindowCenter", "v2f", 8, () => writer.numbers("setFloat32", 4, [0, 0]));
  writer.attribute("screenWindowWidth", "float", 4, () => writer.numbers("setFloat32", 4, [1]));
  writer.bytes(new Uint8Array(1));
  const line = 8 + 4 * width * channels.length;
  const first = writer.length + 8 * height;
  const offsets = Array.from({ length: height }, (_, row) => BigInt(first + row * line));
  writer.numbers("setBigUint64", 8, offsets);
  for (let row = 0; row < height; row += 1) {
    writer.ints(row, line - 8);
    for (const [, plane] of channels) writer.numbers("setFloat32", 4, plane.subarray(row * width, (row + 1) * width));
  }
  return writer.joined();
}
