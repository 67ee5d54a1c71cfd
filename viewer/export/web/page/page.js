// Starts the page: the picture, its divider, the divergence map and the controls. An error is shown in one line.
import * as THREE from "three";
import { TextureMemory } from "ntc-three";
import { Sight, VIRIDIS, divergence, drawMap, footprints, mainTexture } from "./sight.js";
import { PageError, Stage, VIEWS, readJson } from "./stage.js";

const FORMAT = 2;
const REST_MS = 160; // time without movement after which finer mips are requested
const SLOW_MS = 100; // longer frames have half the pixels along each side until all mips are decoded
const BLENDED = 1 / 512; // assumed footprint of blended surfaces, which are not measured
const LIMIT_MB = { small: 96, large: 256 };

const byId = (id) => document.getElementById(id);
const { dataset, style } = document.documentElement;
const state = { a: 0, b: 1, split: null, heat: false, view: "lit" };

const repeats = ({ repeat }) => Math.max(Math.abs(repeat.x), Math.abs(repeat.y));

function fail(error) {
  if (!(error instanceof PageError)) console.error(error);
  tell(error);
  byId("status").textContent = "";
  dataset.state = "failed";
}

/** Shows an error of a source. The picture stays. */
function tell({ message }) {
  byId("error").textContent = message;
  byId("error").hidden = false;
}

class View {
  version = 0; // version of camera and settings
  looked = -1; // version whose textures are requested
  isSlow = true; // whether frames at full resolution are assumed to take more than SLOW_MS
  took = 0; // milliseconds of the last frame
  isSwapped = false;
  map = null; // the divergence map of this view

  constructor(renderer, stage) {
    Object.assign(this, { renderer, stage, sight: new Sight(renderer, stage.scene) });
  }

  get left() {
    return this.stage.sources[this.isSwapped ? state.b : state.a];
  }

  get right() {
    return this.stage.sources[this.isSwapped ? state.a : state.b];
  }

  /** Sources on both sides of the divider, or the only one. */
  get shown() {
    return state.split === null ? [this.left] : [this.left, this.right];
  }

  get isComplete() {
    return this.looked === this.version && this.shown.every(({ plugin, isReady }) => isReady && plugin.isComplete);
  }

  /** Handles a change of the camera or of a setting. */
  moved() {
    ++this.version;
    this.map = null;
    clearTimeout(this.resting);
    this.resting = setTimeout(() => this.rest(), REST_MS);
    // Other sources are prepared after the first picture.
    if (dataset.first !== undefined) for (const source of this.shown) this.stage.prepare(source).catch(fail);
    this.invalidate();
  }

  /** Handles the arrival of finer mips. Not every arrival causes a frame, because frames take time from decoding. */
  refined() {
    this.tell();
    if (this.isComplete || performance.now() - this.drawn > Math.max(200, 8 * this.took)) this.invalidate();
  }

  invalidate() {
    this.frame ??= requestAnimationFrame(() => this.draw());
  }

  async draw() {
    this.frame = null;
    const { renderer, stage } = this;
    const start = (this.drawn = performance.now());
    const isWhole = this.isComplete || !this.isSlow;
    const ratio = isWhole ? this.ratio : this.ratio / 2;
    if (renderer.getPixelRatio() !== ratio) renderer.setPixelRatio(ratio);
    const [width, height] = stage.size;
    const place = state.split === null ? width : Math.round(state.split * width);
    // A source that has no textures yet is replaced by the other one.
    const sides = [this.left, this.right].map((source, number, both) => (source?.isReady ? source : both[1 - number]));
    renderer.setScissorTest(place < width && sides[0] !== sides[1]);
    renderer.setScissor(0, 0, place, height);
    if (sides[0].isReady && place > 0) stage.draw(sides[0], state.view);
    renderer.setScissor(place, 0, width - place, height);
    if (place < width && sides[0] !== sides[1]) stage.draw(sides[1], state.view);
    this.took = await this.done(start);
    this.isSlow = dataset.first !== undefined ? this.took * (isWhole ? 1 : 4) > SLOW_MS : true;
    if (dataset.first === undefined) {
      dataset.first = performance.now().toFixed(0);
      this.moved();
    }
    if (!isWhole && (this.isComplete || !this.isSlow)) this.invalidate();
    this.tell();
  }

  /** Resolves with the milliseconds since `start` when the GPU has drawn. */
  done(start) {
    const gl = this.renderer.getContext();
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    return new Promise((resolve) => {
      const poll = () => {
        if (fence && !gl.isContextLost() && gl.clientWaitSync(fence, 0, 0) === gl.TIMEOUT_EXPIRED) return void setTimeout(poll, 1);
        gl.deleteSync(fence);
        resolve(performance.now() - start);
      };
      poll();
    });
  }

  /** Requests the mips that the view reads, once the camera is at rest, and counts decoders. */
  async rest() {
    const { stage, version } = this;
    if (this.isResting || dataset.first === undefined) return void (this.resting = setTimeout(() => this.rest(), REST_MS));
    this.isResting = true;
    const [width, height] = stage.size.map((side) => Math.floor(side * this.ratio));
    const lit = (mesh) => stage.sources[0].materials.get(mesh);
    const pixels = await this.sight.draw(stage.meshes, stage.camera, width, height, state.heat ? 1 : 2, lit);
    this.isResting = false;
    if (version !== this.version) return;
    const seen = footprints(pixels);
    for (const source of stage.sources) {
      if (!source.plugin) continue;
      const wanted = new Map();
      for (const mesh of this.shown.includes(source) && source.materials.size > 0 ? stage.meshes : []) {
        const footprint = lit(mesh).transparent ? BLENDED : seen.get(mesh.userData.number);
        if (footprint === undefined) continue;
        for (const texture of source.textures(mesh, state.view)) {
          const size = (footprint * repeats(texture)) / repeats(mainTexture(lit(mesh)));
          wanted.set(texture, Math.min(wanted.get(texture) ?? Infinity, size));
        }
      }
      source.plugin.want(wanted);
    }
    this.looked = version;
    if (state.heat) this.map = divergence(pixels, width, height, this.left.description.decoders);
    this.invalidate();
  }

  tell() {
    this.onTell?.();
  }
}

class Panel {
  constructor(page, view, stage) {
    Object.assign(this, { page, view, stage });
    document.title = `${page.name} · neural textures`;
    byId("name").textContent = page.name;
    const names = page.sources.map(({ name }) => name);
    this.fill("a", names, (value) => this.set({ a: Number(value) }));
    this.fill("b", names, (value) => this.set({ b: Number(value) }));
    this.fill("camera", page.cameras.map(({ name }, number) => name || `camera ${number + 1}`), (value) => this.look(Number(value)));
    this.fill("view", Object.values(VIEWS).map(({ label }) => label), (value) => this.set({ view: Object.keys(VIEWS)[value] }));
    byId("wipe").disabled = byId("b").disabled = names.length < 2;
    byId("wipe").addEventListener("click", () => this.set({ split: state.split === null ? 0.5 : null }));
    byId("heat").addEventListener("click", () => this.set({ heat: !state.heat }));
    byId("legend").style.background = `linear-gradient(90deg, ${VIRIDIS.map((color) => `rgb(${color.join(" ")})`).join(", ")})`;
    this.drag(byId("divider"));
    window.addEventListener("keydown", (event) => this.key(event));
    window.addEventListener("keyup", (event) => event.key === " " && this.swap(false));
    window.addEventListener("blur", () => this.swap(false));
    view.onTell = () => this.refresh();
    const address = new URLSearchParams(location.hash.slice(1));
    const index = (key, count, otherwise) => (address.has(key) && Number(address.get(key)) < count ? Number(address.get(key)) : otherwise);
    Object.assign(state, { a: index("a", names.length, 0), b: index("b", names.length, names.length - 1), heat: address.get("heat") === "1" });
    if (address.get("view") in VIEWS) state.view = address.get("view");
    state.split = names.length < 2 || address.get("split") === "" ? null : index("split", 1, 0.5);
    this.look(index("camera", page.cameras.length, 0));
  }

  fill(id, labels, chosen) {
    byId(id).replaceChildren(...labels.map((label, number) => new Option(label, number)));
    byId(id).addEventListener("change", ({ target }) => chosen(target.value));
  }

  drag(handle) {
    const move = ({ clientX }) => this.set({ split: Math.min(1, Math.max(0, clientX / innerWidth)) });
    handle.addEventListener("pointerdown", (event) => {
      handle.setPointerCapture(event.pointerId);
      handle.addEventListener("pointermove", move);
    });
    for (const end of ["pointerup", "pointercancel"]) handle.addEventListener(end, () => handle.removeEventListener("pointermove", move));
    handle.addEventListener("keydown", ({ key }) => {
      const step = { ArrowLeft: -0.02, ArrowRight: 0.02 }[key] ?? 0;
      if (step !== 0) this.set({ split: Math.min(1, Math.max(0, state.split + step)) });
    });
  }

  key(event) {
    const { key, target, repeat } = event;
    if (event.ctrlKey || event.metaKey || event.altKey || target instanceof HTMLSelectElement) return;
    const number = Number(key) - 1;
    if (key === " " && !(target instanceof HTMLButtonElement)) {
      event.preventDefault();
      if (!repeat) this.swap(true);
    } else if (key === "c") byId("wipe").click();
    else if (key === "h") byId("heat").click();
    else if (key === "v") this.set({ view: Object.keys(VIEWS)[(Object.keys(VIEWS).indexOf(state.view) + 1) % Object.keys(VIEWS).length] });
    else if (number >= 0 && number < this.page.cameras.length) this.look(number);
  }

  swap(isSwapped) {
    if (this.view.isSwapped === isSwapped || this.page.sources.length < 2) return;
    this.view.isSwapped = isSwapped;
    this.view.moved();
    this.refresh();
  }

  look(number) {
    this.camera = number;
    this.stage.look(number);
    this.set({});
  }

  set(change) {
    Object.assign(state, change);
    const { split, heat, ...rest } = state;
    const address = new URLSearchParams({ ...rest, camera: this.camera, split: split ?? "", heat: Number(heat) });
    clearTimeout(this.writing);
    this.writing = setTimeout(() => history.replaceState(null, "", `#${address}`), 200);
    this.view.moved();
    this.refresh();
  }

  /** Updates the controls and figures from the state. */
  refresh() {
    const { view, page } = this;
    const { split, heat } = state;
    byId("a").value = state.a;
    byId("b").value = state.b;
    byId("camera").value = this.camera;
    byId("view").selectedIndex = Object.keys(VIEWS).indexOf(state.view);
    byId("wipe").setAttribute("aria-pressed", split !== null);
    byId("heat").setAttribute("aria-pressed", heat);
    byId("divider").hidden = byId("sides").hidden = split === null;
    style.setProperty("--split", `${(split ?? 1) * 100}%`);
    byId("divider").setAttribute("aria-valuenow", Math.round((split ?? 1) * 100));
    [view.left, view.right].forEach((source, number) => {
      byId("sides").children[number].textContent = source ? `${source.description.name}${source.isReady ? "" : ": loading"}` : "";
    });
    byId("scale").hidden = !heat;
    byId("map").hidden = !heat || view.map === null;
    if (view.map !== null && view.map !== this.map) {
      const most = Math.max(4, view.map.most);
      byId("most").textContent = most;
      drawMap(byId("map"), view.map, most, view.ratio);
    }
    this.map = view.map;
    dataset.state = view.isComplete ? "complete" : "working";
    if (view.isComplete) dataset.whole ??= performance.now().toFixed(0);
    const { used, limit } = this.stage.memory;
    const megabytes = `Textures ${Math.ceil(used / 1e6)} of ${Math.round(limit / 1e6)} MB`;
    byId("status").textContent = view.isComplete ? megabytes : `${megabytes}, finer mips on the way`;
    const rows = [...view.left.description.figures, ...page.figures, ["Frame", `${view.took.toFixed(0)} ms`]];
    if (view.map !== null) {
      const { excess, counts, most } = view.map;
      rows.push(["Divergence", `${(excess / counts.length).toFixed(3)} excess decoders a block, at most ${most}`]);
    }
    byId("figures").replaceChildren(...rows.flatMap(([name, value]) => [["dt", name], ["dd", value]].map(([tag, text]) => {
      const element = document.createElement(tag);
      element.textContent = text;
      return element;
    })));
  }
}

async function start() {
  const canvas = byId("canvas");
  const page = await readJson("page.json");
  if (page.format !== FORMAT) throw new PageError(`page.json: format ${page.format} is not ${FORMAT}; export the page again`);
  const isSmall = matchMedia("(pointer: coarse)").matches || (navigator.deviceMemory ?? 8) <= 4;
  const memory = new TextureMemory(1e6 * LIMIT_MB[isSmall ? "small" : "large"]);
  let view = null;
  const stage = new Stage(canvas, page, memory, (isMoved) => (isMoved ? view?.moved() : view?.refined()), tell);
  stage.read(); // while the graphics device is opened
  const gl = canvas.getContext("webgl2", { antialias: false, powerPreference: "high-performance" });
  if (!gl) throw new PageError("This browser has no WebGL 2: use a newer one, or allow graphics acceleration in its settings");
  canvas.addEventListener("webglcontextrestored", () => location.reload());
  const renderer = new THREE.WebGLRenderer({ canvas, context: gl });
  await stage.load(renderer);
  view = new View(renderer, stage);
  const fit = () => {
    view.ratio = Math.min(devicePixelRatio, 2);
    renderer.setSize(innerWidth, innerHeight, false);
    stage.resize(innerWidth, innerHeight);
    view.moved();
  };
  stage.sources[0].preparing = Promise.resolve();
  addEventListener("resize", fit);
  fit();
  const panel = new Panel(page, view, stage);
  window.ntcPage = { page, renderer, memory, stage, view, panel, state };
}

start().catch(fail);
