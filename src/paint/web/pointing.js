// Pointer and keyboard over the two pictures.

const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** Lets `hand` follow the pointer, and the keys where the picture has the focus. `hand` has `press`, `drag`, `release` and `hover`. */
export function follow(picture, hand, pan) {
  const { canvas } = picture;
  let [isDown, last] = [false, null];
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button > 1) return;
    canvas.setPointerCapture(event.pointerId);
    event.preventDefault();
    canvas.focus({ preventScroll: true });
    isDown = true;
    last = event;
    if (!pan.isOn(event)) hand.press(picture.placeOf(event));
  });
  canvas.addEventListener("pointermove", (event) => {
    const isPanning = isDown && pan.isOn(event);
    if (isPanning) {
      const box = canvas.getBoundingClientRect();
      picture.view.pan((last.clientX - event.clientX) / box.width, (last.clientY - event.clientY) / box.height);
      last = event;
    } else if (isDown) {
      for (const each of event.getCoalescedEvents?.() ?? [event]) hand.drag(picture.placeOf(each));
    }
    hand.hover(picture.placeOf(event));
  });
  const up = (event) => {
    if (!isDown) return;
    isDown = false;
    if (!pan.isOn(event)) hand.release(picture.placeOf(event));
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("pointerleave", () => hand.hover([-1, -1]));
  followKeys(picture, hand);
}

/** Arrow keys move a cursor, Space presses and releases there, Shift with an arrow drags. */
function followKeys(picture, hand) {
  let cursor = [picture.width / 2, picture.height / 2];
  let start = null;
  picture.canvas.addEventListener("keydown", (event) => {
    const step = STEPS[event.key];
    if (step) {
      event.preventDefault();
      if (event.shiftKey && start === null) {
        start = cursor;
        hand.press(cursor);
      }
      const bounded = (value, size) => Math.min(size - 0.5, Math.max(0.5, Math.floor(value) + 0.5));
      cursor = [bounded(cursor[0] + step[0], picture.width), bounded(cursor[1] + step[1], picture.height)];
      if (start !== null) hand.drag(cursor);
      hand.hover(cursor);
    } else if (event.key === " " || event.key === "Enter") {
      event.preventDefault();
      // The line and the gradient have two ends: Space begins, and ends at the next Space.
      if (hand.hasTwoEnds() && start === null) {
        start = cursor;
        hand.press(cursor);
      } else {
        if (start === null) hand.press(cursor);
        hand.release(cursor);
        start = null;
      }
    }
  });
  picture.canvas.addEventListener("keyup", (event) => {
    if (event.key === "Shift" && start !== null && !hand.hasTwoEnds()) {
      hand.release(cursor);
      start = null;
    }
  });
}
