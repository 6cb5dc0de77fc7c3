// Photos of a page without server: its worker holds the matrix.

/** A source of photos whose matrix is in the page. */
export class EmbeddedSource {
  /** `code` is the worker's script; `matrix` its layers with their bytes. */
  constructor(info, code, matrix) {
    this.info = info;
    this.matrix = matrix;
    this.url = URL.createObjectURL(new Blob([code], { type: "text/javascript" }));
    this.worker = new Worker(this.url);
    this.waiting = new Map();
    this.next = 1;
    this.worker.onmessage = ({ data }) => this.receive(data);
  }

  /** Unpacks the matrix; returns the photo of a dark pattern. */
  async open() {
    const { lights, channels } = this.info;
    const shown = await this.ask("open", { ...this.matrix, lights, channels });
    this.matrix = null;
    return shown;
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
    const kept = question.ask === "groups" ? this.info.kept.groups : this.info.kept.eigenvectors;
    return kept ? Promise.resolve(kept) : Promise.reject(new Error("they are not in this file"));
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
