// Light of the scene: the window's sky and sun.
import * as THREE from "three";

/** Returns the sky as a cube map with mips prefiltered by roughness, from the bytes of sky.bin; `sides` are those of the mips in texels. */
function skyCube(buffer, sides) {
  let at = 0;
  const faces = Array.from({ length: 6 }, () => {
    const mipmaps = sides.map((side) => {
      const data = new Uint16Array(buffer, at, side * side * 4);
      at += data.byteLength;
      return { data, width: side, height: side };
    });
    return { mipmaps, width: sides[0], height: sides[0] };
  });
  const texture = new THREE.CompressedCubeTexture(faces, THREE.RGBAFormat, THREE.HalfFloatType);
  texture.minFilter = THREE.LinearMipmapLinearFilter;
  texture.magFilter = THREE.LinearFilter;
  texture.generateMipmaps = false;
  texture.isPMREMTexture = true;
  texture.needsUpdate = true;
  return texture;
}

export class Light {
  /** `sky`: bytes of sky.bin. `radius`: radius of the sphere around the scene. */
  constructor(renderer, page, sky, radius) {
    Object.assign(this, { renderer, radius, sky: skyCube(sky, page.sky.sides) });
    this.direction = new THREE.Vector3(...page.sun.direction);
    this.sun = new THREE.DirectionalLight(new THREE.Color(...page.sun.irradiance), 1);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    this.sun.shadow.bias = -0.0004;
    this.sun.shadow.normalBias = 0.02;
    renderer.shadowMap.enabled = true;
    renderer.shadowMap.autoUpdate = false;
  }

  /** Fits the shadow map to the surroundings of `target`, which is at `distance` from the camera. */
  aim(target, distance) {
    const { radius, sun } = this;
    const reach = Math.min(radius, Math.max(4 * distance, radius / 12));
    sun.target.position.copy(target);
    sun.position.copy(target).addScaledVector(this.direction, 2 * radius);
    Object.assign(sun.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.01 * radius, far: 4 * radius });
    sun.shadow.camera.updateProjectionMatrix();
    this.renderer.shadowMap.needsUpdate = true;
  }
}
