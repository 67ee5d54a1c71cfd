// The scene, what lights it, and the camera.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { readFile } from "./folder.js";

/** The window's sky from its file: a cube map whose mips are filtered by roughness. */
function skyCube(bytes, sides) {
  let at = bytes.byteOffset;
  const faces = Array.from({ length: 6 }, () => {
    const mipmaps = sides.map((side) => {
      const data = new Uint16Array(bytes.buffer, at, side * side * 4);
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

function sceneLight(light) {
  const color = new THREE.Color(...light.color);
  const made =
    light.kind === "directional" ? new THREE.DirectionalLight(color, 1)
    : light.kind === "point" ? new THREE.PointLight(color, 1, light.reach)
    : new THREE.SpotLight(color, 1, light.reach, light.cones[1], 1 - light.cones[0] / Math.max(light.cones[1], 1e-6));
  made.position.set(...(light.kind === "directional" ? [0, 0, 0] : light.position));
  if (made.target) {
    made.target.position.copy(made.position).add(new THREE.Vector3(...light.direction));
    made.add(made.target);
    made.target.position.set(...light.direction);
  }
  return made;
}

export class Stage {
  constructor(renderer, canvas, page, changed) {
    Object.assign(this, { renderer, page, changed });
    this.scene = new THREE.Scene();
    this.meshes = [];
    this.camera = new THREE.PerspectiveCamera(60, 1, 0.1, 1000);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", changed);
    const [low, high] = page.bounds.map((corner) => new THREE.Vector3(...corner));
    this.centre = low.clone().add(high).multiplyScalar(0.5);
    this.radius = Math.max(low.distanceTo(high) / 2, 1e-6);
    this.size = [1, 1];
  }

  async load(materials) {
    const [bytes, sky] = await Promise.all([readFile(this.page.scene), readFile(this.page.sky), materials.prepare()]);
    const gltf = await new GLTFLoader().parseAsync(bytes.buffer, "");
    const { nodes } = gltf.parser.json;
    gltf.scene.traverse((object) => {
      const found = gltf.parser.associations.get(object);
      const matrix = found?.nodes !== undefined && nodes[found.nodes].matrix;
      if (matrix) {
        // As it stands in the file: turned into scale and rotation it would lose a shear.
        object.matrixAutoUpdate = false;
        object.matrix.fromArray(matrix);
      }
      if (!object.isMesh) return;
      const number = object.material.userData.material;
      const own = this.page.materials[number];
      const places = own.planes;
      const primary = ["base", "surface", "emission"].map((plane) => places[plane]).find(Boolean);
      Object.assign(object.userData, {
        number, own, coverage: materials.coverage[number], solid: object.material,
        decoder: primary ? this.page.textures[primary.texture].decoder : -1,
      });
      object.castShadow = object.receiveShadow = own.alpha_mode !== "blend";
      this.meshes.push(object);
    });
    this.scene.add(gltf.scene);
    this.scene.updateMatrixWorld(true);
    this.light(sky);
  }

  light(sky) {
    this.sky = this.environment = skyCube(sky, this.page.sky.sides);
    const lights = this.page.lights.slice(0, 12).map(sceneLight);
    for (const light of lights) this.scene.add(light);
    const { direction, irradiance } = this.page.sun;
    this.sunWay = new THREE.Vector3(...direction);
    this.sun = new THREE.DirectionalLight(new THREE.Color(...irradiance), 1);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    this.sun.shadow.bias = -0.0004;
    this.sun.shadow.normalBias = 0.02;
    this.scene.add(this.sun, this.sun.target);
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.autoUpdate = false;
  }

  /** The sun's shadow over what stands around the place that is looked at. */
  aimSun() {
    if (!this.sun) return;
    const reach = Math.min(this.radius, Math.max(4 * this.camera.position.distanceTo(this.controls.target), this.radius / 12));
    const { camera } = this.sun.shadow;
    this.sun.target.position.copy(this.controls.target);
    this.sun.position.copy(this.controls.target).addScaledVector(this.sunWay, 2 * this.radius);
    Object.assign(camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.01 * this.radius, far: 4 * this.radius });
    camera.updateProjectionMatrix();
    this.renderer.shadowMap.needsUpdate = true;
  }

  resize(width, height) {
    this.size = [width, height];
    this.project();
  }

  project() {
    const aspect = this.size[0] / this.size[1];
    if (this.camera.isOrthographicCamera) {
      const half = this.named.height / 2;
      Object.assign(this.camera, { left: -half * aspect, right: half * aspect, top: half, bottom: -half });
    } else {
      // On a narrow screen the width counts: else a portrait window would see a slit.
      const half = Math.tan(THREE.MathUtils.degToRad(this.named?.fov ?? 60) / 2);
      this.camera.aspect = aspect;
      this.camera.fov = 2 * THREE.MathUtils.radToDeg(Math.atan(aspect < 1 ? Math.min(half / Math.sqrt(aspect), 1.4) : half));
    }
    this.camera.updateProjectionMatrix();
  }

  /** Looks through camera `number` of the scene. */
  look(number) {
    const named = this.page.cameras[number];
    this.named = named;
    const kind = named.height ? THREE.OrthographicCamera : THREE.PerspectiveCamera;
    if (!(this.camera instanceof kind)) {
      this.camera = named.height ? new THREE.OrthographicCamera() : new THREE.PerspectiveCamera();
      this.controls.object = this.camera;
    }
    const eye = new THREE.Vector3(...named.eye);
    const way = new THREE.Vector3(...named.target).sub(eye).normalize();
    this.camera.up.set(0, 1, 0);
    this.camera.near = Math.min(named.near, this.radius / 50);
    this.camera.far = Math.max(named.far, 4 * this.radius);
    this.camera.position.copy(eye);
    this.controls.target.copy(eye).addScaledVector(way, this.distance(eye, way));
    this.project();
    this.controls.update();
    this.aimSun();
    this.changed();
  }

  /** How far what is looked at is: what the camera turns about. */
  distance(eye, way) {
    // With the sides that the scene tells: what is drawn has both.
    for (const mesh of this.meshes) mesh.material = mesh.userData.solid;
    const ray = new THREE.Raycaster(eye, way, 0, 4 * this.radius);
    const hit = ray.intersectObjects(this.meshes, false)[0];
    return Math.min(Math.max(hit?.distance ?? this.radius / 2, this.radius / 200), 2 * this.radius);
  }

  /** Draws the scene; `material(mesh)` says with what. */
  draw(material, isLit) {
    for (const mesh of this.meshes) mesh.material = material(mesh);
    this.scene.environment = isLit ? this.environment : null;
    this.renderer.render(this.scene, this.camera);
  }
}
