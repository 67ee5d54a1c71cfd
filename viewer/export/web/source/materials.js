// The materials of the scene: for each view one that reads decoded textures and one that reads the originals.
import * as THREE from "three";
import { alphaTexture } from "./originals.js";
import { CHANNEL } from "./surfaces.js";

// The planes' components as the pack stores them: surface is normal.x, normal.y, roughness, metalness; emission is emissive, occlusion.
// A lit material has all of them, so that one program draws all: each program takes a software renderer 0.2 s. A plane is read once.
const SLOTS = { base: ["map"], surface: ["roughnessMap", "metalnessMap", "normalMap"], emission: ["emissiveMap", "aoMap"] };
const chunk = THREE.ShaderChunk;
const patch = (name, from, to) => {
  if (!chunk[name].includes(from)) throw new Error(`three.js has another ${name}`);
  chunk[name] = chunk[name].replace(from, to);
};
patch("roughnessmap_fragment", "texelRoughness.g", "texelRoughness.b");
patch("metalnessmap_fragment", "texture2D( metalnessMap, vMetalnessMapUv )", "texelRoughness");
patch("metalnessmap_fragment", "texelMetalness.b", "texelMetalness.a");
patch("normal_fragment_maps", "vec3 mapN = texture2D( normalMap, vNormalMapUv ).xyz", "vec3 mapN = texelRoughness.xyz");
patch(
  "normal_fragment_maps",
  "mapN.xy *= normalScale;",
  "mapN = vec3( mapN.xy, sqrt( saturate( 1.0 - dot( mapN.xy, mapN.xy ) ) ) );\n\tmapN.xy *= normalScale;",
);
patch("aomap_fragment", "texture2D( aoMap, vAoMapUv ).r", "emissiveColor.a");

function pixel(plane, texel) {
  const texture = new THREE.DataTexture(new Uint8Array(texel), 1, 1);
  texture.colorSpace = plane === "surface" ? THREE.NoColorSpace : THREE.SRGBColorSpace;
  texture.channel = CHANNEL[plane];
  texture.needsUpdate = true;
  return texture;
}

/** What stands for a plane that a material lacks, and for one of which nothing is decoded yet. */
const NEUTRAL = { base: pixel("base", [255, 255, 255, 255]), surface: pixel("surface", [128, 128, 255, 255]), emission: pixel("emission", [255, 255, 255, 255]) };
const WAITING = { ...NEUTRAL, base: pixel("base", [110, 112, 118, 255]), emission: pixel("emission", [0, 0, 0, 255]) };

/** What the views of maps show: the plane, and GLSL of the linear colour of a texel `t`. */
export const MAP_VIEWS = {
  base: { plane: "base", label: "Base colour", shown: null },
  normal: { plane: "surface", maps: ["normal"], label: "Normals", shown: "vec3(t.xy, 0.5 + 0.5 * sqrt(saturate(1.0 - dot(2.0 * t.xy - 1.0, 2.0 * t.xy - 1.0))))" },
  orm: { plane: "surface", maps: ["roughness", "metalness"], label: "Roughness, metalness", shown: "vec3(0.0, t.b, t.a)" },
  emissive: { plane: "emission", maps: ["emissive"], label: "Emission", shown: "t.rgb" },
};

function alphaOptions(material) {
  if (material.alpha_mode === "mask") return { alphaTest: material.alpha_cutoff };
  return material.alpha_mode === "blend" ? { transparent: true, depthWrite: false } : {};
}

/** Lets one program draw single-sided and double-sided materials: what is culled is not for a program to know. */
export function cullSingleSided(renderer) {
  const { state } = renderer;
  const { setMaterial } = state;
  state.setMaterial = (material, clockwise) => {
    setMaterial(material, clockwise);
    if (material.userData.isSingleSided) state.enable(renderer.getContext().CULL_FACE);
  };
}

export class Materials {
  constructor(page, surfaces) {
    this.page = page;
    this.surfaces = surfaces;
    this.made = new Map();
    this.alphas = new Map();
  }

  /** The planes of material `number` as entries of Surfaces. */
  planes(number) {
    const { planes } = this.page.materials[number];
    return Object.fromEntries(Object.entries(planes).map(([plane, place]) => [plane, this.surfaces.entry(plane, place)]));
  }

  alpha(number) {
    const { planes, alpha_mode: mode } = this.page.materials[number];
    const entry = planes.base && this.page.textures[planes.base.texture].alpha;
    if (!entry || mode === "opaque") return null;
    const key = `${entry.file} ${planes.base.wrap}`;
    const modes = [THREE.RepeatWrapping, THREE.MirroredRepeatWrapping, THREE.ClampToEdgeWrapping];
    if (!this.alphas.has(key)) this.alphas.set(key, alphaTexture(entry, modes[planes.base.wrap[0]], modes[planes.base.wrap[1]]));
    return this.alphas.get(key);
  }

  /** Coverage of all materials: before the first picture. */
  async prepare() {
    this.coverage = await Promise.all(this.page.materials.map((_, number) => this.alpha(number)));
  }

  get(number, geometry, view, original) {
    const { attributes } = geometry;
    const key = [number, view, original, !!attributes.color, !!attributes.tangent, !!attributes.normal].join();
    if (!this.made.has(key)) {
      const made = view === "lit" ? this.lit(number, attributes, original) : this.map(number, attributes, view, original);
      made.side = THREE.DoubleSide;
      if (!this.page.materials[number].double_sided) {
        // Only its front is drawn, and only its back casts shadows.
        Object.assign(made, { forceSinglePass: true, shadowSide: THREE.BackSide });
        made.userData.isSingleSided = true;
      }
      this.made.set(key, made);
    }
    return this.made.get(key);
  }

  /** Keeps `slots` of `material` at what Surfaces has. */
  follow(material, entry, slots, original, waiting = WAITING[entry.plane]) {
    const update = () => {
      const texture = this.surfaces.texture(entry, original) ?? waiting;
      for (const slot of slots) material[slot] = texture;
    };
    entry.users.push(update);
    update();
  }

  lit(number, attributes, original) {
    const own = this.page.materials[number];
    const [red, green, blue, alpha] = own.factor;
    const common = {
      color: new THREE.Color(red, green, blue), opacity: alpha, vertexColors: true,
      alphaMap: this.coverage[number], ...alphaOptions(own),
    };
    const entries = this.planes(number);
    // A mesh without colours is white, by the same program.
    const plain = { defaultAttributeValues: { color: [1, 1, 1] } };
    if (own.unlit) {
      const made = Object.assign(new THREE.MeshBasicMaterial(common), plain);
      if (entries.base) this.follow(made, entries.base, ["map"], original);
      return made;
    }
    const made = new THREE.MeshStandardMaterial({
      ...common, roughness: own.roughness, metalness: own.metalness, emissive: new THREE.Color(...own.emissive),
      aoMapIntensity: own.occlusion_strength, flatShading: !attributes.normal,
    });
    Object.assign(made, plain);
    // Without tangents three takes them from screen space, where v runs the other way.
    const scale = own.planes.surface?.maps.includes("normal") ? own.normal_scale : 0;
    made.normalScale.set(scale, attributes.tangent ? scale : -scale);
    for (const [plane, slots] of Object.entries(SLOTS)) {
      if (!entries[plane]) for (const slot of slots) made[slot] = NEUTRAL[plane];
      else {
        const isColor = plane !== "emission" || own.planes.emission.maps.includes("emissive");
        this.follow(made, entries[plane], slots, original, isColor ? undefined : NEUTRAL.emission);
      }
    }
    return made;
  }

  map(number, attributes, view, original) {
    const own = this.page.materials[number];
    const { plane, maps, shown } = MAP_VIEWS[view];
    const made = new THREE.MeshBasicMaterial({ alphaMap: this.coverage[number], toneMapped: false, ...alphaOptions(own) });
    const entry = this.planes(number)[plane];
    const isThere = entry && (!maps || maps.some((name) => own.planes[plane].maps.includes(name)));
    if (view === "base") {
      made.color.setRGB(...own.factor.slice(0, 3));
      made.opacity = own.factor[3];
      made.vertexColors = !!attributes.color;
    }
    if (isThere) this.follow(made, entry, ["map"], original);
    else if (view !== "base") made.color.setRGB(0.02, 0.02, 0.025);
    if (isThere && shown) {
      // Numbers, not colours: shown as they are, so the picture's encoding is undone first.
      const numbers = view === "emissive" ? shown : `pow(${shown}, vec3(2.2))`;
      made.onBeforeCompile = (shader) => {
        shader.fragmentShader = shader.fragmentShader.replace(
          "#include <map_fragment>",
          `{ vec4 t = texture2D(map, vMapUv); diffuseColor.rgb = ${numbers}; }`,
        );
      };
      made.customProgramCacheKey = () => view;
    }
    return made;
  }
}
