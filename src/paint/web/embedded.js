// Photos of a page without server: its worker holds the matrix.

import { decodeBase64, inflate, splitPlanes } from "../../report/web/values.js";

/** A source of photos whose matrix is in the page. */
export class EmbeddedSource {
  /** `code` is the worker's script; `section` returns the text of the section with a number. */
  constructor(info, code, section) {
    this.info = info;
    this.section = section;
    this.url = URL.createObjectURL(new Blob([code], { type: "text/javascript" }));
    this.worker = new Worker(this.url);
    this.waiting = new Map();
    this.next = 1;
    this.worker.onmessage = ({ data }) => this.receive(data);
  }

  /** Unpacks the matrix; returns the photo of a dark pattern. */
  open() {
    const { lights, channels, ambient, layers } = this.info;
    const withBytes = (layer) => ({
      ...layer,
      positions: this.section(layer.positions),
      values: layer.values.map((number) => this.section(number)),
    });
    return this.ask("open", { layers: layers.map(withBytes), lights, channels, ambient: this.section(ambient) });
  }

  update({ pixels, values, isFinished }) {
    return this.ask("update", { pixels, values, isFinished });
  }

  light(index) {
    return this.ask("light", { index });
  }

  column(pixel) {
    return this.ask("column", { pixel });
  }

  row(pixel) {
    return this.ask("row", { pixel });
  }

  /** Answers a question: a pattern by the worker, groups and eigenvectors from the file. */
  question(question, report) {
    if (question.ask === "pattern") {
      const { target, weights } = question;
      return this.ask("pattern", { target, weights, iterations: 60 }, report);
    }
    return this.kept(question.ask);
  }

  /** Groups or eigenvectors that are in the file, unpacked. */
  async kept(ask) {
    const answer = this.info.kept[ask];
    if (!answer) throw new Error("they are not in this file");
    const bytes = await inflate(decodeBase64(this.section(answer.section)));
    const [width, height] = this.info.camera;
    return { ...answer, planes: splitPlanes(ask === "groups" ? bytes : new Float32Array(bytes.buffer), width * height) };
  }

  /** Whether a question can be answered. */
  knows(ask) {
    return ask === "pattern" ? this.info.isSquare : Boolean(this.info.kept[ask]);
  }

  ask(task, content, report) {
    const id = this.next;
    this.next += 1;
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject, report });
      this.worker.postMessage({ id, task, ...content });
    });
  }

  receive({ id, found, partial, error }) {
    const { resolve, reject, report } = this.waiting.get(id);
    if (partial) {
      report?.(partial);
      return;
    }
    this.waiting.delete(id);
    if (error) reject(new Error(error));
    else resolve(found);
  }
}
