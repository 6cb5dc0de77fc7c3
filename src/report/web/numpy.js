// Files of NumPy (.npy, version 1.0), little-endian.

const KINDS = { f4: Float32Array, f8: Float64Array, u1: Uint8Array };

/** The bytes of an array of 32-bit floats. */
export function encodeNpy(shape, values) {
  const text = `{'descr': '<f4', 'fortran_order': False, 'shape': (${shape.join(", ")}${shape.length === 1 ? "," : ""}), }`;
  const padded = text.padEnd(Math.ceil((text.length + 11) / 64) * 64 - 11) + "\n";
  const bytes = new Uint8Array(10 + padded.length + 4 * values.length);
  bytes.set([0x93, 0x4e, 0x55, 0x4d, 0x50, 0x59, 1, 0, padded.length & 255, padded.length >> 8]);
  bytes.set(new TextEncoder().encode(padded), 10);
  const view = new DataView(bytes.buffer, 10 + padded.length);
  values.forEach((value, index) => view.setFloat32(4 * index, value, true));
  return bytes;
}

/** The shape and the values of an array of floats or bytes. Throws an error that says what was expected. */
export function decodeNpy(bytes) {
  const isNpy = bytes.length > 12 && [0x93, 0x4e, 0x55, 0x4d, 0x50, 0x59].every((byte, index) => bytes[index] === byte);
  if (!isNpy) throw new Error("this is no .npy file");
  const long = bytes[6] > 1;
  const start = long ? 12 : 10;
  const header = new DataView(bytes.buffer, bytes.byteOffset);
  const end = start + (long ? header.getUint32(8, true) : header.getUint16(8, true));
  const text = new TextDecoder().decode(bytes.subarray(start, end));
  const kind = /'descr': '[<|](f4|f8|u1)'/.exec(text);
  const shape = /'shape': \(([^)]*)\)/.exec(text);
  if (!kind || !shape || /'fortran_order': True/.test(text)) {
    throw new Error("the array must hold 32-bit or 64-bit floats or bytes in C order");
  }
  const sizes = shape[1].split(",").map((size) => size.trim()).filter((size) => size !== "").map(Number);
  const Kind = KINDS[kind[1]];
  const count = sizes.reduce((product, size) => product * size, 1);
  if (end + count * Kind.BYTES_PER_ELEMENT > bytes.length) throw new Error("the .npy file is cut short");
  // A copy, since typed arrays begin at multiples of their element.
  return { shape: sizes, values: new Kind(bytes.slice(end, end + count * Kind.BYTES_PER_ELEMENT).buffer) };
}
