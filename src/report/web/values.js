// Exact values of pictures: floats in single precision, whose first bytes stand before all second ones and so on, deflated, in base64.

/** The bytes of a base64 text. */
export function decodeBase64(text) {
  return Uint8Array.from(atob(text.trim()), (letter) => letter.charCodeAt(0));
}

/** Inflates bytes in zlib's format. */
export async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Floats from their first bytes, second bytes and so on. */
export function joinBytes(bytes) {
  const count = bytes.length / 4;
  const joined = new Uint8Array(bytes.length);
  for (let place = 0; place < 4; place += 1) {
    for (let index = 0; index < count; index += 1) joined[4 * index + place] = bytes[place * count + index];
  }
  const view = new DataView(joined.buffer);
  return Float32Array.from({ length: count }, (_, index) => view.getFloat32(4 * index, true));
}

/** Values, one plane after the other, as planes of `pixels` values each. They are not copied. */
export function splitPlanes(values, pixels) {
  return Array.from({ length: values.length / pixels }, (_, plane) => values.subarray(plane * pixels, (plane + 1) * pixels));
}

/** The planes of a picture of `pixels` pixels. */
export async function unpackPlanes(text, pixels) {
  return splitPlanes(joinBytes(await inflate(decodeBase64(text))), pixels);
}

/** What a pixel's values are in words: `format` turns numbers into text, `nameOf` labels. */
export function tellValues(about, values, format, nameOf) {
  if (about.kind === "label") return nameOf(values[0]);
  return format(values, about.unit);
}

/** A pixel's coordinate along an eigenvector, as groups are made of them; `null` where there are none. */
export function coordinate({ weight, range }, entry) {
  if (weight === null || weight === undefined) return null;
  return weight * Math.min(range[1], Math.max(range[0], entry));
}

/**
 * A row of the matrix as far as eigenvectors tell: Σ λ dᵢ uᵢ uⱼ dⱼ over the eigenvectors `u` of the normalized cut, where `d` is each pixel's light
 * from all others.
 */
export function rowOf(pixel, degree, vectors, eigenvalues) {
  const row = new Float32Array(degree.length);
  vectors.forEach((vector, index) => {
    const share = eigenvalues[index] * vector[pixel] * degree[pixel];
    for (let other = 0; other < row.length; other += 1) row[other] += share * vector[other] * degree[other];
  });
  return row;
}
