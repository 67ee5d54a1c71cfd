// What is on the screen: the picture, its divider, the divergence map, and which textures it needs.
import * as THREE from "three";
import { gpuDone } from "./gpu.js";

const REST_MS = 160; // without a movement: then what is finer is asked for, and figures are taken
const SLOW_MS = 100; // a frame that takes longer is drawn with half the pixels a side until all is there

export class View {
  constructor(renderer, stage, materials, surfaces, identity) {
    Object.assign(this, { renderer, stage, materials, surfaces, identity });
    this.state = { view: "lit", split: null, heat: false };
    this.figures = { frame: [], divergence: null, psnr: null };
    this.listeners = [];
    this.isDirty = false;
    this.version = 0;
    this.looked = -1; // version whose needs are known
    this.settled = -1; // version whose figures are known
    this.drawn = 0;
    this.ratio = 1; // pixels of the canvas per CSS pixel, at rest
    this.isSlow = true; // whether frames of all pixels take more than SLOW_MS, as far as is known
    this.took = Infinity; // milliseconds of the last frame
    this.step = 0; // stage of the surfaces, when the last frame was drawn
    this.shown = 0; // the same, of the last frame that the GPU has finished
    this.firstPicture = new Promise((resolve) => (this.firstShown = resolve));
  }

  set(change) {
    Object.assign(this.state, change);
    if ("split" in change) this.surfaces.compare(this.state.split !== null);
    this.moved();
  }

  /** The picture is out of date, because the camera or a setting changed. */
  moved() {
    ++this.version;
    clearTimeout(this.timer);
    // Nothing is drawn before it is known what is in sight: on a slow device a picture without textures takes seconds.
    if (this.looked < 0) return void this.rest();
    this.invalidate();
    this.timer = setTimeout(() => this.rest(), REST_MS);
  }

  invalidate() {
    if (this.isDirty) return;
    this.isDirty = true;
    requestAnimationFrame(() => this.frame());
  }

  frame() {
    this.isDirty = false;
    const start = (this.drawn = performance.now());
    const step = (this.step = this.surfaces.stage);
    const isWhole = this.isComplete || this.state.heat || !this.isSlow;
    const ratio = isWhole ? this.ratio : this.ratio / 2;
    const isFirst = this.looked >= 0 && this.shown === 0; // shaders are compiled: its time says nothing
    if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
    this.draw();
    gpuDone(this.renderer, start).then((time) => {
      this.shown = step;
      if (step > 0) this.firstShown();
      this.took = time;
      if (!isFirst) this.isSlow = time * (isWhole ? 1 : 4) > SLOW_MS;
      if (isWhole) this.figures.frame.push(time);
      if (this.figures.frame.length > 15) this.figures.frame.shift();
      this.tell();
    });
  }

  material(mesh, original) {
    return this.materials.get(mesh.userData.number, mesh.geometry, this.state.view, original);
  }

  side(original) {
    const isLit = this.state.view === "lit";
    this.stage.scene.background = isLit && !this.isMeasuring ? this.stage.sky : null;
    this.renderer.toneMapping = isLit ? THREE.NeutralToneMapping : THREE.NoToneMapping;
    this.stage.draw((mesh) => this.material(mesh, original), isLit);
  }

  draw() {
    const { renderer } = this;
    const { split, heat } = this.state;
    const [width, height] = this.stage.size;
    const place = split === null ? width : Math.round(split * width);
    renderer.setRenderTarget(null);
    renderer.setScissorTest(false);
    renderer.setClearColor(0x15171c, 1);
    renderer.autoClear = true;
    // Where no original is there both sides would be the same.
    if (split === null || !this.surfaces.hasOriginal) this.side(false);
    else {
      renderer.setScissorTest(true);
      renderer.setScissor(0, 0, place, height);
      if (place > 0) this.side(false);
      renderer.setScissor(place, 0, width - place, height);
      if (place < width) this.side(true);
      renderer.setScissorTest(false);
    }
    if (heat && this.figures.divergence) this.identity.show();
  }

  /** Width and height in pixels of the canvas at rest. */
  get size() {
    return this.stage.size.map((side) => Math.floor(side * this.ratio));
  }

  pixels() {
    const gl = this.renderer.getContext();
    const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    const found = new Uint8Array(width * height * 4);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, found);
    return found;
  }

  /** PSNR in dB of the picture of decoded textures against that of the originals, where there is a surface. */
  measure() {
    this.isMeasuring = true;
    this.renderer.setRenderTarget(null);
    this.renderer.setScissorTest(false);
    const side = (original) => {
      this.renderer.setClearColor(0x000000, 0);
      this.side(original);
      return this.pixels();
    };
    const [decoded, original] = [side(false), side(true)];
    this.isMeasuring = false;
    this.draw();
    let [sum, count] = [0, 0];
    for (let at = 0; at < decoded.length; at += 4) {
      if (decoded[at + 3] === 0) continue;
      for (let channel = 0; channel < 3; ++channel) sum += (decoded[at + channel] - original[at + channel]) ** 2;
      count += 3;
    }
    return sum > 0 ? 10 * Math.log10((255 * 255 * count) / sum) : null;
  }

  /** Once the camera rests: what it needs, then the divergence map, then the figures. */
  async rest() {
    if (this.isResting) return void (this.again = true);
    this.isResting = true;
    try {
      await gpuDone(this.renderer); // the frame goes first
      await this.need();
      await this.diverge();
    } finally {
      this.isResting = false;
      if (this.again) {
        this.again = false;
        this.rest();
      }
    }
  }

  async diverge() {
    if (!this.state.heat) return;
    this.figures.divergence = await this.identity.diverge(this.stage.scene, this.stage.camera, this.stage.meshes, ...this.size);
    this.identity.overlay.uniforms.most.value = Math.max(4, this.figures.divergence.most);
    this.tell();
    this.invalidate();
  }

  async need() {
    const version = this.version;
    if (this.looked === version) return;
    const found = await this.identity.footprints(this.stage.scene, this.stage.camera, this.stage.meshes, ...this.size);
    const seen = new Map();
    const planes = this.shownPlanes();
    for (const [number, size] of found) {
      for (const [plane, entry] of Object.entries(this.materials.planes(number))) {
        if (!planes.includes(plane)) continue;
        // As the hardware chooses: the mip below.
        const level = Math.floor(Math.max(0, size + Math.log2(Math.max(...entry.mips[0]))));
        seen.set(entry, Math.min(seen.get(entry) ?? Infinity, level));
      }
    }
    this.looked = version;
    this.surfaces.want(seen);
    this.tell();
  }

  shownPlanes() {
    return { lit: ["base", "surface", "emission"], base: ["base"], emissive: ["emission"] }[this.state.view] ?? ["surface"];
  }

  /** A texture came: the picture is out of date. Not drawn for each one of many: drawing would take the time from decoding. Returns the first
   * picture, once there is something of every colour: other work waits for it. */
  refreshed() {
    const isWhole = this.surfaces.pending === 0;
    const isNext = this.surfaces.stage > this.step;
    if (this.surfaces.stage === 0) return this.tell();
    if (isWhole || isNext || (this.step > 0 && performance.now() - this.drawn > Math.max(200, 8 * this.took))) this.invalidate();
    if (this.looked === this.version && this.surfaces.pending === 0) this.settle();
    this.tell();
    return this.firstPicture;
  }

  settle() {
    if (this.settled === this.version) return;
    this.settled = this.version;
    // After the frame that shows the last texture.
    requestAnimationFrame(() => {
      this.figures.psnr = this.state.split !== null ? this.measure() : null;
      this.tell();
    });
  }

  get isComplete() {
    return this.looked === this.version && this.surfaces.pending === 0;
  }

  tell() {
    for (const listener of this.listeners) listener();
  }
}
