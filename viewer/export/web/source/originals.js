// The original images as textures of the same layout as the decoded ones.
import * as THREE from "three";
import { readPicture } from "./folder.js";
import { FullScreen } from "./gpu.js";

const COPY = `precision highp float;
uniform highp sampler2D picture; // with a fourth component: two pictures, one below the other
uniform ivec2 size;
uniform bool stacked;
uniform bool color;
out vec4 target;
vec3 linear(vec3 srgb) {
  return mix(pow((srgb + 0.055) / 1.055, vec3(2.4)), srgb / 12.92, lessThanEqual(srgb, vec3(0.04045)));
}
void main() {
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec3 first = texelFetch(picture, texel, 0).rgb;
  float last = stacked ? texelFetch(picture, texel + ivec2(0, size.y), 0).r : 1.0;
  target = vec4(color ? linear(first) : first, last);
}
`;

function plainTexture(bitmap) {
  const texture = new THREE.Texture(bitmap);
  texture.flipY = false;
  texture.minFilter = texture.magFilter = THREE.NearestFilter;
  texture.generateMipmaps = false;
  texture.needsUpdate = true;
  return texture;
}

export class Originals {
  constructor(renderer, screen) {
    this.screen = screen;
    this.material = FullScreen.material(COPY, {
      picture: { value: null },
      size: { value: [1, 1] },
      stacked: { value: false },
      color: { value: false },
    });
  }

  /** A target with all mips of one original picture. */
  async load(entry, plane, options) {
    const bitmap = await readPicture(entry);
    const stacked = plane !== "base";
    const [width, height] = [bitmap.width, stacked ? bitmap.height / 2 : bitmap.height];
    const target = new THREE.WebGLRenderTarget(width, height, {
      depthBuffer: false,
      minFilter: THREE.LinearMipmapLinearFilter,
      generateMipmaps: true,
      colorSpace: plane === "surface" ? THREE.NoColorSpace : THREE.SRGBColorSpace,
      ...options,
    });
    const picture = plainTexture(bitmap);
    Object.assign(this.material.uniforms, {
      picture: { value: picture },
      size: { value: [width, height] },
      stacked: { value: stacked },
      color: { value: plane !== "surface" },
    });
    this.material.uniformsNeedUpdate = true;
    this.screen.draw(this.material, target);
    picture.dispose();
    bitmap.close();
    return target;
  }
}

/** Coverage, which is never encoded. */
export async function alphaTexture(entry, wrapS, wrapT) {
  const texture = plainTexture(await readPicture(entry));
  Object.assign(texture, { wrapS, wrapT, minFilter: THREE.LinearMipmapLinearFilter, magFilter: THREE.LinearFilter, generateMipmaps: true });
  return texture;
}
