"""Materials as the file states them: base colour, where its texture comes from and how it is sampled."""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import WrapMode
from viewer.scene.gltf.container import GltfFile
from viewer.scene.json_text import describe
from viewer.scene.model import AlphaMode, Material, Sampler
from viewer.scene.report import ReportNotes

WRAP_MODES: dict[int, WrapMode] = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
MINIFY: dict[int, tuple[bool, Literal["none", "nearest", "linear"]]] = {
    9728: (False, "none"),
    9729: (True, "none"),
    9984: (False, "nearest"),
    9985: (True, "nearest"),
    9986: (False, "linear"),
    9987: (True, "linear"),
}
ALPHA_MODES: dict[str, AlphaMode] = {"OPAQUE": "opaque", "MASK": "mask", "BLEND": "blend"}

UNUSED_TEXTURES = {
    "normalTexture": "normal textures",
    "occlusionTexture": "occlusion textures",
    "emissiveTexture": "emissive textures",
}


@dataclass(frozen=True)
class UvTransform:
    """KHR_texture_transform: uv' = T R S uv, the picture turning clockwise for positive angles."""

    offset: tuple[float, float]
    rotation: float
    """Radians."""
    scale: tuple[float, float]

    def apply(self, uvs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Transformed copy of `uvs` [N, 2]."""
        cosine, sine = math.cos(self.rotation), math.sin(self.rotation)
        u, v = uvs[:, 0].astype(np.float64) * self.scale[0], uvs[:, 1].astype(np.float64) * self.scale[1]
        turned = np.stack([cosine * u + sine * v + self.offset[0], cosine * v - sine * u + self.offset[1]], axis=1)
        return np.asarray(turned, np.float32)


@dataclass(frozen=True)
class MaterialSource:
    """A material before its image is read."""

    material: Material
    """Complete but for the texture: `texture_id` is -1 and `factor` is the file's."""
    image: int | None
    """Index of the base colour image."""
    uv_set: int
    uv_transform: UvTransform | None
    category: str | None
    """From extras of the image, the texture or the material."""

    @property
    def reads_alpha(self) -> bool:
        """Whether the material uses the texture's alpha."""
        return self.material.alpha_mode != "opaque"


DEFAULT_MATERIAL = MaterialSource(Material("default", -1, (1.0, 1.0, 1.0, 1.0)), None, 0, None, None)
"""What glTF prescribes for primitives without a material."""


def _category(file: GltfFile, owner: dict[str, Any]) -> str | None:
    extras = owner.get("extras")
    value = extras.get("category") if isinstance(extras, dict) else None
    return file.label({"name": value}, "") or None if isinstance(value, str) else None


def _sampler(file: GltfFile, texture: dict[str, Any], where: str, notes: ReportNotes) -> Sampler:
    if "sampler" not in texture:
        return Sampler()
    entry = file.entry("samplers", texture["sampler"], f"{where}.sampler")

    def known(key: str, default: int, allowed: dict[int, Any]) -> int:
        value = entry.get(key, default)
        if isinstance(value, int) and value in allowed:
            return value
        notes.note(f"sampler {key} {describe(value)} is unknown; the default was used")
        return default

    minify_linear, mipmap = MINIFY[known("minFilter", 9987, MINIFY)]
    return Sampler(
        wrap=(WRAP_MODES[known("wrapS", 10497, WRAP_MODES)], WRAP_MODES[known("wrapT", 10497, WRAP_MODES)]),
        magnify_linear=known("magFilter", 9729, {9728: 0, 9729: 0}) == 9729,
        minify_linear=minify_linear,
        mipmap=mipmap,
    )


def _image_index(file: GltfFile, texture: dict[str, Any], where: str, notes: ReportNotes) -> int | None:
    """Image of a texture: a WebP or DDS extension's, else the plain one."""
    count = len(file.entries("images"))
    for name in ("EXT_texture_webp", "MSFT_texture_dds"):
        extension = file.extension(texture, name, where)
        if extension is not None and "source" in extension:
            notes.honoured(f"{name}: textures")
            return file.index(extension["source"], count, f"{where}.{name}.source")
    if "source" in texture:
        return file.index(texture["source"], count, f"{where}.source")
    basis = file.extension(texture, "KHR_texture_basisu", where) is not None
    notes.missing(f"{where}: {'only a KTX2 image, which is not read' if basis else 'no image'}; its factor is used")
    return None


def _uv_transform(
    file: GltfFile, info: dict[str, Any], where: str, notes: ReportNotes
) -> tuple[int | None, UvTransform | None]:
    """(texCoord that overrides, transform) of a textureInfo."""
    extension = file.extension(info, "KHR_texture_transform", where)
    if extension is None:
        return None, None
    where = f"{where}.KHR_texture_transform"
    notes.honoured("KHR_texture_transform: materials")
    offset = file.numbers(extension, "offset", where, (0.0, 0.0))
    scale = file.numbers(extension, "scale", where, (1.0, 1.0))
    rotation = file.number(extension, "rotation", where, 0.0)
    uv_set = file.integer(extension, "texCoord", where, high=255) if "texCoord" in extension else None
    return uv_set, UvTransform((offset[0], offset[1]), rotation, (scale[0], scale[1]))


def _note_unused(entry: dict[str, Any], pbr: dict[str, Any], notes: ReportNotes) -> None:
    for key, what in UNUSED_TEXTURES.items():
        notes.ignored(what, int(key in entry))
    notes.ignored("metallic-roughness textures", int("metallicRoughnessTexture" in pbr))
    notes.ignored("emissive colours", int(entry.get("emissiveFactor", [0, 0, 0]) not in ([0, 0, 0], [0.0, 0.0, 0.0])))


def _material(file: GltfFile, index: int, notes: ReportNotes) -> MaterialSource:
    entry = file.entries("materials")[index]
    where = f"materials[{index}]"
    pbr = file.object(entry, "pbrMetallicRoughness", where)
    _note_unused(entry, pbr, notes)
    glossiness = file.extension(entry, "KHR_materials_pbrSpecularGlossiness", where)
    if glossiness is not None:
        notes.honoured("KHR_materials_pbrSpecularGlossiness: diffuse as base colour")
        notes.ignored("specular-glossiness textures", int("specularGlossinessTexture" in glossiness))
        owner, texture_key, factor_key = glossiness, "diffuseTexture", "diffuseFactor"
        owner_name = f"{where}.KHR_materials_pbrSpecularGlossiness"
    else:
        owner, texture_key, factor_key = pbr, "baseColorTexture", "baseColorFactor"
        owner_name = f"{where}.pbrMetallicRoughness"
    unlit = file.extension(entry, "KHR_materials_unlit", where) is not None
    notes.honoured("KHR_materials_unlit: materials", int(unlit))
    mode = file.text(entry, "alphaMode", where, "OPAQUE")
    if mode not in ALPHA_MODES:
        raise file.fail(f"{where}.alphaMode", f"{mode!r:.20} is none of OPAQUE, MASK and BLEND")
    if mode != "OPAQUE":
        notes.honoured(f"alphaMode {mode}: materials")
    if mode == "BLEND":
        notes.note("BLEND may be drawn alpha-hashed: materials")
    double_sided = entry.get("doubleSided") is True
    notes.honoured("doubleSided: materials", int(double_sided))

    image, uv_set, transform, sampler, category = None, 0, None, Sampler(), _category(file, entry)
    if texture_key in owner:
        info = file.object(owner, texture_key, owner_name)
        info_name = f"{owner_name}.{texture_key}"
        textures = file.entries("textures")
        number = file.index(info.get("index"), len(textures), f"{info_name}.index")
        image = _image_index(file, textures[number], f"textures[{number}]", notes)
        sampler = _sampler(file, textures[number], f"textures[{number}]", notes)
        uv_set = file.integer(info, "texCoord", info_name, 0, high=255)
        overriding, transform = _uv_transform(file, info, info_name, notes)
        uv_set = uv_set if overriding is None else overriding
        notes.honoured("second and further UV sets: materials", int(uv_set > 0))
        category = _category(file, textures[number]) or category
        if image is not None:
            category = _category(file, file.entries("images")[image]) or category
    red, green, blue, alpha = file.numbers(owner, factor_key, owner_name, (1.0, 1.0, 1.0, 1.0))
    material = Material(
        name=file.label(entry, f"material {index}"),
        texture_id=-1,
        factor=(red, green, blue, alpha),
        sampler=sampler,
        alpha_mode=ALPHA_MODES[mode],
        alpha_cutoff=file.number(entry, "alphaCutoff", where, 0.5),
        double_sided=double_sided,
        unlit=unlit,
    )
    return MaterialSource(material, image, uv_set, transform, category)


def read_materials(file: GltfFile, notes: ReportNotes) -> tuple[MaterialSource, ...]:
    """All materials of the file, and at the end the one for primitives that name none. Raises InputError."""
    count = len(file.entries("materials"))
    return (*(_material(file, index, notes) for index in range(count)), DEFAULT_MATERIAL)
