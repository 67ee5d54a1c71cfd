"""Materials as the file states them: factors, and for each map its texture and sampling."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeVar

from msgspec import UNSET, UnsetType

from ntc.codec.maps import MAPS, MapName
from ntc.errors import InputError
from viewer.scene.gltf import schema
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.textures import Affine, TextureReference, UvTransform, after_inverse, category_of, read_reference
from viewer.scene.model import DEFAULT_FACTORS, AlphaMode, Material, Sampler, SurfaceFactors
from viewer.scene.report import ReportNotes

_Schema = TypeVar("_Schema")
GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
NORMAL_REFLECTANCE = 0.04
"""Reflectance at normal incidence of a dielectric with index of refraction 1.5. KHR_materials_pbrSpecularGlossiness states the
reflectance instead of an index, so it is divided by this."""
LARGEST = 1e6
"""Largest strength and index of refraction: larger ones are clamped."""

_LEFT_OUT = {
    "KHR_materials_specular": ("specularTexture", "specularColorTexture"),
    "KHR_materials_clearcoat": ("clearcoatTexture", "clearcoatRoughnessTexture", "clearcoatNormalTexture"),
    "KHR_materials_transmission": ("transmissionTexture",),
}
"""Textures of extensions whose factors are read."""


class _Factors:
    """Reader of one material's numbers, which clamps them to the ranges of the specification."""

    def __init__(self, file: GltfFile, entry: schema.LitMaterial, where: str, notes: ReportNotes) -> None:
        self._file, self._entry, self._where, self._notes = file, entry, where, notes

    def extension(self, name: str, kind: type[_Schema]) -> _Schema:
        """Return the extension `name` of the material, or its default values."""
        content = self._file.extension(self._entry, name, kind, self._where)
        if content is None:
            return kind()
        self._notes.honoured(f"{name}: materials")
        for key in _LEFT_OUT.get(name, ()):
            self._notes.ignored(f"{name}: {key}", int(key in self._entry.extensions[name]))
        return content

    def number(self, value: float, low: float = 0.0, high: float = 1.0) -> float:
        """Return `value` clamped to `low` to `high`. A change is noted in the load report."""
        clamped = min(max(value, low), high)
        self._notes.note("factors out of range, brought into it", int(clamped != value))
        return clamped

    def color(self, values: schema.Triple, high: float) -> schema.Triple:
        """Return linear RGB `values`, each from 0 to `high`."""
        red, green, blue = (self.number(value, high=high) for value in values)
        return red, green, blue


def read_factors(
    file: GltfFile,
    entry: schema.LitMaterial,
    glossy: schema.SpecularGlossiness | None,
    where: str,
    notes: ReportNotes,
) -> SurfaceFactors:
    """Return the factors of the material `entry` (glTF 2.0, Sec. 3.9, and the KHR_materials extensions). Raises InputError.

    A specular-glossiness material becomes one of metalness 0 and roughness 1 - glossiness, whose specular colour gives the
    reflectance at normal incidence. Its specular-glossiness texture is not read; with one, roughness is 1.
    """
    factors = _Factors(file, entry, where, notes)
    strength = factors.extension("KHR_materials_emissive_strength", schema.EmissiveStrength)
    glow = factors.number(strength.emissive_strength, high=LARGEST)
    red, green, blue = factors.color(entry.emissive_factor, 1.0)
    index = factors.number(factors.extension("KHR_materials_ior", schema.Ior).ior, high=LARGEST)
    specular = factors.extension("KHR_materials_specular", schema.Specular)
    reflection = factors.number(specular.specular_factor)
    reflection_color = factors.color(specular.specular_color_factor, LARGEST)
    clearcoat = factors.extension("KHR_materials_clearcoat", schema.Clearcoat)
    transmission = factors.extension("KHR_materials_transmission", schema.Transmission)
    roughness = factors.number(entry.pbr_metallic_roughness.roughness_factor)
    metalness = factors.number(entry.pbr_metallic_roughness.metallic_factor)
    if glossy is not None:
        roughness, metalness = 1.0, 0.0
        if glossy.specular_glossiness_texture is not UNSET:
            notes.ignored("specular-glossiness textures")
        else:
            roughness = 1.0 - factors.number(glossy.glossiness_factor)
            at_normal = factors.color(glossy.specular_factor, 1.0)
            red_share, green_share, blue_share = (value / NORMAL_REFLECTANCE for value in at_normal)
            reflection_color = (red_share, green_share, blue_share)
    notes.note(
        "what is seen through transmissive materials is not drawn: materials",
        int(transmission.transmission_factor != 0),
    )
    normal, occlusion = entry.normal_texture, entry.occlusion_texture
    return SurfaceFactors(
        roughness=roughness,
        metalness=metalness,
        normal_scale=1.0 if isinstance(normal, UnsetType) else factors.number(normal.scale, -LARGEST, LARGEST),
        occlusion_strength=1.0 if isinstance(occlusion, UnsetType) else factors.number(occlusion.strength),
        emissive=(red * glow, green * glow, blue * glow),
        ior=index if index == 0.0 else max(1.0, index),
        specular=reflection,
        specular_color=reflection_color,
        clearcoat=factors.number(clearcoat.clearcoat_factor),
        clearcoat_roughness=factors.number(clearcoat.clearcoat_roughness_factor),
        transmission=factors.number(transmission.transmission_factor),
    )


ALPHA_MODES: dict[str, AlphaMode] = {"OPAQUE": "opaque", "MASK": "mask", "BLEND": "blend"}


@dataclass(frozen=True)
class UvSource:
    """UVs of vertices: a UV set of the file, and the transform that was applied to it."""

    uv_set: int = 0
    transform: UvTransform | None = None


@dataclass(frozen=True)
class MaterialSource:
    """A material before its images are read."""

    material: Material
    """Material without textures: `texture_id` is -1, there are no planes, and factors are the file's."""
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
        """UVs in `Geometry.uvs`: those of the first map, which is the base colour where there is one."""
        for reference in self.maps.values():
            return UvSource(reference.uv_set, reference.uv_transform)
        return UvSource()

    @property
    def second_uv_set(self) -> int | None:
        """UV set of the file in `Geometry.second_uvs`; None when no map needs it."""
        for reference in self.maps.values():
            if self._from_uvs(reference) is None:
                return reference.uv_set
        return None

    def _from_uvs(self, reference: TextureReference) -> Affine | None:
        uvs = self.uvs
        return after_inverse(uvs.transform, reference.uv_transform) if reference.uv_set == uvs.uv_set else None

    def placement(self, reference: TextureReference) -> tuple[bool, Affine] | None:
        """Return (whether `reference` reads the second UVs, transform from the vertex's UVs to its UVs); None where vertices hold
        neither."""
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
    file: GltfFile,
    entry: schema.Material,
    glossy: schema.SpecularGlossiness | None,
    factors: SurfaceFactors,
    where: str,
    notes: ReportNotes,
) -> dict[MapName, TextureReference]:
    """Return the textures of the maps that have an effect, because their factor is not 0. Raises InputError."""
    pbr, pbr_name = entry.pbr_metallic_roughness, f"{where}.pbrMetallicRoughness"
    if glossy is not None:
        base = read_reference(file, glossy.diffuse_texture, f"{where}.extensions.{GLOSSINESS}.diffuseTexture", notes)
    else:
        base = read_reference(file, pbr.base_color_texture, f"{pbr_name}.baseColorTexture", notes)
    if not isinstance(entry, schema.LitMaterial):
        return {"base": base} if base is not None else {}
    normal = read_reference(file, entry.normal_texture, f"{where}.normalTexture", notes)
    both = None
    if glossy is None:
        both_info = entry.pbr_metallic_roughness.metallic_roughness_texture
        both = read_reference(file, both_info, f"{pbr_name}.metallicRoughnessTexture", notes)
    emissive = read_reference(file, entry.emissive_texture, f"{where}.emissiveTexture", notes)
    occlusion = read_reference(file, entry.occlusion_texture, f"{where}.occlusionTexture", notes)
    candidates: dict[MapName, tuple[TextureReference | None, bool]] = {
        "base": (base, True),
        "normal": (normal, factors.normal_scale != 0.0),
        "roughness": (both, factors.roughness != 0.0),
        "metalness": (both, factors.metalness != 0.0),
        "emissive": (emissive, factors.emissive != (0.0, 0.0, 0.0)),
        "occlusion": (occlusion, factors.occlusion_strength != 0.0),
    }
    references: dict[MapName, TextureReference] = {}
    for name in MAPS:
        reference, has_effect = candidates[name]
        if reference is not None and has_effect:
            references[name] = reference
        elif reference is not None:
            notes.note(f"{name} maps whose factor is 0 are left out: materials")
    return references


def _material(file: GltfFile, index: int, notes: ReportNotes) -> MaterialSource:
    stored, where = file.entries("materials")[index], f"materials[{index}]"
    entry = file.entry("materials", index, schema.Material)
    glossy = file.extension(entry, GLOSSINESS, schema.SpecularGlossiness, where)
    notes.honoured(f"{GLOSSINESS}: diffuse as base colour", int(glossy is not None))
    unlit = file.extension(entry, "KHR_materials_unlit", schema.Unlit, where) is not None
    notes.honoured("KHR_materials_unlit: materials", int(unlit))
    if entry.alpha_mode != "OPAQUE":
        notes.honoured(f"alphaMode {entry.alpha_mode}: materials")
    if entry.alpha_mode == "BLEND":
        notes.note("BLEND is drawn alpha-hashed, at rest as the mean of 16 samples: materials")
    double_sided = entry.double_sided is True
    notes.honoured("doubleSided: materials", int(double_sided))
    factors = DEFAULT_FACTORS
    # Light has no effect on unlit materials, so their other factors and maps are not read.
    if not unlit:
        entry = file.entry("materials", index, schema.LitMaterial)
        factors = read_factors(file, entry, glossy, where, notes)
    references = _references(file, entry, glossy, factors, where, notes)
    material = Material(
        name=file.label(stored, f"material {index}"),
        texture_id=-1,
        factor=entry.pbr_metallic_roughness.base_color_factor if glossy is None else glossy.diffuse_factor,
        sampler=references["base"].sampler if "base" in references else Sampler(),
        alpha_mode=ALPHA_MODES[entry.alpha_mode],
        alpha_cutoff=entry.alpha_cutoff,
        double_sided=double_sided,
        unlit=unlit,
        factors=factors,
    )
    return MaterialSource(material, references, category_of(file, stored))


def read_materials(file: GltfFile, notes: ReportNotes) -> tuple[MaterialSource, ...]:
    """Return all materials of the file, and at the end the default one for primitives without a material. Raises InputError."""
    count = len(file.entries("materials"))
    return (*(_material(file, index, notes) for index in range(count)), DEFAULT_MATERIAL)


EXTENSION = "KHR_materials_variants"
MOST_NAMED = 6
"""Most variants that one message names."""


def variant_names(file: GltfFile) -> tuple[str, ...]:
    """Return the names of the file's variants, in its order; `variant N` for one without a name, or with a name used before.
    Raises InputError."""
    extension = file.extension(file.document, EXTENSION, schema.Variants, "")
    names: list[str] = []
    for number, entry in enumerate(() if extension is None else extension.variants):
        name = file.label(entry, f"variant {number}")
        names.append(name if name not in names else f"variant {number}")
    return tuple(names)


def chosen_variant(names: tuple[str, ...], wanted: str, scene: str) -> int | None:
    """Return the number of the variant called `wanted`; None for "", which means the materials that primitives name themselves.
    Raises InputError."""
    if not wanted:
        return None
    if wanted not in names:
        known = ", ".join(names[:MOST_NAMED]) + (f" and {len(names) - MOST_NAMED} more" * (len(names) > MOST_NAMED))
        there = f"there are {known}" if names else "the scene has no variants"
        raise InputError(f"{scene}: no variant {wanted!r}; {there}")
    return names.index(wanted)


def variant_materials(file: GltfFile, primitive: schema.Primitive, variants: int, where: str) -> dict[int, int]:
    """Return the materials of a primitive by variant number; `variants` is the file's number of variants. Raises InputError."""
    extension = file.extension(primitive, EXTENSION, schema.VariantMappings, where)
    materials: dict[int, int] = {}
    for number, mapping in enumerate(() if extension is None else extension.mappings):
        field = f"{where}.extensions.{EXTENSION}.mappings[{number}]"
        material = file.index(mapping.material, len(file.entries("materials")), f"{field}.material")
        for variant in mapping.variants:
            materials.setdefault(file.index(variant, variants, f"{field}.variants"), material)
    return materials
