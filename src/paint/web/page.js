// The page: makes the parts and connects them.

import { Picture } from "../../report/web/picture.js";
import { View } from "../../report/web/view.js";
import { Conductor } from "./conductor.js";
import { Display } from "./display.js";
import { Easel } from "./easel.js";
import { EmbeddedSource } from "./embedded.js";
import { decodeState, download, encodeState, readImage, saveImage } from "./files.js";
import { follow } from "./pointing.js";
import { Eigenvectors, Groups, Masks, Target } from "./questions.js";
import { ServedSource } from "./served.js";
import { Stroke } from "./brush.js";

const NAMES = {
  all: "all light",
  direct: "direct: one bounce",
  global: "global: two and more",
  second: "second bounce",
  later: "third bounce and later",
};

/** The longest link that browsers and chats take. */
const LONGEST_LINK = 30_000;

/** Latencies that are kept, in milliseconds. */
const KEPT_LATENCIES = 4096;

class Page {
  constructor(info) {
    this.info = info;
    this.source = makeSource(info);
    this.status = document.querySelector("#status");
    this.latencies = [];
    this.since = null;
  }

  async start() {
    const { info } = this;
    const [projector, camera] = [info.projector, info.camera].map(([width, height]) => ({ width, height }));
    const view = new View();
    const colors = Uint8Array.from(info.signedColors);
    const canvases = ["#pattern", "#photo"].map((id) => document.querySelector(id));
    this.pattern = new Picture(canvases[0], projector, view, colors);
    this.photo = new Picture(canvases[1], camera, view, colors);
    this.display = new Display(this.pattern, this.photo, view, info.unit);
    const planes = Array.from({ length: info.channels }, () => new Float32Array(projector.width * projector.height));
    this.easel = new Easel(this.pattern, planes, info.isSigned, {
      onChange: (pixels) => this.changed(pixels),
      onFinish: () => this.conductor.finish(),
    });
    this.conductor = new Conductor(this.source, planes, (photo, isExact) => this.shown(photo, isExact));
    this.source.onShown = (shown) => this.accept(shown);
    this.source.onProblem = (text) => this.say(text, true);
    this.source.onLost = () => this.say("The server is gone. Start it again and reload this page.", true);
    this.questions();
    this.pointers();
    this.controls();
    this.accept(await this.source.open());
    await this.begin();
    document.body.dataset.ready = "true";
  }

  questions() {
    const { source, info, easel, photo } = this;
    this.groups = new Groups(source, info, easel, photo);
    this.eigenvectors = new Eigenvectors(source, info, easel);
    this.target = new Target(source, info, easel, (file) => readImage(file, photo, info.channels));
    this.masks = new Masks(source, info, easel, photo);
  }

  /** The pattern of the link, or else a soft spot where nothing is projected yet. */
  async begin() {
    const state = new URLSearchParams(location.hash.slice(1)).get("state");
    if (state) {
      await this.restore(state);
    } else if (this.easel.pattern.every((plane) => plane.every((value) => value === 0))) {
      const { width, height } = this.pattern;
      const spot = this.easel.pattern.map((plane) => plane.slice());
      const brush = { size: Math.min(width, height) / 2, softness: 1, value: spot.map(() => 1) };
      new Stroke(spot, { width, height }, brush).moveTo([width / 2, height / 2]);
      this.easel.replace(spot);
    }
    await this.conductor.whenSettled();
    await this.lookAtLinked();
  }

  /** Shows the row of the camera pixel that the link names: `#pixel=COLUMN,ROW`. */
  async lookAtLinked() {
    const [column, row] = (new URLSearchParams(location.hash.slice(1)).get("pixel") ?? "").split(",").map(Number);
    const { width, height } = this.photo;
    if (!(column >= 0 && column < width && row >= 0 && row < height)) return;
    document.querySelector("input[name=tool][value=look]").checked = true;
    const pixel = Math.floor(row) * width + Math.floor(column);
    this.display.read(pixel);
    await this.look(pixel, true);
  }

  pointers() {
    const pan = { isOn: (event) => this.easel.tool() === "pan" || event.buttons === 4 };
    const hover = (picture, isPhoto) => (place) => {
      const pixel = picture.pixelAt(place);
      this.display.read(pixel);
      if (this.easel.tool() === "look") this.look(pixel, isPhoto);
    };
    const hasTwoEnds = () => ["line", "gradient"].includes(this.easel.tool());
    follow(this.pattern, {
      press: (place) => this.timed(() => this.easel.press(place)),
      drag: (place) => this.timed(() => this.easel.drag(place)),
      release: (place) => this.easel.release(place),
      hover: hover(this.pattern, false),
      hasTwoEnds,
    }, pan);
    const mask = (place) => this.masks.isOn() && this.masks.paint(place, this.easel.brush().size / 2);
    follow(this.photo, {
      press: mask,
      drag: mask,
      release: () => this.masks.isOn() && this.masks.solve(),
      hover: hover(this.photo, true),
      hasTwoEnds: () => false,
    }, pan);
    document.querySelector("#tools").addEventListener("change", () => this.easel.tool() === "look" || this.lookAway());
  }

  controls() {
    const select = document.querySelector("#light");
    select.append(...this.info.lights.map((light, index) => new Option(NAMES[light], String(index))));
    select.addEventListener("change", () => this.choose(Number(select.value)));
    const file = document.querySelector("#load-file");
    document.querySelector("#load").addEventListener("click", () => file.click());
    file.addEventListener("change", () => file.files[0] && this.load(file.files[0]));
    this.droppable(this.pattern, (dropped) => this.load(dropped));
    this.droppable(this.photo, (dropped) => this.target.drop(dropped));
    for (const button of document.querySelectorAll("[data-save]")) {
      button.addEventListener("click", () => this.save(button.dataset.save, button.dataset.format));
    }
    document.querySelector("#save-state").addEventListener("click", async () => download("krylux-state.txt", await this.state(), "text/plain"));
    document.querySelector("#copy-link").addEventListener("click", () => this.link());
    const state = document.querySelector("#state-file");
    document.querySelector("#load-state").addEventListener("click", () => state.click());
    state.addEventListener("change", async () => state.files[0] && this.restore((await state.files[0].text()).trim()));
  }

  droppable(picture, drop) {
    const frame = picture.canvas.parentElement;
    frame.addEventListener("dragover", (event) => {
      event.preventDefault();
      frame.classList.add("dropping");
    });
    frame.addEventListener("dragleave", () => frame.classList.remove("dropping"));
    frame.addEventListener("drop", (event) => {
      event.preventDefault();
      frame.classList.remove("dropping");
      if (event.dataTransfer.files[0]) drop(event.dataTransfer.files[0]);
    });
  }

  /** The time from a pointer's event to its photo begins here. */
  timed(act) {
    this.since ??= performance.now();
    act();
  }

  changed(pixels) {
    this.display.showPattern(this.easel.pattern);
    this.conductor.change(pixels);
  }

  shown(planes, isExact) {
    this.planes = planes;
    this.display.showPhoto(planes);
    if (this.since === null) return;
    const latency = performance.now() - this.since;
    this.since = null;
    this.latencies.push(latency);
    if (this.latencies.length > KEPT_LATENCIES) this.latencies.shift();
    this.say(`Photo after ${latency.toFixed(1)} ms${isExact ? "" : ", by strokes"}`);
  }

  /** What somebody else has put on the projector. */
  accept({ planes, pattern, light }) {
    if (pattern) this.easel.accept(pattern);
    if (light !== undefined) document.querySelector("#light").value = String(light);
    this.planes = planes;
    this.display.showPattern(this.easel.pattern);
    this.display.showPhoto(planes);
    this.say(this.info.welcome);
  }

  async choose(index) {
    const shown = await this.source.light(index);
    if (shown) this.shown(shown.planes, true);
  }

  /** Shows the light of one pixel, or what lights it. */
  async look(pixel, isPhoto) {
    if (pixel < 0) {
      this.lookAway();
      return;
    }
    const found = await (isPhoto ? this.source.row(pixel) : this.source.column(pixel));
    if (this.easel.tool() !== "look") return;
    if (isPhoto) {
      const most = Math.max(...found.planes.map((plane) => plane.reduce((most, value) => Math.max(most, value), 0))) || 1;
      this.pattern.show(found.planes, { exposure: 1 / most, gamma: this.display.tone().gamma });
      this.display.showPhoto(this.planes);
    } else {
      this.display.showPattern(this.easel.pattern);
      this.display.showPhoto(found.planes);
    }
  }

  lookAway() {
    this.display.showPattern(this.easel.pattern);
    if (this.planes) this.display.showPhoto(this.planes);
  }

  async load(file) {
    try {
      this.easel.replace(await readImage(file, this.pattern, this.info.channels));
    } catch (error) {
      this.say(error.message, true);
    }
  }

  save(what, format) {
    const picture = what === "photo" ? this.photo : this.pattern;
    const planes = what === "photo" ? this.planes : this.easel.pattern;
    return saveImage(`${this.info.name}-${what}`, format, planes, picture, picture.canvas);
  }

  state() {
    const settings = { ...this.display.settings(), light: document.querySelector("#light").value };
    return encodeState(settings, this.easel.pattern);
  }

  async link() {
    const answer = document.querySelector("#save .answer");
    const url = `${location.href.split("#")[0]}#state=${await this.state()}`;
    if (url.length > LONGEST_LINK) {
      answer.textContent = `This pattern takes ${url.length} letters, too many for a link. Save a file instead.`;
      return;
    }
    history.replaceState(null, "", url);
    try {
      await navigator.clipboard.writeText(url);
      answer.textContent = "The link is in the clipboard and in the address bar.";
    } catch {
      answer.textContent = "The link is in the address bar.";
    }
  }

  async restore(text) {
    try {
      const { settings, planes } = await decodeState(text, this.info.channels, this.easel.pattern[0].length);
      this.display.restore(settings);
      this.easel.replace(planes);
      const light = Number(settings.light);
      if (light > 0 && light < this.info.lights.length) {
        document.querySelector("#light").value = String(light);
        await this.choose(light);
      }
    } catch (error) {
      this.say(error.message, true);
    }
  }

  say(text, isBad = false) {
    this.status.textContent = text;
    this.status.classList.toggle("bad", isBad);
  }
}

function makeSource(info) {
  if (!info.isEmbedded) return new ServedSource(info, new URL("socket", location.href.split("#")[0]).href.replace(/^http/, "ws"));
  const text = (id) => document.getElementById(id).textContent;
  return new EmbeddedSource(info, text("worker"), (number) => text(`section-${number}`));
}

const page = new Page(JSON.parse(document.getElementById("info").textContent));
// For programs that drive the page, and for the curious at the console.
window.krylux = {
  info: page.info,
  pattern: () => page.easel.pattern.map((plane) => Array.from(plane)),
  photo: () => page.planes.map((plane) => Array.from(plane)),
  latencies: () => page.latencies.slice(),
  whenSettled: () => page.conductor.whenSettled(),
};
page.start().catch((error) => page.say(error.message, true));
