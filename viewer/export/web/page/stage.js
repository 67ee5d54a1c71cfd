// The scene, its camera, and the materials of each source of textures.
import * as THREE from "three";
import { NTCTextures } from "ntc-three";
import { Light } from "./light.js";

const MOST_LIGHTS = 12;
/** Views by name; `slot` is the texture of a material that a view shows. */
export const VIEWS = {
  lit: { label: "Lit" },
  base: { label: "Base colour", slot: "map" },
  normal: { label: "Normals", slot: "normalMap" },
  orm: { label: "Roughness, metalness", slot: "roughnessMap" },
  emissive: { label: "Emission", slot: "emissiveMap" },
};

function pixel(texel) {
  const texture = new THREE.DataTexture(new Uint8Array(texel), 1, 1);
  texture.needsUpdate = true;
  return texture;
}

const WHITE = pixel([255, 255, 255, 255]);
const FLAT = pixel([128, 128, 255, 255]);
const SLOTS = ["map", "roughnessMap", "metalnessMap", "aoMap", "emissiveMap"];

/** Fills the empty texture slots of a material, so that one program draws most materials. Compiling another takes longer than reading a white texel. */
function unify(material) {
  if (!material.isMeshStandardMaterial) return;
  for (const slot of SLOTS) material[slot] ??= WHITE;
  material.normalMap ??= FLAT;
}

/** Error whose message is enough for the user, in one line. */
export class PageError extends Error {}

async function answer(name) {
  const response = await fetch(name);
  if (!response.ok) throw new PageError(`${name}: the server answers ${response.status}; copy the whole folder`);
  return response;
}

export async function readJson(name) {
  const response = await answer(name);
  try {
    return await response.json();
  } catch {
    throw new PageError(`${name}: is damaged; export the page again`);
  }
}

/** Source of textures, a pack or the original images, and the materials of all meshes with these textures. */
class Source {
  constructor(description) {
    this.description = description;
    this.materials = new Map(); // mesh -> material
    this.views = new Map(); // view and material -> material
  }

  get isReady() {
    return this.materials.size > 0 && this.plugin.hasCoarse;
  }

  /** Returns the material of a mesh in a view; all views but "lit" show a texture without shading. */
  material(mesh, view) {
    const lit = this.materials.get(mesh);
    if (view === "lit") return lit;
    const key = `${view} ${lit.uuid}`;
    if (!this.views.has(key)) this.views.set(key, this.flat(lit, VIEWS[view].slot));
    return this.views.get(key);
  }

  flat(lit, slot) {
    const map = lit[slot] ?? WHITE;
    const { side, alphaTest, transparent, depthWrite } = lit;
    const made = new THREE.MeshBasicMaterial({ map, side, transparent, depthWrite, toneMapped: false });
    if (slot === "map") {
      const { color, opacity, vertexColors } = lit;
      made.setValues({ color, opacity, vertexColors, alphaTest });
    } else if (map === WHITE || map === FLAT) made.color.setRGB(0.02, 0.02, 0.025);
    else if (slot === "emissiveMap") made.color.copy(lit.emissive).multiplyScalar(lit.emissiveIntensity);
    else {
      // These textures store numbers, not colours. Decoding sRGB here cancels the encoding of the picture.
      made.onBeforeCompile = (shader) => {
        const shown = "diffuseColor.rgb = sRGBTransferEOTF(texture2D(map, vMapUv)).rgb;";
        shader.fragmentShader = shader.fragmentShader.replace("#include <map_fragment>", shown);
      };
    }
    return made;
  }

  /** Returns the textures of a mesh that a view reads. */
  textures(mesh, view) {
    const lit = this.materials.get(mesh);
    const all = view === "lit" ? Object.values(lit) : [lit[VIEWS[view].slot]];
    return all.filter((value) => value?.isTexture);
  }
}

export class Stage {
  /** `memory` is shared by all textures. `changed` is called when the picture is out of date, `failed` with an error of a source. */
  constructor(canvas, page, memory, changed, failed) {
    Object.assign(this, { page, memory, changed, failed });
    this.sources = page.sources.map((description) => new Source(description));
    this.scene = new THREE.Scene();
    this.meshes = [];
    this.camera = new THREE.PerspectiveCamera();
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => changed(true));
    this.controls.listenToKeyEvents(canvas);
    const [low, high] = page.bounds.map((corner) => new THREE.Vector3(...corner));
    this.radius = Math.max(low.distanceTo(high) / 2, 1e-6);
    this.size = [1, 1];
  }

  /** Starts reading the scene with the textures of source 0. */
  read() {
    this.sky = answer("sky.bin").then((response) => response.arrayBuffer());
    this.reading = readJson(this.page.scene).then((json) => this.parse(this.sources[0], (this.json = json)));
    for (const promise of [this.sky, this.reading]) promise.catch(() => {});
  }

  /** Completes the scene that `read` has started reading. */
  async load(renderer) {
    this.renderer = renderer;
    this.light = new Light(renderer, this.page, await this.sky, this.radius);
    this.scene.add(this.light.sun, this.light.sun.target);
    this.warm();
    const { scene, parser } = await this.reading.catch((error) => {
      if (error instanceof PageError) throw error;
      throw new PageError(`${this.page.scene}: is damaged (${error.message}); export the page again`);
    });
    scene.traverse((object) => {
      if (object.isLight) this.lights = (this.lights ?? 0) + 1;
      object.visible = !object.isLight || this.lights <= MOST_LIGHTS;
      if (!object.isMesh) return;
      const { meshes, primitives } = parser.associations.get(object);
      // A mesh without a material gets the number after the last one: no source has a decoder for it.
      object.userData.number = this.json.meshes[meshes].primitives[primitives ?? 0].material ?? this.page.materials;
      object.castShadow = object.receiveShadow = !object.material.transparent;
      this.meshes.push(object);
      unify(object.material);
      this.sources[0].materials.set(object, object.material);
    });
    this.scene.add(scene);
    this.scene.updateMatrixWorld(true);
  }

  /** Compiles the program of most materials while the scene is read. */
  warm() {
    const mesh = new THREE.Mesh(new THREE.PlaneGeometry(), new THREE.MeshStandardMaterial());
    mesh.castShadow = mesh.receiveShadow = true;
    mesh.position.z = -1;
    unify(mesh.material);
    this.scene.add(mesh);
    this.renderer.shadowMap.needsUpdate = true;
    this.show("lit");
    this.scene.remove(mesh);
  }

  /** Parses the glTF file with the textures of a source. */
  parse(source, json) {
    const options = {
      format: "rgba8", onDemand: true, memory: this.memory,
      pack: source.description.pack, onUpdate: () => this.changed(false), onError: this.failed,
    };
    const loader = new THREE.GLTFLoader().register((parser) => (source.plugin = new NTCTextures(parser, options)));
    return loader.parseAsync(structuredClone(json), "");
  }

  /** Makes the materials of a source when it is first shown. */
  prepare(source) {
    source.preparing ??= (async () => {
      const { scenes, animations, cameras, skins, ...materials } = this.json;
      const { parser } = await this.parse(source, materials);
      const lit = await Promise.all((this.json.materials ?? []).map((_, number) => parser.getDependency("material", number)));
      for (const mesh of this.meshes) {
        const before = mesh.material;
        mesh.material = lit[mesh.userData.number] ?? this.sources[0].materials.get(mesh);
        if (lit[mesh.userData.number]) parser.assignFinalMaterial(mesh);
        unify(mesh.material);
        source.materials.set(mesh, mesh.material);
        mesh.material = before;
      }
      this.changed(true);
    })();
    return source.preparing;
  }

  resize(width, height) {
    this.size = [width, height];
    this.project();
  }

  project() {
    const { camera, named } = this;
    const aspect = this.size[0] / this.size[1];
    if (camera.isOrthographicCamera) {
      const half = named.height / 2;
      Object.assign(camera, { left: -half * aspect, right: half * aspect, top: half, bottom: -half });
    } else if (named) {
      // On a narrow screen the field of view grows, because a portrait window would show only a slit.
      const half = Math.tan(THREE.MathUtils.degToRad(named.fov) / 2);
      camera.aspect = aspect;
      camera.fov = 2 * THREE.MathUtils.radToDeg(Math.atan(aspect < 1 ? Math.min(half / Math.sqrt(aspect), 1.4) : half));
    }
    camera.updateProjectionMatrix();
  }

  /** Looks through camera `number` of the scene. */
  look(number) {
    const named = (this.named = this.page.cameras[number]);
    if (Boolean(named.height) !== Boolean(this.camera.isOrthographicCamera)) {
      this.camera = named.height ? new THREE.OrthographicCamera() : new THREE.PerspectiveCamera();
      this.controls.object = this.camera;
    }
    const eye = new THREE.Vector3(...named.eye);
    const way = new THREE.Vector3(...named.target).sub(eye).normalize();
    this.camera.near = Math.min(named.near, this.radius / 50);
    this.camera.far = Math.max(named.far, 4 * this.radius);
    this.camera.position.copy(eye);
    const hit = new THREE.Raycaster(eye, way, 0, 4 * this.radius).intersectObjects(this.meshes, false)[0];
    const distance = Math.min(Math.max(hit?.distance ?? this.radius / 2, this.radius / 200), 2 * this.radius);
    this.controls.target.copy(eye).addScaledVector(way, distance);
    this.project();
    this.controls.update();
    this.light.aim(this.controls.target, distance);
    this.changed(true);
  }

  /** Draws the scene with the textures of a source. */
  draw(source, view) {
    for (const mesh of this.meshes) mesh.material = source.material(mesh, view);
    this.show(view);
  }

  show(view) {
    const isLit = view === "lit";
    this.scene.background = this.scene.environment = isLit ? this.light.sky : null;
    this.renderer.toneMapping = isLit ? THREE.NeutralToneMapping : THREE.NoToneMapping;
    this.renderer.render(this.scene, this.camera);
  }
}
