// The scene, what lights it, and the camera.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { readFile } from "./folder.js";

const SKY = { top: 0x5c8fd6, horizon: 0xd5e1ee, ground: 0x6f675c };
const SUN = { azimuth: 140, elevation: 40 }; // the viewer's own

function skySphere() {
  const color = (hex) => ({ value: new THREE.Color(hex) });
  const material = new THREE.ShaderMaterial({
    side: THREE.BackSide,
    depthWrite: false,
    uniforms: { top: color(SKY.top), horizon: color(SKY.horizon), ground: color(SKY.ground) },
    vertexShader: "varying vec3 way; void main() { way = position; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
    fragmentShader: `varying vec3 way; uniform vec3 top; uniform vec3 horizon; uniform vec3 ground;
      void main() {
        float up = normalize(way).y;
        vec3 color = up > 0.0 ? mix(horizon, top, pow(up, 0.5)) : mix(horizon, ground, min(1.0, -up * 8.0));
        gl_FragColor = vec4(color, 1.0);
      }`,
  });
  return new THREE.Mesh(new THREE.SphereGeometry(10, 32, 16), material);
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
    const bytes = await readFile(this.page.scene);
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
        number, own, coverage: materials.coverage[number],
        decoder: primary ? this.page.textures[primary.texture].decoder : -1,
      });
      object.castShadow = object.receiveShadow = own.alpha_mode !== "blend";
      this.meshes.push(object);
    });
    this.scene.add(gltf.scene);
    this.scene.updateMatrixWorld(true);
    this.light();
  }

  light() {
    const generator = new THREE.PMREMGenerator(this.renderer);
    const dome = new THREE.Scene().add(skySphere());
    this.environment = generator.fromScene(dome, 0, 0.1, 100).texture;
    generator.dispose();
    this.sky = this.environment;
    const lights = this.page.lights.slice(0, 12).map(sceneLight);
    for (const light of lights) this.scene.add(light);
    const [turn, up] = [THREE.MathUtils.degToRad(SUN.azimuth), THREE.MathUtils.degToRad(SUN.elevation)];
    this.sunWay = new THREE.Vector3(Math.cos(up) * Math.sin(turn), Math.sin(up), -Math.cos(up) * Math.cos(turn));
    this.sun = new THREE.DirectionalLight(0xfff1dc, lights.length ? 1.2 : 3.2);
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
