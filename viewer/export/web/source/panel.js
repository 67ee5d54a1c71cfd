// The controls and figures around the picture.
import { MAP_VIEWS } from "./materials.js";

const REFRESH_MS = 250; // between changes of figures: for each the browser draws its window anew, on a slow device in the time of decoding

const byId = (id) => document.getElementById(id);
const median = (values) => [...values].sort((a, b) => a - b)[values.length >> 1];
const mega = (bytes) => `${(bytes / 1e6).toFixed(bytes < 1e8 ? 1 : 0)} MB`;

export function showError(text) {
  const line = byId("error");
  line.textContent = text;
  line.hidden = false;
  byId("status").textContent = "";
}

export class Panel {
  constructor(page, view, stage, surfaces, decoder, palette) {
    Object.assign(this, { page, view, stage, surfaces, decoder });
    document.title = `${page.name} · neural textures`;
    byId("name").textContent = page.name;
    this.camera = this.fillCameras();
    this.views = this.fillViews();
    this.hasOriginals = page.textures.some((texture) => Object.keys(texture.originals).length > 0);
    this.wire();
    byId("legend").style.background = `linear-gradient(90deg, ${palette.map((color) => `rgb(${color.map((c) => Math.round(255 * c)).join(" ")})`).join(", ")})`;
    this.fixedFigures();
    this.read();
    view.listeners.push(() => (this.refreshing ??= setTimeout(() => this.refresh(), REFRESH_MS)));
  }

  fillCameras() {
    const select = byId("camera");
    select.replaceChildren(...this.page.cameras.map((camera, number) => new Option(camera.name || `camera ${number + 1}`, number)));
    select.addEventListener("change", () => this.look(Number(select.value)));
    return select;
  }

  fillViews() {
    const select = byId("view");
    const planes = Object.keys(this.page.shaders);
    const shown = Object.entries(MAP_VIEWS).filter(([, { plane }]) => planes.includes(plane));
    select.replaceChildren(new Option("Lit", "lit"), ...shown.map(([name, { label }]) => new Option(label, name)));
    select.addEventListener("change", () => this.set({ view: select.value }));
    return select;
  }

  wire() {
    const { hasOriginals } = this;
    this.compare = byId("compare");
    this.heat = byId("heat");
    this.handle = byId("divider");
    this.compare.disabled = !hasOriginals;
    this.compare.title = hasOriginals ? "" : "This page was exported without the original images";
    this.compare.addEventListener("click", () => this.set({ split: this.view.state.split === null ? 0.5 : null }));
    this.heat.addEventListener("click", () => this.set({ heat: !this.view.state.heat }));
    const move = (event) => this.set({ split: Math.min(1, Math.max(0, event.clientX / window.innerWidth)) });
    this.handle.addEventListener("pointerdown", (event) => {
      this.handle.setPointerCapture(event.pointerId);
      this.handle.addEventListener("pointermove", move);
      event.preventDefault();
      this.handle.focus({ preventScroll: true });
    });
    for (const end of ["pointerup", "pointercancel"]) {
      this.handle.addEventListener(end, () => this.handle.removeEventListener("pointermove", move));
    }
    this.handle.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -0.02, ArrowRight: 0.02, PageDown: -0.1, PageUp: 0.1, Home: -1, End: 1 }[event.key];
      if (step === undefined) return;
      this.set({ split: Math.min(1, Math.max(0, this.view.state.split + step)) });
      event.preventDefault();
      event.stopPropagation();
    });
    window.addEventListener("keydown", (event) => this.key(event));
    window.addEventListener("hashchange", () => this.read());
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target instanceof HTMLSelectElement) return;
    const number = Number(event.key) - 1;
    if (event.key === "c" && this.hasOriginals) this.compare.click();
    else if (event.key === "h") this.heat.click();
    else if (event.key === "v") {
      this.views.selectedIndex = (this.views.selectedIndex + 1) % this.views.length;
      this.set({ view: this.views.value });
    } else if (number >= 0 && number < this.page.cameras.length) this.look(number);
    else this.orbit(event);
  }

  /** Arrow keys turn the camera about what it looks at, plus and minus come nearer and go away. */
  orbit(event) {
    if (event.target !== document.body && event.target !== byId("canvas")) return;
    const { controls, camera } = this.stage;
    const turn = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    const nearer = { "+": 0.9, "=": 0.9, "-": 1 / 0.9 }[event.key];
    const offset = camera.position.clone().sub(controls.target);
    if (turn) {
      offset.applyAxisAngle(camera.up, turn[0] * 0.08);
      const side = camera.up.clone().cross(offset).normalize();
      const up = offset.clone().applyAxisAngle(side, turn[1] * 0.06);
      if (Math.abs(up.clone().normalize().dot(camera.up)) < 0.98) offset.copy(up);
    } else if (nearer) offset.multiplyScalar(nearer);
    else return;
    camera.position.copy(controls.target).add(offset);
    controls.update();
    this.view.moved();
    event.preventDefault();
  }

  look(number) {
    this.camera.value = number;
    this.stage.look(number);
    this.write();
  }

  set(change) {
    this.view.set(change);
    this.write();
    this.refresh();
  }

  /** The address tells the view, so that a link leads to it. */
  write() {
    const { view, split, heat } = this.view.state;
    const parts = new URLSearchParams({ camera: this.page.cameras[Number(this.camera.value)]?.name ?? "", view });
    if (split !== null) parts.set("split", split.toFixed(3));
    if (heat) parts.set("heat", "1");
    clearTimeout(this.writing);
    this.writing = setTimeout(() => history.replaceState(null, "", `#${parts}`), 200);
  }

  read() {
    const parts = new URLSearchParams(location.hash.slice(1));
    const number = Math.max(0, this.page.cameras.findIndex((camera) => camera.name === parts.get("camera")));
    const views = [...this.views.options].map((option) => option.value);
    const view = views.includes(parts.get("view")) ? parts.get("view") : "lit";
    // Without a view in the address the divider is there from the beginning.
    const place = parts.size ? parts.get("split") : 0.5;
    const split = place !== null && this.hasOriginals ? Math.min(1, Math.max(0, Number(place) || 0)) : null;
    this.views.value = view;
    this.camera.value = number;
    this.view.set({ view, split, heat: parts.get("heat") === "1" });
    this.stage.look(number);
  }

  fixedFigures() {
    const { figures } = this.page;
    const rows = [
      ["Codec", `${figures.codec}, ${figures.grouping}`],
      ["Decoders", `${figures.decoders} for ${figures.textures} textures`],
      ["Stored", `${mega(figures.pack_bytes)}, ${figures.bits_per_texel.toFixed(2)} bits a texel`],
      ["Pixels", `${mega(figures.original_bytes)} uncompressed`],
      ["PSNR", figures.psnr_db === null ? "not measured" : `${figures.psnr_db.toFixed(1)} dB, worst texture ${figures.psnr_min_db.toFixed(1)} dB`],
    ];
    byId("figures").replaceChildren(...rows.flatMap((row) => this.row(...row)));
    this.live = Object.fromEntries(
      [["this", "This view"], ["divergence", "Divergence"], ["frame", "Frame"], ["decoded", "Decoded"]].map(([id, label]) => {
        const pair = this.row(label, "");
        byId("figures").append(...pair);
        return [id, pair];
      }),
    );
  }

  row(label, value) {
    const [term, data] = [document.createElement("dt"), document.createElement("dd")];
    term.textContent = label;
    data.textContent = value;
    return [term, data];
  }

  say(id, text) {
    for (const element of this.live[id]) element.hidden = text === null;
    if (text !== null) this.live[id][1].textContent = text;
  }

  refresh() {
    clearTimeout(this.refreshing);
    this.refreshing = null;
    const { split, heat } = this.view.state;
    this.compare.setAttribute("aria-pressed", split !== null);
    this.heat.setAttribute("aria-pressed", heat);
    this.handle.hidden = split === null;
    byId("sides").hidden = split === null;
    byId("sides").lastElementChild.textContent = this.surfaces.hasOriginals ? "Original" : "Original: loading";
    byId("scale").hidden = !heat;
    if (split !== null) {
      document.documentElement.style.setProperty("--split", `${split * 100}%`);
      this.handle.setAttribute("aria-valuenow", Math.round(split * 100));
    }
    const { frame, divergence, psnr } = this.view.figures;
    this.say("this", split === null ? null : psnr === null ? "being compared" : `${psnr.toFixed(1)} dB against the originals`);
    this.say("divergence", heat && divergence ? `${divergence.score.toFixed(3)} excess decoders a block, at most ${divergence.most}` : null);
    if (heat && divergence) byId("most").textContent = Math.max(4, divergence.most);
    this.say("frame", frame.length ? `${median(frame).toFixed(1)} ms` : "");
    const { texels, milliseconds } = this.decoder.statistics;
    this.say("decoded", texels ? `${(texels / 1e6).toFixed(1)} M texels in ${(milliseconds / 1e3).toFixed(2)} s` : "");
    const { share } = this.surfaces;
    const done = Math.round(100 * share);
    byId("status").textContent = this.view.isComplete ? "" : this.surfaces.pending ? `Decoding ${done} %` : "Looking for what is in sight";
    byId("progress").hidden = this.view.isComplete;
    document.documentElement.style.setProperty("--done", this.surfaces.pending ? `${done}%` : "3%");
  }
}
