// The materials of the scene: for each view one that reads decoded textures and one that reads the originals.
import * as THREE from "three";
import { alphaTexture } from "./originals.js";

// The planes' components as the pack stores them: surface is normal.x, normal.y, roughness, metalness; emission is emissive, occlusion.
const chunk = THREE.ShaderChunk;
chunk.normal_fragment_maps = chunk.normal_fragment_maps.replace(
  "mapN.xy *= normalScale;",
  "mapN = vec3( mapN.xy, sqrt( saturate( 1.0 - dot( mapN.xy, mapN.xy ) ) ) );\n\tmapN.xy *= normalScale;",
);
chunk.roughnessmap_fragment = chunk.roughnessmap_fragment.replace("texelRoughness.g", "texelRoughness.b");
chunk.metalnessmap_fragment = chunk.metalnessmap_fragment.replace("texelMetalness.b", "texelMetalness.a");
chunk.aomap_fragment = chunk.aomap_fragment.replace("texture2D( aoMap, vAoMapUv ).r", "texture2D( aoMap, vAoMapUv ).a");

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
      made.side = this.page.materials[number].double_sided ? THREE.DoubleSide : THREE.FrontSide;
      this.made.set(key, made);
    }
    return this.made.get(key);
  }

  /** Keeps `slots` of `material` at what Surfaces has. */
  follow(material, entry, slots, original) {
    const update = () => {
      const texture = this.surfaces.texture(entry, original);
      for (const slot of slots) material[slot] = texture;
    };
    entry.users.push(update);
    update();
  }

  lit(number, attributes, original) {
    const own = this.page.materials[number];
    const [red, green, blue, alpha] = own.factor;
    const common = {
      color: new THREE.Color(red, green, blue), opacity: alpha, vertexColors: !!attributes.color,
      alphaMap: this.coverage[number], ...alphaOptions(own),
    };
    const entries = this.planes(number);
    if (own.unlit) {
      const made = new THREE.MeshBasicMaterial(common);
      if (entries.base) this.follow(made, entries.base, ["map"], original);
      return made;
    }
    const made = new THREE.MeshStandardMaterial({
      ...common, roughness: own.roughness, metalness: own.metalness, emissive: new THREE.Color(...own.emissive),
      aoMapIntensity: own.occlusion_strength, flatShading: !attributes.normal,
    });
    // Without tangents three takes them from screen space, where v runs the other way.
    made.normalScale.set(own.normal_scale, attributes.tangent ? own.normal_scale : -own.normal_scale);
    const slots = { base: ["map"], roughness: ["roughnessMap"], metalness: ["metalnessMap"], normal: ["normalMap"], emissive: ["emissiveMap"], occlusion: ["aoMap"] };
    for (const [plane, entry] of Object.entries(entries)) {
      this.follow(made, entry, own.planes[plane].maps.flatMap((name) => slots[name]), original);
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
