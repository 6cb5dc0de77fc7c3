// Photos of a page with a server: messages over a WebSocket. The bytes are described in src/paint/message.rs.

import { splitPlanes } from "../../report/web/values.js";

const HEADER = 8;
const [CHANGE, REPLACE, FINISH, LIGHT, COLUMN, ROW] = [1, 2, 3, 4, 5, 6];
const [PHOTO, PATTERN, COLUMN_OF, ROW_OF, ANSWER] = [1, 2, 3, 4, 5];

/** Bytes of a message. */
export function encodeMessage(kind, { light = 0, number = 0 }, content = new Uint8Array(0)) {
  const bytes = new Uint8Array(HEADER + content.byteLength);
  const view = new DataView(bytes.buffer);
  view.setUint8(0, kind);
  view.setUint16(2, light, true);
  view.setUint32(4, number, true);
  bytes.set(new Uint8Array(content.buffer, content.byteOffset, content.byteLength), HEADER);
  return bytes;
}

/** Pixels with their values as the content of a message. `values` has a plane with one value for each pixel. */
export function encodeChanges(pixels, values) {
  const size = 4 * (1 + values.length);
  const view = new DataView(new ArrayBuffer(size * pixels.length));
  pixels.forEach((pixel, index) => {
    view.setUint32(size * index, pixel, true);
    values.forEach((plane, channel) => view.setFloat32(size * index + 4 * (1 + channel), plane[index], true));
  });
  return new Uint8Array(view.buffer);
}

/** A source of photos behind a socket. */
export class ServedSource {
  constructor(info, address) {
    this.info = info;
    this.address = address;
    this.number = 0;
    this.photo = null;
    this.looks = new Map();
    this.questions = new Map();
    this.onShown = () => {};
    this.onLost = () => {};
    this.others = null;
  }

  /** Opens the socket; returns the photo of what is on the projector, with its pattern. */
  open() {
    return new Promise((resolve, reject) => {
      this.socket = new WebSocket(this.address);
      this.socket.binaryType = "arraybuffer";
      this.socket.onmessage = ({ data }) => {
        const shown = typeof data === "string" ? this.hearText(JSON.parse(data)) : this.hear(data);
        if (shown && resolve) {
          resolve(shown);
          resolve = null;
        }
      };
      this.socket.onerror = () => reject(new Error("the server cannot be reached"));
      this.socket.onclose = () => this.onLost();
    });
  }

  update({ pixels, values, isFinished }) {
    return this.expectPhoto((number) => {
      const whole = () => new Float32Array(values.flatMap((plane) => Array.from(plane)));
      if (pixels === null) this.socket.send(encodeMessage(REPLACE, { number }, whole()));
      else if (pixels.length > 0) this.socket.send(encodeMessage(CHANGE, { number }, encodeChanges(pixels, values)));
      if (isFinished) this.socket.send(encodeMessage(FINISH, { number }));
    });
  }

  light(index) {
    return this.expectPhoto((number) => {
      this.socket.send(encodeMessage(LIGHT, { light: index }));
      this.socket.send(encodeMessage(FINISH, { number }));
    });
  }

  column(pixel) {
    return this.look(COLUMN, COLUMN_OF, pixel);
  }

  row(pixel) {
    return this.look(ROW, ROW_OF, pixel);
  }

  question(question) {
    this.number += 1;
    const number = this.number;
    return new Promise((resolve, reject) => {
      this.questions.set(number, { resolve, reject });
      const plain = (key, value) => (ArrayBuffer.isView(value) ? Array.from(value) : value);
      this.socket.send(JSON.stringify({ number, ...question }, plain));
    });
  }

  knows(ask) {
    return ask !== "pattern" || this.info.isSquare;
  }

  /** Sends, and waits for the photo that has what was sent. */
  expectPhoto(send) {
    this.number += 1;
    const number = this.number;
    return new Promise((resolve) => {
      this.photo?.resolve(null);
      this.photo = { number, resolve };
      send(number);
    });
  }

  /** Only the newest look is answered. */
  look(kind, answer, pixel) {
    return new Promise((resolve) => {
      this.looks.set(answer, { pixel, resolve });
      this.socket.send(encodeMessage(kind, { number: pixel }));
    });
  }

  hear(buffer) {
    const view = new DataView(buffer);
    const [kind, exact] = [view.getUint8(0), view.getUint8(1) === 1];
    const [light, number] = [view.getUint16(2, true), view.getUint32(4, true)];
    if (kind === ANSWER) return this.hearAnswer(number, buffer, view);
    const pixels = kind === PHOTO || kind === COLUMN_OF ? this.info.camera : this.info.projector;
    const planes = splitPlanes(new Float32Array(buffer, HEADER), pixels[0] * pixels[1]);
    if (kind === PATTERN) {
      this.others = { pattern: planes, light };
    } else if (kind === PHOTO) {
      return this.hearPhoto({ planes, exact, light, number });
    } else if (kind === COLUMN_OF || kind === ROW_OF) {
      const look = this.looks.get(kind);
      if (look?.pixel === number) {
        this.looks.delete(kind);
        look.resolve({ planes });
      }
    }
    return null;
  }

  hearPhoto(photo) {
    const shown = { ...photo, ...this.others };
    const isOthers = this.others !== null;
    this.others = null;
    const isExpected = this.photo && (isOthers || photo.number >= this.photo.number);
    if (isExpected) {
      this.photo.resolve(isOthers ? null : photo);
      this.photo = null;
    }
    if (isOthers || !isExpected) this.onShown(shown);
    return shown;
  }

  hearAnswer(number, buffer, view) {
    const length = view.getUint32(HEADER, true);
    const text = new TextDecoder().decode(new Uint8Array(buffer, HEADER + 4, length));
    const planes = new Float32Array(buffer, HEADER + 4 + length);
    const question = this.questions.get(number);
    this.questions.delete(number);
    const [width, height] = this.info.projector;
    question?.resolve({ ...JSON.parse(text), planes: splitPlanes(planes, width * height) });
    return null;
  }

  hearText({ error, number }) {
    const question = this.questions.get(number);
    this.questions.delete(number);
    if (question) question.reject(new Error(error));
    else {
      this.photo?.resolve(null);
      this.photo = null;
      this.onProblem?.(error);
    }
    return null;
  }
}
