// The page of a run: makes the parts and connects them. Everything is shown without it, too.

import { Curves } from "./curves.js";
import { Figure } from "./figure.js";
import { PixelCard } from "./pixel.js";
import { Readout, follow } from "./readout.js";
import { Scatter } from "./scatter.js";
import { addActions, addToolbar } from "./toolbar.js";
import { View } from "./view.js";
import { Viewer } from "./viewer.js";

function makeFigures(section) {
  const view = new View();
  const figures = Array.from(section.querySelectorAll("figure[data-picture]"), (element) => new Figure(element, view));
  figures.forEach((figure) => (figure.home = section));
  if (figures.length > 0) addToolbar(section, figures, view);
  return figures;
}

function connect(figures, readout) {
  const frames = [...document.querySelectorAll("figure[data-picture], .strip ol li")];
  const byElement = new Map(figures.map((figure) => [figure.element, figure]));
  const viewer = new Viewer(frames, (item) => byElement.get(item)?.view);
  const card = new PixelCard(figures, document.querySelector("main").dataset.paint ?? "");
  // What tells values lies above an enlarged picture, too.
  const above = [card.element, readout.output];
  viewer.dialog.addEventListener("close", () => document.body.append(...above));
  const acts = {
    pin: (figure, pixel) => card.show(figure, pixel, document.activeElement),
    unpin: () => card.hide(),
    enlarge: (item) => {
      viewer.open(item);
      viewer.dialog.append(...above);
    },
    isEnlarged: () => viewer.isOpen(),
  };
  for (const figure of figures) {
    follow(figure, readout, acts);
    const others = figure.about.flips.map((name) => figures.find((other) => other.home === figure.home && other.about.name === name));
    addActions(figure, others.filter(Boolean), acts.enlarge);
  }
  for (const item of document.querySelectorAll(".strip ol li")) {
    item.classList.add("live");
    item.tabIndex = 0;
    item.addEventListener("click", () => acts.enlarge(item));
    item.addEventListener("keydown", (event) => event.key === "Enter" && acts.enlarge(item));
  }
  return acts;
}

function connectPlots(figures, acts) {
  const eigenvectors = figures.filter(({ about }) => about.kind === "eigenvector");
  for (const svg of document.querySelectorAll("svg[data-frame]")) {
    if (svg.querySelector("g[data-pixels]")) new Scatter(svg, eigenvectors, acts.pin);
    else new Curves(svg);
  }
}

/** Marks the section that is read in the contents. */
function followContents() {
  const links = [...document.querySelectorAll(".contents a")];
  const mark = (id) => links.forEach((link) => (link.hash === `#${id}` ? link.setAttribute("aria-current", "true") : link.removeAttribute("aria-current")));
  const watch = new IntersectionObserver((seen) => seen.forEach(({ isIntersecting, target }) => isIntersecting && mark(target.id)), { rootMargin: "-10% 0px -80% 0px" });
  document.querySelectorAll("section[id]").forEach((section) => watch.observe(section));
}

function addCopy() {
  const code = document.querySelector(".code");
  if (!code || !navigator.clipboard) return;
  const button = Object.assign(document.createElement("button"), { type: "button", className: "copy", textContent: "Copy" });
  button.addEventListener("click", async () => {
    const isCopied = await navigator.clipboard.writeText(code.textContent).then(() => true, () => false);
    button.textContent = isCopied ? "Copied" : "Select it, and copy it by the keyboard";
  });
  code.after(button);
}

const figures = [...document.querySelectorAll("section")].flatMap(makeFigures);
const acts = connect(figures, new Readout());
connectPlots(figures, acts);
followContents();
addCopy();
document.body.dataset.ready = "true";
