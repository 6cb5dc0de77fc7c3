// The value under the pointer, or under the cursor that arrow keys move.

const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** How far a pointer may move while it clicks, in CSS pixels. */
const STILL = 4;

/** Tells values at the lower edge of the window. */
export class Readout {
  constructor() {
    this.output = document.createElement("output");
    this.output.id = "readout";
    this.output.hidden = true;
    document.body.append(this.output);
    this.count = 0;
  }

  /** Says a text; an empty one hides the read-out. */
  say(text) {
    this.count += 1;
    this.output.textContent = text;
    this.output.hidden = text === "";
  }

  /** Says the value of a pixel; one below 0 is outside. */
  async tell(figure, pixel) {
    this.count += 1;
    const own = this.count;
    const text = pixel < 0 ? "" : `(${figure.placeOf(pixel).join(", ")}) ${await figure.tell(pixel)}`;
    // The pointer may have moved on while values were unpacked.
    if (own === this.count) this.say(text);
  }
}

/** Lets the pointer and the keys over a picture tell values. `acts` has `pin`, `enlarge`, `unpin` and `isEnlarged`. */
export function follow(figure, readout, acts) {
  const { frame, view } = figure;
  let [from, last] = [null, null];
  frame.addEventListener("pointerdown", (event) => {
    from = last = event;
    if (view.zoom > 1) frame.setPointerCapture(event.pointerId);
  });
  frame.addEventListener("pointermove", (event) => {
    if (last && view.zoom > 1) {
      const box = figure.img.getBoundingClientRect();
      view.pan((last.clientX - event.clientX) / box.width, (last.clientY - event.clientY) / box.height);
      last = event;
    }
    readout.tell(figure, figure.pixelAt(event));
  });
  frame.addEventListener("pointerleave", () => readout.say(""));
  for (const end of ["pointerup", "pointercancel"]) frame.addEventListener(end, () => (last = null));
  frame.addEventListener("click", (event) => {
    const isStill = !from || Math.hypot(event.clientX - from.clientX, event.clientY - from.clientY) <= STILL;
    if (isStill) acts.pin(figure, figure.pixelAt(event));
  });
  frame.addEventListener("dblclick", () => acts.enlarge(figure.element));
  frame.addEventListener("wheel", (event) => wheel(event, figure, acts), { passive: false });
  frame.addEventListener("keydown", (event) => keys(event, figure, readout, acts));
}

/** The wheel zooms an enlarged picture, and others with Ctrl: it scrolls the page otherwise. */
function wheel(event, figure, acts) {
  if (!event.ctrlKey && !event.metaKey && !acts.isEnlarged()) return;
  event.preventDefault();
  const box = figure.img.getBoundingClientRect();
  figure.view.zoomAt(2 ** (-event.deltaY / 300), (event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
}

function keys(event, figure, readout, acts) {
  const { about, view } = figure;
  const step = STEPS[event.key];
  if (event.altKey || event.ctrlKey || event.metaKey) return;
  if (step && (event.shiftKey || !acts.isEnlarged())) {
    const [x, y] = figure.placeOf(figure.cursor ?? Math.floor(about.height / 2) * about.width + Math.floor(about.width / 2));
    const bounded = (value, size) => Math.min(size - 1, Math.max(0, value));
    figure.cursor = bounded(y + step[1], about.height) * about.width + bounded(x + step[0], about.width);
    figure.mark(figure.cursor);
    readout.tell(figure, figure.cursor);
  } else if (event.key === " ") {
    acts.pin(figure, figure.cursor ?? 0);
  } else if (event.key === "Enter") {
    if (!acts.isEnlarged()) acts.enlarge(figure.element);
  } else if (event.key === "Escape" && !acts.isEnlarged()) {
    acts.unpin();
    readout.say("");
  } else if (event.key === "+" || event.key === "-") {
    view.zoomAt(event.key === "+" ? 1.5 : 1 / 1.5, view.x, view.y);
  } else if (event.key === "0") {
    view.reset();
  } else {
    return;
  }
  event.preventDefault();
}
