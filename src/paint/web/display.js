// Exposure, gamma, zoom and the values under the pointer: how pattern and photo are shown.

import { autoExposure } from "../../report/web/color.js";
import { formatNumber, formatPixel } from "../../report/web/format.js";

/** The controls of the view. */
export class Display {
  constructor(pattern, photo, view, unit) {
    Object.assign(this, { pattern, photo, view, unit });
    this.exposure = document.querySelector("#exposure");
    this.auto = document.querySelector("#auto");
    this.gamma = document.querySelector("#gamma");
    this.readouts = [document.querySelector("#pattern-value"), document.querySelector("#photo-value")];
    this.exposure.addEventListener("input", () => {
      this.auto.checked = false;
      this.redraw();
    });
    for (const control of [this.auto, this.gamma]) control.addEventListener("input", () => this.redraw());
    const zoom = (id, act) => document.querySelector(id).addEventListener("click", act);
    zoom("#zoom-in", () => view.zoomAt(1.5, view.x, view.y));
    zoom("#zoom-out", () => view.zoomAt(1 / 1.5, view.x, view.y));
    zoom("#zoom-all", () => view.reset());
  }

  tone() {
    return { exposure: 2 ** Number(this.exposure.value), gamma: Number(this.gamma.value) };
  }

  /** Shows a photo, by automatic exposure where that is on. */
  showPhoto(planes) {
    if (this.auto.checked) this.exposure.value = Math.log2(autoExposure(planes)).toFixed(2);
    const tone = this.tone();
    this.photo.show(planes, tone);
    this.exposure.nextElementSibling.textContent = `${formatNumber(Number(this.exposure.value))} stops`;
    this.gamma.nextElementSibling.textContent = formatNumber(tone.gamma);
  }

  showPattern(planes) {
    this.pattern.show(planes, { exposure: 1, gamma: Number(this.gamma.value) });
  }

  redraw() {
    this.showPattern(this.pattern.planes);
    this.showPhoto(this.photo.planes);
  }

  /** Says the values of the pixel of both pictures that is pointed at. */
  read(pixel) {
    [this.pattern, this.photo].forEach((picture, index) => {
      const isThere = pixel >= 0 && pixel < picture.width * picture.height;
      const place = `(${pixel % picture.width}, ${Math.floor(pixel / picture.width)})`;
      const text = isThere ? `${place} ${formatPixel(picture.values(pixel), index === 1 ? this.unit : "")}` : "\u00a0";
      this.readouts[index].textContent = text;
    });
  }

  settings() {
    return { exposure: this.exposure.value, auto: this.auto.checked, gamma: this.gamma.value };
  }

  restore({ exposure, auto, gamma }) {
    this.auto.checked = Boolean(auto);
    if (Number.isFinite(Number(exposure))) this.exposure.value = Number(exposure);
    if (Number.isFinite(Number(gamma))) this.gamma.value = Number(gamma);
  }
}
