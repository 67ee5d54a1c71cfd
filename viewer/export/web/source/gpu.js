// What drawing into textures needs: a triangle over the whole target, targets with mips, and knowing when the GPU is done.
import * as THREE from "three";

const CORNERS = `
in vec3 position;
void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }
`;

/** Draws fragment shaders of GLSL ES 3.00 over whole targets, or strips of them. */
export class FullScreen {
  constructor(renderer) {
    this.renderer = renderer;
    const triangle = new THREE.BufferGeometry();
    triangle.setAttribute("position", new THREE.BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3));
    this.mesh = new THREE.Mesh(triangle);
    this.mesh.frustumCulled = false;
    this.scene = new THREE.Scene().add(this.mesh);
    this.camera = new THREE.Camera();
  }

  static material(fragment, uniforms, options = {}) {
    return new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, // three writes the #version line itself
      vertexShader: `precision highp float;${CORNERS}`,
      fragmentShader: fragment.replace(/^#version 300 es\n/, ""),
      uniforms,
      depthTest: false,
      depthWrite: false,
      blending: THREE.NoBlending,
      ...options,
    });
  }

  /** Into level `mip` of `target` (null: the canvas), rows `first` to `last` alone. */
  draw(material, target, mip = 0, first = 0, last = Infinity) {
    const { renderer } = this;
    const before = renderer.getRenderTarget();
    if (target) {
      const width = Math.max(1, target.width >> mip);
      const height = Math.max(1, target.height >> mip);
      target.viewport.set(0, 0, width, height);
      target.scissorTest = true;
      target.scissor.set(0, first, width, Math.min(last, height) - first);
    }
    this.mesh.material = material;
    renderer.setRenderTarget(target, 0, mip);
    const { autoClear } = renderer;
    renderer.autoClear = false;
    renderer.render(this.scene, this.camera);
    renderer.autoClear = autoClear;
    renderer.setRenderTarget(before);
  }
}

/** A colour target of 8 bits, with `mips` levels that are drawn one by one. */
export function mippedTarget(width, height, mips, options) {
  const target = new THREE.WebGLRenderTarget(width, height, {
    depthBuffer: false,
    minFilter: THREE.LinearMipmapLinearFilter,
    magFilter: THREE.LinearFilter,
    generateMipmaps: false,
    ...options,
  });
  for (let level = 0; level < mips; ++level) {
    target.texture.mipmaps.push({ width: Math.max(1, width >> level), height: Math.max(1, height >> level) });
  }
  return target;
}

/** Resolves with the milliseconds after which the GPU has done all that it was given. */
export function gpuDone(renderer, start = performance.now()) {
  const gl = renderer.getContext();
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  return new Promise((resolve) => {
    const poll = () => {
      const lost = fence === null || gl.isContextLost();
      const status = lost ? gl.CONDITION_SATISFIED : gl.clientWaitSync(fence, 0, 0);
      if (status === gl.TIMEOUT_EXPIRED) return void setTimeout(poll, 1);
      gl.deleteSync(fence);
      resolve(performance.now() - start);
    };
    poll();
  });
}
