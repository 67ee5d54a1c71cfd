"""Materials as the file states them: factors, and where the texture of each map comes from and how it is sampled."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ntc.codec.maps import MAPS, MapName
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.factors import read_factors
from viewer.scene.gltf.textures import Affine, TextureReference, UvTransform, after_inverse, category_of, read_reference
from viewer.scene.model import DEFAULT_FACTORS, AlphaMode, Material
from viewer.scene.report import ReportNotes

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
    """In the order of MAPS: those that have an effect."""
    category: str | None = None
    """From extras of the material."""

    @property
    def reads_alpha(self) -> bool:
        """Whether the material uses the alpha of its base colour."""
        return self.material.alpha_mode != "opaque"

    @property
    def uvs(self) -> UvSource:
        """What `Geometry.uvs` holds: the UVs of the first map, which is the base colour where there is one."""
        for reference in self.maps.values():
            return UvSource(reference.uv_set, reference.uv_transform)
        return UvSource()

    @property
    def second_uv_set(self) -> int | None:
        """The set that `Geometry.second_uvs` holds, as it is in the file; None when no map needs it."""
        for reference in self.maps.values():
            if self._from_uvs(reference) is None:
                return reference.uv_set
        return None

    def _from_uvs(self, reference: TextureReference) -> Affine | None:
        uvs = self.uvs
        return after_inverse(uvs.transform, reference.uv_transform) if reference.uv_set == uvs.uv_set else None

    def placement(self, reference: TextureReference) -> tuple[bool, Affine] | None:
        """(whether from the second UVs, what takes the vertex's UVs to those of `reference`); None for UVs that no vertex holds."""
        from_uvs = self._from_uvs(reference)
        if from_uvs is not None:
            return False, from_uvs
        if reference.uv_set != self.second_uv_set:
            return None
        from_second = after_inverse(None, reference.uv_transform)
        return None if from_second is None else (True, from_second)


DEFAULT_MATERIAL = MaterialSource(Material("default", -1, (1.0, 1.0, 1.0, 1.0)))
"""What glTF prescribes for primitives without a material."""


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
    """All materials of the file, and at the end the one for primitives that name none. Raises InputError."""
    count = len(file.entries("materials"))
    return (*(_material(file, index, notes) for index in range(count)), DEFAULT_MATERIAL)
