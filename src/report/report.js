// Zoom by a click, and the value under the pointer. It reads nothing but this page.
(() => {
  "use strict";
  const readout = document.createElement("output");
  readout.id = "readout";
  readout.hidden = true;
  document.body.append(readout);
  const canvas = document.createElement("canvas");
  const context = canvas.getContext("2d", { willReadFrequently: true });
  let drawn = null;

  const channels = (color) => (color.match(/\d+/g) || []).slice(0, 3).map(Number);
  const distance = (a, b) => a.reduce((sum, value, index) => sum + (value - b[index]) ** 2, 0);

  // The value of a colour on its scale: the nearest point of the line through the scale's colours. About 1 % of its range.
  const onScale = (scale, color) => {
    const stops = (scale.querySelector("i").style.background.match(/rgb\([^)]*\)/g) || []).map(channels);
    const labels = [...scale.querySelectorAll("b")].map((label) => parseFloat(label.textContent.replace("\u2212", "-")));
    if (stops.length < 2 || labels.length < 2) return "";
    let best = [Infinity, 0];
    for (let index = 0; index + 1 < stops.length; index += 1) {
      const [from, to] = [stops[index], stops[index + 1]];
      const length = distance(from, to);
      const along = color.reduce((sum, value, axis) => sum + (value - from[axis]) * (to[axis] - from[axis]), 0);
      const share = length > 0 ? Math.min(1, Math.max(0, along / length)) : 0;
      const off = distance(color, from.map((value, axis) => value + share * (to[axis] - value)));
      if (off < best[0]) best = [off, (index + share) / (stops.length - 1)];
    }
    // What is not on the scale is masked, or no number.
    if (best[0] > 900) return "";
    const [low, high] = [labels[0], labels[labels.length - 1]];
    const unit = scale.querySelector("small");
    return " ≈ " + (low + best[1] * (high - low)).toPrecision(2) + (unit ? " " + unit.textContent : "");
  };

  const value = (image, color) => {
    const figure = image.parentElement;
    const scale = figure.querySelector(".scale");
    if (scale) return onScale(scale, color);
    for (const swatch of figure.querySelectorAll(".swatches li")) {
      const own = channels(getComputedStyle(swatch.querySelector("i")).backgroundColor);
      if (distance(own, color) === 0) return ": " + swatch.textContent.trim();
    }
    return "";
  };

  const isPicture = (node) => node instanceof HTMLImageElement && node.closest(".figures");

  document.addEventListener("pointermove", (event) => {
    const image = event.target;
    readout.hidden = !isPicture(image) || image.naturalWidth === 0;
    if (readout.hidden) return;
    if (drawn !== image) {
      canvas.width = image.naturalWidth;
      canvas.height = image.naturalHeight;
      context.drawImage(image, 0, 0);
      drawn = image;
    }
    const box = image.getBoundingClientRect();
    const at = (place, from, size, pixels) => Math.min(pixels - 1, Math.max(0, Math.floor(((place - from) / size) * pixels)));
    const x = at(event.clientX, box.left, box.width, canvas.width);
    const y = at(event.clientY, box.top, box.height, canvas.height);
    const color = [...context.getImageData(x, y, 1, 1).data].slice(0, 3);
    readout.textContent = `(${x}, ${y})${value(image, color)}`;
  });

  const close = () => document.querySelectorAll(".zoomed").forEach((node) => node.classList.remove("zoomed"));
  document.addEventListener("click", (event) => {
    const zoomed = event.target.closest(".zoomed");
    close();
    if (!zoomed && (isPicture(event.target) || event.target.closest(".strip ol svg"))) {
      event.target.closest("figure, li").classList.add("zoomed");
    }
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape") close();
  });
})();
