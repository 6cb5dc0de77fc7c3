// One picture over the whole window, with the next and the previous one.

/** Shows pictures of the page one at a time. */
export class Viewer {
  /** `items` are the pictures' elements in the order of the page. */
  constructor(items, viewOf) {
    Object.assign(this, { items, viewOf, at: -1 });
    this.dialog = document.createElement("dialog");
    this.dialog.id = "viewer";
    this.dialog.setAttribute("aria-labelledby", "viewer-title");
    this.dialog.innerHTML = `<div class="bar"><h2 id="viewer-title"></h2>
      <button type="button" data-act="previous">Previous</button><button type="button" data-act="next">Next</button>
      <button type="button" data-act="out" aria-label="Zoom out">\u2212</button><button type="button" data-act="in" aria-label="Zoom in">+</button>
      <button type="button" data-act="whole">Whole</button><button type="button" data-act="close">Close</button></div>
      <div class="stage"></div><p class="hint"></p>`;
    document.body.append(this.dialog);
    this.stage = this.dialog.querySelector(".stage");
    this.place = document.createComment("a picture is enlarged");
    this.dialog.addEventListener("close", () => this.putBack());
    this.dialog.addEventListener("keydown", (event) => this.key(event));
    this.dialog.querySelector(".bar").addEventListener("click", (event) => {
      const act = event.target.dataset.act;
      if (act) this.act(act);
    });
  }

  isOpen() {
    return this.dialog.open;
  }

  open(item) {
    const at = this.items.indexOf(item);
    if (at < 0 || this.isOpen()) return;
    this.before = document.activeElement;
    this.dialog.showModal();
    this.take(at);
  }

  take(at) {
    const item = this.items[at];
    this.putBack(this.viewOf(item));
    this.at = at;
    item.before(this.place);
    this.wasHidden = item.hidden;
    item.hidden = false;
    this.stage.append(item);
    const caption = item.querySelector("figcaption")?.textContent ?? `Pattern and photo ${item.textContent.trim()}`;
    this.dialog.querySelector("h2").textContent = `${caption} (${at + 1} of ${this.items.length})`;
    const hasView = Boolean(this.viewOf(item));
    for (const act of ["in", "out", "whole"]) this.button(act).hidden = !hasView;
    this.button("previous").disabled = at === 0;
    this.button("next").disabled = at === this.items.length - 1;
    this.dialog.querySelector(".hint").textContent = hasView
      ? "Arrow keys: next and previous; Shift with them: values; wheel, + and \u2212: zoom; Escape: back"
      : "Arrow keys: next and previous; Escape: back";
    (item.querySelector("[tabindex]") ?? this.button("close")).focus({ preventScroll: true });
  }

  /** Puts the picture back into the page. Its zoom is kept for the next picture if that has the same view. */
  putBack(next = null) {
    if (this.at < 0) return;
    const item = this.items[this.at];
    item.hidden = this.wasHidden;
    this.place.replaceWith(item);
    if (this.viewOf(item) !== next) this.viewOf(item)?.reset();
    this.at = -1;
    if (!this.isOpen() && this.before?.isConnected) this.before.focus({ preventScroll: true });
  }

  button(act) {
    return this.dialog.querySelector(`[data-act="${act}"]`);
  }

  key(event) {
    if (event.shiftKey || event.altKey || event.ctrlKey || event.metaKey) return;
    const act = { ArrowLeft: "previous", PageUp: "previous", ArrowRight: "next", PageDown: "next" }[event.key];
    if (!act || event.target.type === "range") return;
    event.preventDefault();
    this.act(act);
  }

  act(act) {
    const view = this.viewOf(this.items[this.at]);
    if (act === "close") this.dialog.close();
    else if (act === "next") this.take(Math.min(this.items.length - 1, this.at + 1));
    else if (act === "previous") this.take(Math.max(0, this.at - 1));
    else if (act === "whole") view?.reset();
    else view?.zoomAt(act === "in" ? 1.5 : 1 / 1.5, view.x, view.y);
  }
}
