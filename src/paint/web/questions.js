// The questions that are ready on the page.

import { paintLabels } from "../../report/web/color.js";
import { formatNumber } from "../../report/web/format.js";

const MASKED = 255;
const [NONE, BRIGHT, DARK] = [0, 1, 2];

/** Runs `work` behind a panel's button; says what came of it. */
async function answered(panel, work) {
  const [answer, button] = [panel.querySelector(".answer"), panel.querySelector("[data-run]")];
  answer.classList.remove("bad");
  answer.textContent = "Working …";
  if (button) button.disabled = true;
  try {
    answer.textContent = await work((partial) => (answer.textContent = partial.status));
  } catch (error) {
    answer.classList.add("bad");
    answer.textContent = error.message;
  }
  if (button) button.disabled = false;
}

/** Groups of pixels: shows them over the photo, and lights one of them alone. */
export class Groups {
  constructor(source, info, easel, photo) {
    Object.assign(this, { source, info, easel, photo });
    this.panel = document.querySelector("#groups");
    this.panel.hidden = !source.knows("groups");
    this.panel.querySelector("[data-run]").addEventListener("click", () => answered(this.panel, () => this.find()));
    this.panel.querySelector("[data-counts]").addEventListener("change", () => this.show());
  }

  async find() {
    const counts = [2, 3, 4, 6, 8, 12].filter((count) => count < this.info.camera[0]);
    this.found = await this.source.question({ ask: "groups", groups: counts });
    const select = this.panel.querySelector("[data-counts]");
    select.replaceChildren(...this.found.groups.map((count, index) => new Option(String(count), String(index))));
    this.panel.querySelectorAll("[data-found]").forEach((node) => (node.hidden = false));
    this.show();
    return this.found.status;
  }

  show() {
    const labels = this.found.planes[Number(this.panel.querySelector("[data-counts]").value)];
    const all = [...new Set(labels)].filter((label) => label !== MASKED).sort((a, b) => a - b);
    const swatches = all.map((label) => {
      const button = document.createElement("button");
      button.type = "button";
      const swatch = document.createElement("i");
      swatch.style.background = `rgb(${this.info.labelColors.slice(3 * label, 3 * label + 3).join(" ")})`;
      button.append(swatch, `Light ${label}`);
      button.addEventListener("click", () => this.light(labels, label));
      return button;
    });
    this.panel.querySelector(".swatches").replaceChildren(...swatches);
    this.photo.showPainted((rgba) => paintLabels(labels, rgba, this.info.labelColors));
  }

  light(labels, label) {
    const plane = Float32Array.from(labels, (of) => (of === label ? 1 : 0));
    this.easel.replace(this.easel.pattern.map(() => plane));
  }
}

/** Eigenvectors as patterns: their values are signed, so that negative ones are shown only where the source takes them. */
export class Eigenvectors {
  constructor(source, info, easel) {
    Object.assign(this, { source, info, easel });
    this.panel = document.querySelector("#eigenvectors");
    this.panel.hidden = !source.knows("eigenvectors");
    this.panel.querySelector("[data-run]").addEventListener("click", () => answered(this.panel, () => this.find()));
    this.index = this.panel.querySelector("[data-index]");
    this.index.addEventListener("input", () => answered(this.panel, () => Promise.resolve(this.show())));
  }

  async find() {
    const light = this.info.lights.includes("global") ? "global" : "all";
    this.found = await this.source.question({ ask: "eigenvectors", light, count: 12 });
    this.index.max = this.found.planes.length;
    this.panel.querySelectorAll("[data-found]").forEach((node) => (node.hidden = false));
    return this.show();
  }

  show() {
    const index = Number(this.index.value) - 1;
    this.index.nextElementSibling.textContent = this.index.value;
    const plane = this.found.planes[index];
    const most = plane.reduce((most, value) => Math.max(most, Math.abs(value)), 0) || 1;
    // A projector cannot show less than nothing: zero is then shown as one half.
    const shown = plane.map((value) => (this.info.isSigned || this.info.isLinear ? value / most : 0.5 + (0.5 * value) / most));
    this.easel.replace(this.easel.pattern.map(() => shown));
    return `Eigenvalue ${formatNumber(this.found.values[index])}. ${this.found.status}`;
  }
}

/** A pattern whose photo looks like a picture. */
export class Target {
  constructor(source, info, easel, read) {
    Object.assign(this, { source, info, easel, read });
    this.panel = document.querySelector("#target");
    this.panel.hidden = !source.knows("pattern");
    const file = this.panel.querySelector("input[type=file]");
    this.level = this.panel.querySelector("[data-level]");
    this.panel.querySelector("[data-run]").addEventListener("click", () => file.click());
    file.addEventListener("change", () => file.files[0] && this.drop(file.files[0]));
    showLevel(this.level, () => this.picture && this.solve());
  }

  async drop(file) {
    this.panel.open = true;
    await answered(this.panel, async (report) => {
      this.picture = await this.read(file);
      return this.find(report);
    });
  }

  solve() {
    return answered(this.panel, (report) => this.find(report));
  }

  async find(report) {
    const level = Number(this.level.value) * this.info.white;
    const target = this.picture.map((plane) => plane.map((value) => value * level));
    const weights = new Float32Array(target[0].length).fill(1);
    const found = await this.source.question({ ask: "pattern", target, weights }, report);
    this.easel.replace(found.planes);
    return found.status;
  }
}

/** Bright here, dark there: masks painted on the photo. */
export class Masks {
  constructor(source, info, easel, photo) {
    Object.assign(this, { source, info, easel, photo });
    this.panel = document.querySelector("#masks");
    this.panel.hidden = !source.knows("pattern");
    this.canvas = document.querySelector("#mask");
    [this.canvas.width, this.canvas.height] = info.camera;
    photo.view.listeners.add(() => this.place());
    this.mask = new Uint8Array(info.camera[0] * info.camera[1]);
    this.mode = null;
    this.isBusy = false;
    this.buttons = [...this.panel.querySelectorAll("[data-mask]")];
    for (const button of this.buttons) button.addEventListener("click", () => this.choose(Number(button.dataset.mask)));
    this.panel.querySelector("[data-clear]").addEventListener("click", () => this.clear());
    this.panel.addEventListener("toggle", () => this.panel.open || this.choose(null));
    this.level = this.panel.querySelector("[data-level]");
    showLevel(this.level, () => this.solve());
    this.draw();
  }

  /** Whether the pointer paints a mask on the photo. */
  isOn() {
    return this.mode !== null;
  }

  choose(mode) {
    this.mode = mode === this.mode ? null : mode;
    for (const button of this.buttons) button.setAttribute("aria-pressed", String(Number(button.dataset.mask) === this.mode));
  }

  paint([x, y], radius) {
    const [width, height] = this.info.camera;
    for (let row = Math.max(0, Math.floor(y - radius)); row <= Math.min(height - 1, Math.ceil(y + radius)); row += 1) {
      for (let column = Math.max(0, Math.floor(x - radius)); column <= Math.min(width - 1, Math.ceil(x + radius)); column += 1) {
        const isNear = Math.hypot(column + 0.5 - x, row + 0.5 - y) <= Math.max(radius, 0.71);
        if (isNear) this.mask[row * width + column] = this.mode;
      }
    }
    this.draw();
  }

  clear() {
    this.mask.fill(NONE);
    this.draw();
    this.panel.querySelector(".answer").textContent = "";
  }

  draw() {
    const [width, height] = this.info.camera;
    const image = new ImageData(width, height);
    const colors = { [BRIGHT]: [0xe6, 0x9f, 0x00, 255], [DARK]: [0x00, 0x72, 0xb2, 255] };
    this.mask.forEach((mode, pixel) => mode !== NONE && image.data.set(colors[mode], 4 * pixel));
    this.canvas.getContext("2d").putImageData(image, 0, 0);
    this.place();
  }

  place() {
    this.canvas.style.transform = this.photo.view.transform();
  }

  /** Finds the pattern; what is asked meanwhile is answered afterwards. */
  async solve() {
    if (!this.mask.includes(BRIGHT)) return;
    if (this.isBusy) {
      this.isWaiting = true;
      return;
    }
    this.isBusy = true;
    do {
      this.isWaiting = false;
      await answered(this.panel, (report) => this.find(report));
    } while (this.isWaiting);
    this.isBusy = false;
  }

  async find(report) {
    const bright = Number(this.level.value) * this.info.white;
    const plane = Float32Array.from(this.mask, (mode) => (mode === BRIGHT ? bright : 0));
    const weights = Float32Array.from(this.mask, (mode) => (mode === NONE ? 0 : 1));
    const target = this.easel.pattern.map(() => plane);
    const found = await this.source.question({ ask: "pattern", target, weights }, report);
    this.easel.replace(found.planes);
    return found.status;
  }
}

function showLevel(level, changed) {
  const show = () => (level.nextElementSibling.textContent = level.value);
  level.addEventListener("input", show);
  level.addEventListener("change", changed);
  show();
}
