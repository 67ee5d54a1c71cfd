// Which textures are on the GPU, decoded and original: those that are seen, as fine as they are seen.
import * as THREE from "three";
import { Originals } from "./originals.js";

const COARSE_SIDE = 32; // texels of the first picture of a texture
const MIDDLE = 2; // mips between what is wanted and the picture before it: a sixteenth of the work
const AHEAD = 24; // entries of the queue whose files are asked for
const WRAPPING = [THREE.RepeatWrapping, THREE.MirroredRepeatWrapping, THREE.ClampToEdgeWrapping];
export const CHANNEL = { base: 0, surface: 1, emission: 2 };

export class Surfaces {
  /** `changed` is called after each texture that came or went, and may return a promise for which decoding waits; `failed` with an error that
   * ends the work. */
  constructor(renderer, page, decoder, budgetTexels, changed, failed) {
    Object.assign(this, { renderer, page, decoder, budgetTexels, changed, failed });
    this.originals = new Originals(renderer, decoder.screen);
    this.entries = new Map();
    this.queue = [];
    this.isRunning = false;
    this.clock = 0;
    this.usedTexels = 0;
    this.began = this.ends = 0; // texels that the decoder had drawn, and will have
    this.compares = false;
  }

  /** The place of one plane of a material: shared by all that read it alike. */
  entry(plane, place) {
    const key = [place.texture, plane, ...place.wrap, ...place.linear, place.mipmap].join();
    if (!this.entries.has(key)) {
      this.entries.set(key, {
        key, plane, ...place,
        mips: this.page.textures[place.texture].mips,
        target: null, level: Infinity, // the finest mip that is there
        wanted: Infinity, seen: -1,
        original: null, originalState: "none",
        users: [],
      });
    }
    return this.entries.get(key);
  }

  /** null: nothing of it is there. Until an original is there, what is decoded: the picture is whole from the first on. */
  texture(entry, original) {
    return ((original && entry.original) || entry.target)?.texture ?? null;
  }

  coarse(entry) {
    const fits = (mip) => Math.max(...entry.mips[mip]) <= COARSE_SIDE;
    const found = entry.mips.findIndex((_, mip) => fits(mip));
    return found < 0 ? entry.mips.length - 1 : found;
  }

  finest(entry) {
    const limit = this.renderer.capabilities.maxTextureSize;
    return entry.mips.findIndex(([width, height]) => Math.max(width, height) <= limit);
  }

  /** `seen`: entry -> finest mip that the view reads. Everything else may go. */
  want(seen) {
    ++this.clock;
    for (const [entry, level] of seen) {
      entry.seen = this.clock;
      entry.wanted = Math.min(entry.mips.length - 1, Math.max(level, this.finest(entry)));
    }
    this.plan();
  }

  compare(on) {
    this.compares = on;
    this.plan();
  }

  /** All that is missing, the most needed first: something of all colours, then of all else, all a quarter as fine, originals, then what
   * is wanted. */
  plan() {
    const seen = [...this.entries.values()].filter((entry) => entry.seen === this.clock);
    const coarse = [], middle = [], originals = [], fine = [];
    for (const entry of seen) {
      const first = Math.max(this.coarse(entry), entry.wanted);
      if (!entry.target) coarse.push({ entry, level: first });
      const there = Math.min(entry.level, entry.target ? Infinity : first);
      if (there > entry.wanted + MIDDLE + 1) middle.push({ entry, level: entry.wanted + MIDDLE });
      if (there > entry.wanted) fine.push({ entry, level: entry.wanted });
      const has = this.page.textures[entry.texture].originals[entry.plane];
      if (this.compares && has && entry.originalState === "none") originals.push({ entry, original: true });
    }
    // The planes of a texture one after the other, as long as its latents are on the GPU; first and last base colours before the others:
    // they are what is seen most.
    const byTexture = (a, b) => a.entry.texture - b.entry.texture;
    const order = (a, b) => CHANNEL[a.entry.plane] - CHANNEL[b.entry.plane] || byTexture(a, b);
    this.queue = [...coarse.sort(order), ...middle.sort(byTexture), ...originals.sort(order), ...fine.sort(order)];
    if (!this.isRunning) this.began = this.decoder.drawn;
    this.ends = this.decoder.drawn + this.queue.reduce((sum, own) => sum + (own.original ? 0 : this.texels(own.entry, own.level)), 0);
    if (!this.isRunning) this.run();
  }

  get pending() {
    return this.queue.length + (this.isRunning ? 1 : 0);
  }

  /** Share of the texels that are decoded, of those that are wanted, 0 to 1. */
  get share() {
    return this.ends > this.began ? Math.min(1, (this.decoder.drawn - this.began) / (this.ends - this.began)) : 1;
  }

  /** Whether something of every colour in sight is there: of the first plane that the view shows. */
  get hasFirstPicture() {
    const seen = [...this.entries.values()].filter((entry) => entry.seen === this.clock);
    const first = Math.min(...seen.map((entry) => CHANNEL[entry.plane]));
    return seen.every((entry) => CHANNEL[entry.plane] > first || entry.target);
  }

  /** Whether an original is there. */
  get hasOriginal() {
    return [...this.entries.values()].some((entry) => entry.original);
  }

  /** Whether all originals that are compared are there. */
  get hasOriginals() {
    const isThere = (entry) => entry.original || !this.page.textures[entry.texture].originals[entry.plane];
    return [...this.entries.values()].every((entry) => entry.seen !== this.clock || isThere(entry));
  }

  /** 0: a colour is not there at all, 1: all is coarse, 2: all is a quarter as fine as is wanted, 3: all is there. */
  get stage() {
    if (this.clock === 0 || !this.hasFirstPicture) return 0;
    if (this.pending === 0) return 3;
    return this.queue.some(({ entry, level, original }) => !original && level > entry.wanted) ? 1 : 2;
  }

  async run() {
    this.isRunning = true;
    try {
      while (this.queue.length) {
        const { entry, level, original } = this.queue.shift();
        for (const next of this.queue.slice(0, AHEAD)) this.decoder.file(next.entry.texture).catch(() => {});
        if (original) await this.loadOriginal(entry);
        else if (level < entry.level) await this.decodeTo(entry, level);
      }
    } catch (error) {
      this.queue = [];
      this.failed(error);
    } finally {
      this.isRunning = false;
      this.changed();
    }
  }

  use(target, entry) {
    target.texture.channel = CHANNEL[entry.plane];
    target.texture.magFilter = entry.linear[0] ? THREE.LinearFilter : THREE.NearestFilter;
  }

  async decodeTo(entry, level) {
    level = this.makeRoom(entry, level);
    if (level >= entry.level) return;
    const target = await this.decoder.decode(entry.texture, entry.plane, entry.wrap, level);
    if (!target) return;
    this.use(target, entry);
    this.drop(entry);
    entry.target = target;
    entry.level = level;
    this.usedTexels += this.texels(entry, level);
    await this.tell(entry);
  }

  async loadOriginal(entry) {
    entry.originalState = "loading";
    const picture = this.page.textures[entry.texture].originals[entry.plane];
    const options = { wrapS: WRAPPING[entry.wrap[0]], wrapT: WRAPPING[entry.wrap[1]] };
    entry.original = await this.originals.load(picture, entry.plane, options);
    this.use(entry.original, entry);
    entry.originalState = "there";
    this.usedTexels += this.texels(entry, 0);
    this.tell(entry);
  }

  texels(entry, level) {
    const [width, height] = entry.mips[level];
    return (width * height * 4) / 3;
  }

  /** Drops what is not in sight, the longest unseen first; the mip that fits then. */
  makeRoom(entry, level) {
    const idle = [...this.entries.values()].filter((own) => own.seen !== this.clock && own.target);
    idle.sort((a, b) => a.seen - b.seen);
    const needed = () => this.usedTexels + this.texels(entry, level) > this.budgetTexels;
    while (needed() && idle.length) {
      const own = idle.shift();
      this.drop(own);
      this.tell(own);
    }
    while (needed() && level < this.coarse(entry)) ++level;
    return level;
  }

  drop(entry) {
    if (!entry.target) return;
    this.usedTexels -= this.texels(entry, entry.level);
    entry.target.dispose();
    entry.target = null;
    entry.level = Infinity;
  }

  tell(entry) {
    for (const user of entry.users) user();
    return this.changed();
  }
}
