// The controls of a section: zoom of all its pictures, exposure of its photos, and sliders over eigenvectors and numbers of groups.

import { formatNumber } from "./format.js";

function button(text, label, act) {
  const made = document.createElement("button");
  made.type = "button";
  made.textContent = text;
  if (label) made.setAttribute("aria-label", label);
  made.addEventListener("click", act);
  return made;
}

/** A labelled slider that says its value; `say` turns it into text. */
function slider(text, { min, max, step }, say, act) {
  const label = document.createElement("label");
  const input = Object.assign(document.createElement("input"), { type: "range", min, max, step, value: 0 });
  const output = document.createElement("output");
  const update = () => {
    output.textContent = say(Number(input.value));
    input.setAttribute("aria-valuetext", output.textContent);
  };
  input.addEventListener("input", () => {
    update();
    act(Number(input.value));
  });
  update();
  label.append(text, input, output);
  return label;
}

/** Pictures by the series that a slider selects from. */
export function seriesOf(figures) {
  const found = new Map();
  for (const figure of figures) {
    const { series } = figure.about;
    if (series) found.set(series, [...(found.get(series) ?? []), figure]);
  }
  return [...found].filter(([, of]) => of.length > 1);
}

/** Shows picture `number` of a series, from 1; 0 shows all. */
function select(figures, number) {
  figures.forEach((figure, index) => (figure.element.hidden = number > 0 && number !== index + 1));
  const block = figures[0].element.parentElement;
  const isAlone = [...block.children].every((child) => figures.some(({ element }) => element === child));
  block.classList.toggle("single", isAlone && number > 0);
}

/** Puts the controls above the pictures of a section. */
export function addToolbar(section, figures, view) {
  const bar = document.createElement("div");
  bar.className = "toolbar";
  bar.setAttribute("role", "group");
  bar.setAttribute("aria-label", "Display");
  for (const [series, of] of seriesOf(figures)) {
    const say = (number) => (number === 0 ? `all ${of.length}` : of[number - 1].about.name);
    bar.append(slider(series[0].toUpperCase() + series.slice(1), { min: 0, max: of.length, step: 1 }, say, (number) => select(of, number)));
  }
  if (figures.some(({ about }) => about.kind === "light" && about.values)) {
    const say = (stops) => (stops === 0 ? "as developed" : `${stops > 0 ? "+" : ""}${formatNumber(stops)} stops`);
    bar.append(slider("Exposure", { min: -6, max: 8, step: 0.25 }, say, (stops) => figures.forEach((figure) => figure.develop(stops))));
  }
  const zoom = document.createElement("span");
  zoom.className = "group";
  zoom.append(
    "Zoom",
    button("\u2212", "Zoom out all pictures of this section", () => view.zoomAt(1 / 1.5, view.x, view.y)),
    button("+", "Zoom into all pictures of this section", () => view.zoomAt(1.5, view.x, view.y)),
    button("Whole", "Show the whole pictures of this section", () => view.reset()),
  );
  bar.append(zoom);
  section.querySelector(".figures").before(bar);
}

/** Buttons below a picture: enlarge it, and flip it with others for as long as they are held. */
export function addActions(figure, others, enlarge) {
  const actions = document.createElement("div");
  actions.className = "actions";
  actions.append(button("Enlarge", `Enlarge: ${figure.caption}`, () => enlarge(figure.element)));
  for (const other of others) {
    const hold = button(`Hold: ${other.about.name}`, `Hold: ${other.about.name}, in place of ${figure.about.name}`, () => {});
    hold.className = "hold";
    hold.setAttribute("aria-pressed", "false");
    const flip = (isHeld) => {
      hold.setAttribute("aria-pressed", String(isHeld));
      figure.flip(isHeld ? other : null);
    };
    hold.addEventListener("pointerdown", (event) => {
      hold.setPointerCapture(event.pointerId);
      flip(true);
    });
    hold.addEventListener("keydown", (event) => (event.key === " " || event.key === "Enter") && flip(true));
    hold.addEventListener("contextmenu", (event) => event.preventDefault());
    for (const end of ["pointerup", "pointercancel", "lostpointercapture", "keyup", "blur"]) hold.addEventListener(end, () => flip(false));
    actions.append(hold);
  }
  figure.element.append(actions);
}
