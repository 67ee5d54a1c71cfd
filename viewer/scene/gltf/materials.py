"""Materials as the file states them: factors, and where the texture of each map comes from and how it is sampled."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ntc.codec.maps import MAPS, MapName
from ntc.errors import InputError
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.textures import Affine, TextureReference, UvTransform, after_inverse, category_of, read_reference
from viewer.scene.model import DEFAULT_FACTORS, AlphaMode, Material, SurfaceFactors
from viewer.scene.report import ReportNotes

NORMAL_REFLECTANCE = 0.04
"""Reflectance at normal incidence of a dielectric of index 1.5, which KHR_materials_pbrSpecularGlossiness has none of its own for."""
LARGEST = 1e6
"""Strengths and indices above it are taken to be it."""

_LEFT_OUT = {
    "KHR_materials_specular": ("specularTexture", "specularColorTexture"),
    "KHR_materials_clearcoat": ("clearcoatTexture", "clearcoatRoughnessTexture", "clearcoatNormalTexture"),
    "KHR_materials_transmission": ("transmissionTexture",),
}
"""Textures of extensions whose factors are read."""


class _Factors:
    """Numbers of one material, held within what the specification allows them."""

    def __init__(self, file: GltfFile, entry: dict[str, Any], where: str, notes: ReportNotes) -> None:
        self._file = file
        self._entry = entry
        self._where = where
        self._notes = notes

    def extension(self, name: str) -> tuple[dict[str, Any], str]:
        """Return (the extension `name`, or an empty object; the field it stands in)."""
        found = self._file.extension(self._entry, name, self._where)
        if found is not None:
            self._notes.honoured(f"{name}: materials")
            for key in _LEFT_OUT.get(name, ()):
                self._notes.ignored(f"{name}: {key}", int(key in found))
        return found or {}, f"{self._where}.{name}"

    def number(
        self, owner: dict[str, Any], key: str, where: str, default: float, low: float = 0.0, high: float = 1.0
    ) -> float:
        """Return `owner[key]`, at least `low` and at most `high`."""
        return self._within(self._file.number(owner, key, where, default), low, high)

    def color(
        self, owner: dict[str, Any], key: str, where: str, default: float, high: float
    ) -> tuple[float, float, float]:
        """Linear RGB `owner[key]`, each from 0 to `high`."""
        red, green, blue = self._file.numbers(owner, key, where, (default, default, default))
        return self._within(red, 0.0, high), self._within(green, 0.0, high), self._within(blue, 0.0, high)

    def _within(self, value: float, low: float, high: float) -> float:
        held = min(max(value, low), high)
        self._notes.note("factors out of range, brought into it", int(held != value))
        return held


def read_factors(file: GltfFile, entry: dict[str, Any], where: str, notes: ReportNotes) -> SurfaceFactors:
    """Return those of the material `entry` (glTF 2.0, Sec. 3.9, and the KHR_materials extensions). Raises InputError.

    Of specular-glossiness materials metalness is 0, the specular colour that of the reflection at normal incidence, and
    roughness 1 - glossiness; where a texture gives both, it is not read, and roughness is 1.
    """
    factors = _Factors(file, entry, where, notes)
    pbr, pbr_name = file.object(entry, "pbrMetallicRoughness", where), f"{where}.pbrMetallicRoughness"
    normal, occlusion = file.object(entry, "normalTexture", where), file.object(entry, "occlusionTexture", where)
    strength, name = factors.extension("KHR_materials_emissive_strength")
    glow = factors.number(strength, "emissiveStrength", name, 1.0, high=LARGEST)
    red, green, blue = factors.color(entry, "emissiveFactor", where, 0.0, 1.0)
    ior, name = factors.extension("KHR_materials_ior")
    index = factors.number(ior, "ior", name, 1.5, high=LARGEST)
    specular, name = factors.extension("KHR_materials_specular")
    reflection = factors.number(specular, "specularFactor", name, 1.0)
    reflection_color = factors.color(specular, "specularColorFactor", name, 1.0, LARGEST)
    clearcoat, clearcoat_name = factors.extension("KHR_materials_clearcoat")
    transmission, transmission_name = factors.extension("KHR_materials_transmission")
    roughness = factors.number(pbr, "roughnessFactor", pbr_name, 1.0)
    metalness = factors.number(pbr, "metallicFactor", pbr_name, 1.0)
    if "KHR_materials_pbrSpecularGlossiness" in file.object(entry, "extensions", where):
        name = f"{where}.KHR_materials_pbrSpecularGlossiness"
        glossy = file.extension(entry, "KHR_materials_pbrSpecularGlossiness", where) or {}
        roughness, metalness = 1.0, 0.0
        if "specularGlossinessTexture" in glossy:
            notes.ignored("specular-glossiness textures")
        else:
            roughness = 1.0 - factors.number(glossy, "glossinessFactor", name, 1.0)
            at_normal = factors.color(glossy, "specularFactor", name, 1.0, 1.0)
            red_share, green_share, blue_share = (value / NORMAL_REFLECTANCE for value in at_normal)
            reflection_color = (red_share, green_share, blue_share)
    notes.note(
        "what is seen through transmissive materials is not drawn: materials",
        int(transmission.get("transmissionFactor", 0) != 0),
    )
    return SurfaceFactors(
        roughness=roughness,
        metalness=metalness,
        normal_scale=factors.number(normal, "scale", f"{where}.normalTexture", 1.0, -LARGEST, LARGEST),
        occlusion_strength=factors.number(occlusion, "strength", f"{where}.occlusionTexture", 1.0),
        emissive=(red * glow, green * glow, blue * glow),
        ior=index if index == 0.0 else max(1.0, index),
        specular=reflection,
        specular_color=reflection_color,
        clearcoat=factors.number(clearcoat, "clearcoatFactor", clearcoat_name, 0.0),
        clearcoat_roughness=factors.number(clearcoat, "clearcoatRoughnessFactor", clearcoat_name, 0.0),
        transmission=factors.number(transmission, "transmissionFactor", transmission_name, 0.0),
    )


ALPHA_MODES: dict[str, AlphaMode] = {"OPAQUE": "opaque", "MASK": "mask", "BLEND": "blend"}


@dataclass(frozen=True)
class UvSource:
    """UVs as vertices hold them: a set of the file, and what was applied to it."""

    uv_set: int = 0
    transform: UvTransform | None = None


@dataclass(frozen=True)
class MaterialSource:
    """A material before its images are read."""

    material: Material
    """Complete but for the textures: `texture_id` is -1, there are no planes, and factors are the file's."""
    maps: Mapping[MapName, TextureReference] = field(default_factory=dict)
    """References of the maps that have an effect, in the order of MAPS."""
    category: str | None = None
    """Category from extras of the material."""

    @property
    def reads_alpha(self) -> bool:
        """True if the material uses the alpha of its base colour."""
        return self.material.alpha_mode != "opaque"

    @property
    def uvs(self) -> UvSource:
        """UVs that `Geometry.uvs` holds: those of the first map, which is the base colour where there is one."""
        for reference in self.maps.values():
            return UvSource(reference.uv_set, reference.uv_transform)
        return UvSource()

    @property
    def second_uv_set(self) -> int | None:
        """UV set that `Geometry.second_uvs` holds, as it is in the file; None when no map needs it."""
        for reference in self.maps.values():
            if self._from_uvs(reference) is None:
                return reference.uv_set
        return None

    def _from_uvs(self, reference: TextureReference) -> Affine | None:
        uvs = self.uvs
        return after_inverse(uvs.transform, reference.uv_transform) if reference.uv_set == uvs.uv_set else None

    def placement(self, reference: TextureReference) -> tuple[bool, Affine] | None:
        """Return (whether from the second UVs, what takes the vertex's UVs to those of `reference`); None for UVs that no vertex
        holds."""
        from_uvs = self._from_uvs(reference)
        if from_uvs is not None:
            return False, from_uvs
        if reference.uv_set != self.second_uv_set:
            return None
        from_second = after_inverse(None, reference.uv_transform)
        return None if from_second is None else (True, from_second)


DEFAULT_MATERIAL = MaterialSource(Material("default", -1, (1.0, 1.0, 1.0, 1.0)))
"""Material that glTF prescribes for primitives without one."""


def _references(
    file: GltfFile, entry: dict[str, Any], material: Material, where: str, notes: ReportNotes
) -> dict[MapName, TextureReference]:
    """Textures of the maps that the material's factors leave an effect. Raises InputError."""
    pbr = file.object(entry, "pbrMetallicRoughness", where)
    glossiness = file.extension(entry, "KHR_materials_pbrSpecularGlossiness", where)
    factors = material.factors
    found: dict[MapName, TextureReference | None] = {}
    if glossiness is not None:
        name = f"{where}.KHR_materials_pbrSpecularGlossiness"
        found["base"] = read_reference(file, glossiness, "diffuseTexture", name, notes)
    else:
        name = f"{where}.pbrMetallicRoughness"
        found["base"] = read_reference(file, pbr, "baseColorTexture", name, notes)
    if material.unlit:
        return {"base": found["base"]} if found["base"] is not None else {}
    found["normal"] = read_reference(file, entry, "normalTexture", where, notes)
    if glossiness is None:
        both = read_reference(file, pbr, "metallicRoughnessTexture", name, notes)
        found["roughness"] = found["metalness"] = both
    found["emissive"] = read_reference(file, entry, "emissiveTexture", where, notes)
    found["occlusion"] = read_reference(file, entry, "occlusionTexture", where, notes)
    without_effect = {
        "normal": factors.normal_scale == 0.0,
        "roughness": factors.roughness == 0.0,
        "metalness": factors.metalness == 0.0,
        "emissive": factors.emissive == (0.0, 0.0, 0.0),
        "occlusion": factors.occlusion_strength == 0.0,
    }
    kept: dict[MapName, TextureReference] = {}
    for key in MAPS:
        reference = found.get(key)
        if reference is None:
            continue
        if without_effect.get(key, False):
            notes.note(f"{key} maps whose factor is 0 are left out: materials")
            continue
        kept[key] = reference
    return kept


def _material(file: GltfFile, index: int, notes: ReportNotes) -> MaterialSource:
    entry = file.entries("materials")[index]
    where = f"materials[{index}]"
    pbr = file.object(entry, "pbrMetallicRoughness", where)
    glossiness = file.extension(entry, "KHR_materials_pbrSpecularGlossiness", where)
    if glossiness is not None:
        notes.honoured("KHR_materials_pbrSpecularGlossiness: diffuse as base colour")
        owner, factor_key, owner_name = glossiness, "diffuseFactor", f"{where}.KHR_materials_pbrSpecularGlossiness"
    else:
        owner, factor_key, owner_name = pbr, "baseColorFactor", f"{where}.pbrMetallicRoughness"
    unlit = file.extension(entry, "KHR_materials_unlit", where) is not None
    notes.honoured("KHR_materials_unlit: materials", int(unlit))
    mode = file.text(entry, "alphaMode", where, "OPAQUE")
    if mode not in ALPHA_MODES:
        raise file.fail(f"{where}.alphaMode", f"{mode!r:.20} is none of OPAQUE, MASK and BLEND")
    if mode != "OPAQUE":
        notes.honoured(f"alphaMode {mode}: materials")
    if mode == "BLEND":
        notes.note("BLEND is drawn alpha-hashed, at rest as the mean of 16 samples: materials")
    double_sided = entry.get("doubleSided") is True
    notes.honoured("doubleSided: materials", int(double_sided))
    red, green, blue, alpha = file.numbers(owner, factor_key, owner_name, (1.0, 1.0, 1.0, 1.0))
    material = Material(
        name=file.label(entry, f"material {index}"),
        texture_id=-1,
        factor=(red, green, blue, alpha),
        alpha_mode=ALPHA_MODES[mode],
        alpha_cutoff=file.number(entry, "alphaCutoff", where, 0.5),
        double_sided=double_sided,
        unlit=unlit,
        # Light has no effect on it: what else the file says of its surface is not read.
        factors=DEFAULT_FACTORS if unlit else read_factors(file, entry, where, notes),
    )
    maps = _references(file, entry, material, where, notes)
    if "base" in maps:
        material = replace(material, sampler=maps["base"].sampler)
    return MaterialSource(material, maps, category_of(file, entry))


def read_materials(file: GltfFile, notes: ReportNotes) -> tuple[MaterialSource, ...]:
    """Return all materials of the file, and at the end the one for primitives that name none. Raises InputError."""
    count = len(file.entries("materials"))
    return (*(_material(file, index, notes) for index in range(count)), DEFAULT_MATERIAL)


EXTENSION = "KHR_materials_variants"
MOST_NAMED = 6
"""Variants that one message names."""


def variant_names(file: GltfFile) -> tuple[str, ...]:
    """Return the names of the file's variants, in its order; a number stands for a variant without a name of its own.
    Raises InputError."""
    extension = file.extension(file.json, EXTENSION, "file") or {}
    where = f"extensions.{EXTENSION}"
    names: list[str] = []
    for number, entry in enumerate(file.array(extension, "variants", where)):
        if not isinstance(entry, dict):
            raise file.fail(f"{where}.variants[{number}]", "must be an object")
        name = file.label(entry, f"variant {number}")
        names.append(name if name not in names else f"variant {number}")
    return tuple(names)


def chosen_variant(names: tuple[str, ...], wanted: str, scene: str) -> int | None:
    """Return the number of the variant called `wanted`; None for "", the materials that primitives name themselves.
    Raises InputError."""
    if not wanted:
        return None
    if wanted not in names:
        known = ", ".join(names[:MOST_NAMED]) + (f" and {len(names) - MOST_NAMED} more" * (len(names) > MOST_NAMED))
        there = f"there are {known}" if names else "the scene has no variants"
        raise InputError(f"{scene}: no variant {wanted!r}; {there}")
    return names.index(wanted)


def variant_materials(file: GltfFile, primitive: Mapping[str, Any], variants: int, where: str) -> dict[int, int]:
    """Material by number of variant, for those of the `variants` of the file that a primitive names. Raises InputError."""
    extension = file.extension(primitive, EXTENSION, where)
    if extension is None:
        return {}
    where = f"{where}.{EXTENSION}.mappings"
    materials: dict[int, int] = {}
    for number, mapping in enumerate(file.array(extension, "mappings", where)):
        field = f"{where}[{number}]"
        if not isinstance(mapping, dict):
            raise file.fail(field, "must be an object")
        material = file.index(mapping.get("material"), len(file.entries("materials")), f"{field}.material")
        for variant in file.array(mapping, "variants", field):
            materials.setdefault(file.index(variant, variants, f"{field}.variants"), material)
    return materials
