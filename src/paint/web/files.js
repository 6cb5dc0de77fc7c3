// Files and links: what the page saves, and what it loads.

import { decodeNpy, encodeNpy } from "../../report/web/numpy.js";
import { decodeBase64, inflate, splitPlanes } from "../../report/web/values.js";
import { encodeExr } from "./exr.js";

/** Offers bytes as a file to save. */
export function download(name, content, type = "application/octet-stream") {
  const url = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/** Planes as an array of `H×W`, or `H×W×3`. */
export function planesToNpy(planes, { width, height }) {
  if (planes.length === 1) return encodeNpy([height, width], planes[0]);
  const values = Float32Array.from({ length: 3 * width * height }, (_, at) => planes[at % 3][Math.floor(at / 3)]);
  return encodeNpy([height, width, 3], values);
}

/** Saves planes as `npy`, `exr` or, as they are shown, `png`. */
export async function saveImage(name, format, planes, size, canvas) {
  if (format === "npy") download(`${name}.npy`, planesToNpy(planes, size));
  else if (format === "exr") download(`${name}.exr`, encodeExr(planes, size));
  else download(`${name}.png`, await new Promise((resolve) => canvas.toBlob(resolve, "image/png")));
}

/** The linear value of an sRGB level from 0 to 255. */
export function linearFromSrgb(level) {
  const value = level / 255;
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
}

/** Planes from rows of pixels with one or three channels, for a pattern of `count` planes. */
export function asPlanes(values, channels, count, pixels) {
  const weights = [0.2126, 0.7152, 0.0722];
  const sample = (pixel, plane) => {
    if (channels === 1) return values[pixel];
    if (count === 3) return values[3 * pixel + plane];
    return weights.reduce((sum, weight, channel) => sum + weight * values[3 * pixel + channel], 0);
  };
  return Array.from({ length: count }, (_, plane) => Float32Array.from({ length: pixels }, (__, pixel) => sample(pixel, plane)));
}

/** Reads an image file into planes of this size. A picture is decoded from sRGB and scaled; an array must fit. */
export async function readImage(file, { width, height }, count) {
  if (file.name.toLowerCase().endsWith(".npy")) {
    const { shape, values } = decodeNpy(new Uint8Array(await file.arrayBuffer()));
    const [rows, columns, channels = 1] = shape;
    const fits = rows === height && columns === width && (channels === 1 || channels === 3);
    if (!fits) throw new Error(`${file.name} has ${shape.join("×")} values in place of ${height}×${width}`);
    return asPlanes(values, channels, count, width * height);
  }
  let picture;
  try {
    picture = await createImageBitmap(file);
  } catch {
    throw new Error(`${file.name} is no picture that this browser can read; use PNG, JPEG or .npy`);
  }
  const canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext("2d");
  context.drawImage(picture, 0, 0, width, height);
  const { data } = context.getImageData(0, 0, width, height);
  const values = Float32Array.from({ length: 3 * width * height }, (_, at) => linearFromSrgb(data[4 * Math.floor(at / 3) + (at % 3)]));
  return asPlanes(values, 3, count, width * height);
}

/** A state as text for a link: JSON and planes, deflated, in the base64 of addresses. */
export async function encodeState(settings, planes) {
  const text = new TextEncoder().encode(JSON.stringify(settings));
  const floats = new Uint8Array(Float32Array.from(planes.flatMap((plane) => Array.from(plane))).buffer);
  const bytes = new Uint8Array(4 + text.length + floats.length);
  new DataView(bytes.buffer).setUint32(0, text.length, true);
  bytes.set(text, 4);
  bytes.set(floats, 4 + text.length);
  const packed = new Response(new Blob([bytes]).stream().pipeThrough(new CompressionStream("deflate")));
  let binary = "";
  for (const byte of new Uint8Array(await packed.arrayBuffer())) binary += String.fromCharCode(byte);
  return btoa(binary).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

/** Reads such a text; the pattern must have `count` planes of `pixels`. */
export async function decodeState(text, count, pixels) {
  try {
    const bytes = await inflate(decodeBase64(text.replaceAll("-", "+").replaceAll("_", "/")));
    const length = new DataView(bytes.buffer).getUint32(0, true);
    const settings = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
    const floats = new Float32Array(bytes.slice(4 + length).buffer);
    if (floats.length !== count * pixels) throw new Error("its pattern has another size");
    return { settings, planes: splitPlanes(floats, pixels) };
  } catch (error) {
    throw new Error(`the saved state cannot be read: ${error.message}`);
  }
}
