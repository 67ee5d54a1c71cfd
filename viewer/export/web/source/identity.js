// Which material, how large on screen, which decoder: drawn instead of colours, for what is needed and for the divergence map.
import * as THREE from "three";
import { FullScreen } from "./gpu.js";

const VERTEX = `
precision highp float;
uniform mat4 modelViewMatrix, projectionMatrix;
in vec3 position;
in vec2 uv;
in vec2 uv1;
in vec2 uv2;
out vec2 place0;
out vec2 place1;
out vec2 place2;
void main() {
  place0 = uv; place1 = uv1; place2 = uv2;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}
`;
// Red and green: the number + 1. Blue: the logarithm of the smallest footprint of a pixel among the planes, in eighths from 2^-24 on.
const FRAGMENT = `
precision highp float;
uniform float number;
uniform sampler2D coverage;
uniform float cutoff;
uniform float scale;
in vec2 place0;
in vec2 place1;
in vec2 place2;
out vec4 target;
float footprint(vec2 place) { return max(length(dFdx(place)), length(dFdy(place))); }
void main() {
  if (cutoff > 0.0 && texture(coverage, place0).g < cutoff) discard;
  float smallest = min(footprint(place0), min(footprint(place1), footprint(place2))) * scale;
  float high = floor((number + 1.0) / 256.0);
  target = vec4(number + 1.0 - 256.0 * high, high, clamp((log2(max(smallest, 1e-9)) + 24.0) * 8.0, 0.0, 255.0), 255.0) / 255.0;
}
`;
const COUNT = `precision highp float;
uniform highp sampler2D identities;
uniform ivec2 picture;
out vec4 target;
// Distinct decoders of a block of 8 x 8 pixels, counted from the top left (shaders/passes/divergence/count.glsl).
void main() {
  ivec2 block = ivec2(gl_FragCoord.xy);
  int found[64];
  int count = 0;
  for (int n = 0; n < 64; ++n) {
    ivec2 pixel = block * 8 + ivec2(n % 8, n / 8);
    if (any(greaterThanEqual(pixel, picture))) continue;
    vec4 texel = texelFetch(identities, ivec2(pixel.x, picture.y - 1 - pixel.y), 0);
    int decoder = int(texel.r * 255.0 + 0.5) + 256 * int(texel.g * 255.0 + 0.5);
    if (decoder == 0) continue;
    bool known = false;
    for (int k = 0; k < count; ++k) known = known || found[k] == decoder;
    if (!known) found[count++] = decoder;
  }
  target = vec4(float(count) / 255.0, 0.0, 0.0, 1.0);
}
`;
const SHOW = `precision highp float;
uniform highp sampler2D blocks;
uniform ivec2 picture;
uniform vec3 palette[9];
uniform float most;
out vec4 target;
void main() {
  ivec2 pixel = ivec2(gl_FragCoord.x, float(picture.y) - gl_FragCoord.y);
  float count = texelFetch(blocks, pixel / 8, 0).r * 255.0;
  if (count < 0.5) discard;
  float place = clamp((count - 1.0) / max(most - 1.0, 1.0), 0.0, 1.0) * 8.0;
  int first = min(int(place), 7);
  target = vec4(mix(palette[first], palette[first + 1], place - float(first)), 0.62);
}
`;

function target(width, height) {
  return new THREE.WebGLRenderTarget(width, height, { minFilter: THREE.NearestFilter, magFilter: THREE.NearestFilter });
}

export class Identity {
  constructor(renderer, screen, palette) {
    this.renderer = renderer;
    this.screen = screen;
    this.white = new THREE.DataTexture(new Uint8Array([255, 255, 255, 255]), 1, 1);
    this.white.needsUpdate = true;
    this.needed = target(1, 1);
    this.decoders = target(1, 1);
    this.blocks = target(1, 1);
    this.count = FullScreen.material(COUNT, { identities: { value: null }, picture: { value: [1, 1] } });
    this.overlay = FullScreen.material(
      SHOW,
      { blocks: { value: null }, picture: { value: [1, 1] }, palette: { value: palette.map((color) => new THREE.Vector3(...color)) }, most: { value: 4 } },
      { transparent: true, blending: THREE.NormalBlending },
    );
    this.scale = { value: 1 };
    this.materials = new Map();
  }

  material(number, own, coverage) {
    const key = `${number} ${own.double_sided} ${coverage?.uuid} ${own.alpha_cutoff}`;
    if (!this.materials.has(key)) {
      // Raw: one program for single-sided and double-sided materials.
      const made = new THREE.RawShaderMaterial({
        glslVersion: THREE.GLSL3,
        vertexShader: VERTEX,
        fragmentShader: FRAGMENT,
        blending: THREE.NoBlending,
        side: own.double_sided ? THREE.DoubleSide : THREE.FrontSide,
        uniforms: {
          number: { value: number },
          coverage: { value: coverage ?? this.white },
          cutoff: { value: coverage ? (own.alpha_mode === "mask" ? own.alpha_cutoff : 0.5) : 0 },
          scale: this.scale,
        },
      });
      this.materials.set(key, made);
    }
    return this.materials.get(key);
  }

  /** Draws the numbers that `of` gives for meshes (below 0: none). */
  draw(scene, camera, meshes, into, of, scale) {
    const { renderer } = this;
    const { background, environment } = scene;
    scene.background = scene.environment = null;
    this.scale.value = scale;
    for (const mesh of meshes) {
      const { own, coverage, isShown } = mesh.userData;
      mesh.visible = isShown !== false && own.alpha_mode !== "blend";
      mesh.material = this.material(of(mesh), own, coverage);
    }
    renderer.setRenderTarget(into);
    renderer.setClearColor(0x000000, 0);
    const { shadowMap } = renderer;
    const updates = shadowMap.enabled;
    shadowMap.enabled = false;
    renderer.clear();
    renderer.render(scene, camera);
    shadowMap.enabled = updates;
    renderer.setRenderTarget(null);
    for (const mesh of meshes) mesh.visible = true;
    Object.assign(scene, { background, environment });
  }

  /** By material in sight: the logarithm of its smallest footprint, in uv per pixel of a picture of `width` x `height`. */
  async footprints(scene, camera, meshes, width, height) {
    const [columns, rows] = [Math.max(1, width >> 1), Math.max(1, height >> 1)];
    this.needed.setSize(columns, rows);
    this.draw(scene, camera, meshes, this.needed, (mesh) => mesh.userData.number, columns / width);
    const pixels = new Uint8Array(columns * rows * 4);
    await this.renderer.readRenderTargetPixelsAsync(this.needed, 0, 0, columns, rows, pixels);
    const found = new Map();
    for (let at = 0; at < pixels.length; at += 4) {
      const number = pixels[at] + 256 * pixels[at + 1] - 1;
      if (number < 0) continue;
      const size = pixels[at + 2] / 8 - 24;
      if (!(found.get(number) <= size)) found.set(number, size);
    }
    return found;
  }

  /** The divergence map: score, excess and the most decoders of a block. */
  async diverge(scene, camera, meshes, width, height) {
    const [across, down] = [Math.ceil(width / 8), Math.ceil(height / 8)];
    this.decoders.setSize(width, height);
    this.blocks.setSize(across, down);
    this.draw(scene, camera, meshes, this.decoders, (mesh) => mesh.userData.decoder, 1);
    Object.assign(this.count.uniforms, { identities: { value: this.decoders.texture }, picture: { value: [width, height] } });
    this.count.uniformsNeedUpdate = true;
    this.screen.draw(this.count, this.blocks);
    Object.assign(this.overlay.uniforms, { blocks: { value: this.blocks.texture }, picture: { value: [width, height] } });
    const pixels = new Uint8Array(across * down * 4);
    await this.renderer.readRenderTargetPixelsAsync(this.blocks, 0, 0, across, down, pixels);
    let [excess, most, divergent] = [0, 0, 0];
    for (let at = 0; at < pixels.length; at += 4) {
      excess += Math.max(pixels[at] - 1, 0);
      divergent += pixels[at] > 1;
      most = Math.max(most, pixels[at]);
    }
    return { excess, most, divergent, blocks: across * down, score: excess / (across * down) };
  }

  /** Lays the map over the canvas. */
  show() {
    this.overlay.uniformsNeedUpdate = true;
    this.screen.draw(this.overlay, null);
  }
}
