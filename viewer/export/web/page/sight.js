// Visibility: the material of each pixel, and its footprint, the distance of neighbouring pixels in texture coordinates.
import * as THREE from "three";

const BLOCK = 8; // pixels a side of a block of the divergence map
const STEPS = 8; // steps of a stored footprint per power of two
const LEAST = 24; // the smallest stored footprint is 2^-24
// S. van der Walt and N. Smith, CC0.
export const VIRIDIS = [
  [68, 1, 84], [70, 43, 120], [59, 82, 139], [44, 114, 142], [33, 145, 140], [40, 174, 128], [94, 201, 98], [173, 220, 48], [253, 231, 37],
];
const NUMBER = `
{
  #ifdef USE_MAP
    float size = max(length(dFdx(vMapUv)), length(dFdy(vMapUv))) * scale;
  #else
    float size = 1.0;
  #endif
  float high = floor((number + 1.0) / 256.0);
  float place = clamp((log2(max(size, 1e-9)) + ${LEAST}.0) * ${STEPS}.0, 0.0, 255.0);
  gl_FragColor = vec4(number + 1.0 - 256.0 * high, high, floor(place), 255.0) / 255.0;
}`;

/** Returns the first texture of a material. Its coordinates measure the footprint for all textures. */
export const mainTexture = ({ map, normalMap, roughnessMap, emissiveMap, aoMap }) =>
  [map, normalMap, roughnessMap, emissiveMap, aoMap].find((texture) => texture?.set) ?? map ?? null;

export class Sight {
  constructor(renderer, scene) {
    Object.assign(this, { renderer, scene });
    this.target = new THREE.WebGLRenderTarget(1, 1, { minFilter: THREE.NearestFilter, magFilter: THREE.NearestFilter });
    this.scale = { value: 1 };
    this.materials = new Map();
  }

  material(lit, number) {
    if (!this.materials.has(lit)) {
      const { alphaTest, side } = lit;
      const made = new THREE.MeshBasicMaterial({ map: mainTexture(lit), alphaTest, side, toneMapped: false, blending: THREE.NoBlending });
      made.onBeforeCompile = (shader) => {
        Object.assign(shader.uniforms, { number: { value: number }, scale: this.scale });
        shader.fragmentShader = shader.fragmentShader
          .replace("#include <common>", "uniform float number, scale;\n#include <common>")
          .replace("#include <opaque_fragment>", NUMBER);
      };
      this.materials.set(lit, made);
    }
    return this.materials.get(lit);
  }

  /**
   * Draws one pixel in `step` along each side of a picture of `width` x `height` pixels; `lit(mesh)` returns the material of a mesh.
   * Returns bytes of RGBA, the lowest row first: red and green are a material's number + 1, blue is the footprint.
   */
  async draw(meshes, camera, width, height, step, lit) {
    const { renderer, scene, target } = this;
    const { background, environment } = scene;
    const [columns, rows] = [Math.ceil(width / step), Math.ceil(height / step)];
    target.setSize(columns, rows);
    this.scale.value = columns / width;
    const blended = meshes.filter((mesh) => lit(mesh).transparent);
    for (const mesh of blended) mesh.visible = false;
    for (const mesh of meshes) mesh.material = this.material(lit(mesh), mesh.userData.number);
    Object.assign(scene, { background: null, environment: null });
    renderer.shadowMap.enabled = false;
    renderer.setRenderTarget(target);
    renderer.setClearColor(0x000000, 0);
    renderer.clear();
    renderer.render(scene, camera);
    renderer.setRenderTarget(null);
    renderer.shadowMap.enabled = true;
    Object.assign(scene, { background, environment });
    for (const mesh of blended) mesh.visible = true;
    const pixels = new Uint8Array(4 * columns * rows);
    return renderer.readRenderTargetPixelsAsync(target, 0, 0, columns, rows, pixels);
  }
}

/** Returns the smallest footprint of the pixels of each material, by its number. */
export function footprints(pixels) {
  const least = new Map();
  for (let at = 0; at < pixels.length; at += 4) {
    const number = pixels[at] + 256 * pixels[at + 1] - 1;
    if (number >= 0 && !(least.get(number) <= pixels[at + 2])) least.set(number, pixels[at + 2]);
  }
  return new Map([...least].map(([number, size]) => [number, 2 ** (size / STEPS - LEAST)]));
}

/**
 * Counts the distinct decoders D of each block of 8 x 8 pixels, from the top left; `decoders`: by number of a material, -1 for none.
 * Returns {counts, across, down, excess, most}: D of each block, blocks along each side, the sum of max(D - 1, 0), the largest D.
 */
export function divergence(pixels, width, height, decoders) {
  const [across, down] = [Math.ceil(width / BLOCK), Math.ceil(height / BLOCK)];
  const counts = new Uint8Array(across * down);
  let [excess, most] = [0, 0];
  const seen = new Set();
  for (let block = 0; block < counts.length; ++block) {
    const [left, top] = [(block % across) * BLOCK, Math.floor(block / across) * BLOCK];
    seen.clear();
    for (let y = top; y < Math.min(top + BLOCK, height); ++y) {
      for (let x = left; x < Math.min(left + BLOCK, width); ++x) {
        const at = 4 * ((height - 1 - y) * width + x);
        const decoder = decoders[pixels[at] + 256 * pixels[at + 1] - 1] ?? -1;
        if (decoder >= 0) seen.add(decoder);
      }
    }
    counts[block] = seen.size;
    excess += Math.max(seen.size - 1, 0);
    most = Math.max(most, seen.size);
  }
  return { counts, across, down, excess, most };
}

/** Draws a divergence map {counts, across, down} into `canvas`, which covers the picture; the last colour is that of `most`. */
export function drawMap(canvas, { counts, across, down }, most, ratio) {
  Object.assign(canvas, { width: across, height: down });
  Object.assign(canvas.style, { width: `${(across * BLOCK) / ratio}px`, height: `${(down * BLOCK) / ratio}px` });
  const image = new ImageData(across, down);
  counts.forEach((count, block) => {
    if (count === 0) return;
    const place = (Math.min(1, (count - 1) / Math.max(most - 1, 1)) * (VIRIDIS.length - 1));
    const first = Math.min(Math.floor(place), VIRIDIS.length - 2);
    const color = VIRIDIS[first].map((low, channel) => low + (VIRIDIS[first + 1][channel] - low) * (place - first));
    image.data.set([...color, 255], 4 * block);
  });
  canvas.getContext("2d").putImageData(image, 0, 0);
}
