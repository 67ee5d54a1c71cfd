// Decodes mips of textures from their latents, with the viewer's own shaders (shaders/*.frag, from shaders/ntc).
import * as THREE from "three";
import { readFile, readText, PageError } from "./folder.js";
import { FullScreen, gpuDone, mippedTarget } from "./gpu.js";

const COLUMN_BITS = 11; // words, and blocks of weights, lie in rows of 2^11
const KEPT = 12; // textures whose words stay on the GPU
const STRIP_MS = 40; // of work at once, so that the page answers

const WRAPPING = [THREE.RepeatWrapping, THREE.MirroredRepeatWrapping, THREE.ClampToEdgeWrapping];

function wordTexture(bytes) {
  const width = 1 << COLUMN_BITS;
  const words = Math.max(1, bytes.byteLength / 4);
  const height = Math.ceil(words / width);
  const all = new Uint32Array(width * height);
  new Uint8Array(all.buffer).set(bytes);
  const texture = new THREE.DataTexture(all, width, height, THREE.RedIntegerFormat, THREE.UnsignedIntType);
  texture.internalFormat = "R32UI";
  texture.needsUpdate = true;
  return texture;
}

export class Decoder {
  constructor(renderer, page) {
    this.renderer = renderer;
    this.page = page;
    this.screen = new FullScreen(renderer);
    this.files = new Map(); // texture -> promise of its bytes
    this.words = new Map(); // texture -> its samplers; the last KEPT
    this.stripTexels = 1 << 14; // in STRIP_MS, as far as is known
    this.given = 0; // texels since the GPU was last waited for
    this.began = 0;
    this.drawn = 0; // texels in all
    this.paced = () => {}; // called after each strip
    this.statistics = { texels: 0, milliseconds: 0 };
  }

  async prepare() {
    const { decoders, shaders } = this.page;
    const names = Object.keys(shaders);
    const [bytes, ...texts] = await Promise.all([readFile(decoders), ...names.map((name) => readText(shaders[name]))]);
    const width = 1 << COLUMN_BITS;
    const limit = this.renderer.capabilities.maxTextureSize;
    if (decoders.rows > limit) throw new PageError(`The decoders need ${decoders.rows} rows of a texture; this device has ${limit}`);
    const data = decoders.integer ? new Uint32Array(bytes.buffer) : new Float32Array(bytes.buffer);
    const [format, type, internal] = decoders.integer
      ? [THREE.RGBAIntegerFormat, THREE.UnsignedIntType, "RGBA32UI"]
      : [THREE.RGBAFormat, THREE.FloatType, "RGBA32F"];
    const weights = new THREE.DataTexture(data, width, decoders.rows, format, type);
    weights.internalFormat = internal;
    weights.needsUpdate = true;
    this.materials = Object.fromEntries(
      names.map((name, index) => [
        name,
        FullScreen.material(texts[index], {
          textures_words: { value: null },
          levels_words: { value: null },
          latent_words_words: { value: null },
          weight_image: { value: weights },
          table_image: { value: weights },
          network_blocks: { value: decoders.loop_length },
          mip: { value: 0 },
          wrap: { value: [0, 0] },
        }),
      ]),
    );
    // A texel of the plane that is shown first: its program is compiled while the scene is read.
    if (names.includes("base")) (await this.decode(0, "base", [0, 0], this.page.textures[0].mips.length - 1)).dispose();
  }

  file(index) {
    if (!this.files.has(index)) {
      const found = readFile(this.page.textures[index].packed);
      found.catch(() => this.files.delete(index));
      this.files.set(index, found);
    }
    return this.files.get(index);
  }

  async wordsOf(index) {
    if (!this.words.has(index)) {
      const { packed } = this.page.textures[index];
      const bytes = await this.file(index);
      const latents = packed.record + packed.levels;
      const rows = Math.ceil((bytes.length - latents) / 4 / (1 << COLUMN_BITS));
      if (rows > this.renderer.capabilities.maxTextureSize) throw new PageError(`${packed.file}: more latents than this device can read`);
      this.words.set(index, {
        textures_words: wordTexture(bytes.subarray(0, packed.record)),
        levels_words: wordTexture(bytes.subarray(packed.record, latents)),
        latent_words_words: wordTexture(bytes.subarray(latents)),
      });
    }
    const words = this.words.get(index);
    this.words.delete(index);
    this.words.set(index, words); // the last one used is the last one to go
    for (const [oldest, own] of this.words) {
      if (this.words.size <= KEPT) break;
      this.words.delete(oldest);
      for (const texture of Object.values(own)) texture.dispose();
    }
    return words;
  }

  /**
   * A target with the mips from `finest` on of a plane. `wrap`: codes of the shader.
   */
  async decode(index, plane, wrap, finest) {
    const { mips } = this.page.textures[index];
    const words = await this.wordsOf(index);
    if (this.given === 0) this.began = performance.now();
    const [width, height] = mips[finest];
    const target = mippedTarget(width, height, mips.length - finest, {
      wrapS: WRAPPING[wrap[0]],
      wrapT: WRAPPING[wrap[1]],
      colorSpace: plane === "surface" ? THREE.NoColorSpace : THREE.SRGBColorSpace,
    });
    const material = this.materials[plane];
    for (let mip = mips.length - 1; mip >= finest; --mip) {
      const [columns, rows] = mips[mip];
      for (let first = 0; first < rows; ) {
        const count = Math.max(1, Math.min(rows - first, Math.floor(this.stripTexels / columns)));
        for (const [name, texture] of Object.entries(words)) material.uniforms[name].value = texture;
        material.uniforms.mip.value = mip;
        material.uniforms.wrap.value = wrap;
        material.uniformsNeedUpdate = true;
        this.screen.draw(material, target, mip - finest, first, first + count);
        first += count;
        this.drawn += columns * count;
        await this.pace(columns * count);
      }
    }
    return target;
  }

  /** Waits for the GPU once it has been given a strip's worth of work, and learns from that how much a strip is. */
  async pace(texels) {
    this.given += texels;
    if (this.given < this.stripTexels) return;
    const given = this.given;
    this.given = 0;
    const time = await gpuDone(this.renderer, this.began);
    this.statistics.texels += given;
    this.statistics.milliseconds += time;
    const fitting = (given * STRIP_MS) / Math.max(time, 0.5);
    this.stripTexels = Math.min(1 << 20, Math.max(1 << 12, this.stripTexels / 2 + fitting / 2));
    this.began = performance.now();
    this.paced();
  }
}
