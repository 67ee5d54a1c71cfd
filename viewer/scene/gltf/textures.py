"""Texture references of materials: the image, the sampler and the UVs."""

import math
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from msgspec import UnsetType
from numpy.typing import NDArray

from ntc.codec.config import WrapMode
from viewer.scene.gltf import schema
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.packed_textures import pack_option
from viewer.scene.json_text import describe
from viewer.scene.model import Sampler
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
IMAGE_EXTENSIONS = (
    "EXT_texture_webp",
    "MSFT_texture_dds",
    "KHR_texture_basisu",
    "EXT_texture_astc",
    "EXT_texture_avif",
)
"""Extensions that name another image of a texture, in order of preference."""
COPIES = frozenset({"KHR_texture_basisu", "EXT_texture_astc", "EXT_texture_avif"})
"""Extensions among IMAGE_EXTENSIONS that are used only for textures without a plain image."""
TRANSFORM = "KHR_texture_transform"
LEAST_DETERMINANT = 1e-12
"""Smallest determinant of a transform that is inverted."""
LARGEST_TERM = 1e30
"""Largest term of a combined transform: products with UVs must stay finite in single precision."""

Affine = tuple[float, float, float, float, float, float]
"""Rows (a, b, c) and (d, e, f) of u' = a u + b v + c, v' = d u + e v + f."""
IDENTITY: Affine = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


@dataclass(frozen=True)
class UvTransform:
    """Transform of UVs (KHR_texture_transform): uv' = T R S uv. A positive angle turns the picture clockwise."""

    offset: tuple[float, float]
    rotation: float
    """Radians."""
    scale: tuple[float, float]

    @property
    def affine(self) -> Affine:
        """Rows of the transform's matrix."""
        cosine, sine = math.cos(self.rotation), math.sin(self.rotation)
        across, along = self.scale
        return cosine * across, sine * along, self.offset[0], -sine * across, cosine * along, self.offset[1]

    def apply(self, uvs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return a transformed copy of `uvs` [N, 2]."""
        cosine, sine = math.cos(self.rotation), math.sin(self.rotation)
        u, v = uvs[:, 0].astype(np.float64) * self.scale[0], uvs[:, 1].astype(np.float64) * self.scale[1]
        turned = np.stack([cosine * u + sine * v + self.offset[0], cosine * v - sine * u + self.offset[1]], axis=1)
        return np.asarray(turned, np.float32)


def after_inverse(first: UvTransform | None, second: UvTransform | None) -> Affine | None:
    """Return the transform from `first`'s UV space to `second`'s; None where `first` has no inverse, and on overflow."""
    if first == second:
        return IDENTITY
    a, b, c, d, e, f = IDENTITY if first is None else first.affine
    determinant = a * e - b * d
    if abs(determinant) < LEAST_DETERMINANT:
        return None
    inverse = np.array([[e, -b, b * f - c * e], [-d, a, c * d - a * f], [0.0, 0.0, determinant]]) / determinant
    target = np.array([*(IDENTITY if second is None else second.affine), 0.0, 0.0, 1.0]).reshape(3, 3)
    with np.errstate(over="ignore", invalid="ignore"):
        combined = target @ inverse
    if not (np.abs(combined) < LARGEST_TERM).all():
        return None
    u, v, _ = combined.tolist()
    return u[0], u[1], u[2], v[0], v[1], v[2]


@dataclass(frozen=True)
class TextureReference:
    """Texture of a map: glTF's textureInfo with the texture's image and sampler."""

    image: int
    """Index of the image."""
    sampler: Sampler = field(default_factory=Sampler)
    uv_set: int = 0
    uv_transform: UvTransform | None = None
    category: str | None = None
    """Category from extras of the image or the texture."""
    texture: int = -1
    """Index of the texture entry of the file."""
    packed_hash: str = ""
    """Identity of the texture of a pack that replaces it (NV_texture_swizzle); "" for none."""


def category_of(file: GltfFile, owner: dict[str, Any]) -> str | None:
    """Return the category in the extras of the object `owner`; None without one."""
    extras = owner.get("extras")
    value = extras.get("category") if isinstance(extras, dict) else None
    return file.label({"name": value}, "") or None if isinstance(value, str) else None


def _sampler(file: GltfFile, texture: schema.Texture, where: str, notes: ReportNotes) -> Sampler:
    if texture.sampler == schema.ABSENT:
        return Sampler()
    number = file.index(texture.sampler, len(file.entries("samplers")), f"{where}.sampler")
    entry = file.entry("samplers", number, schema.Sampler)

    def known(key: str, value: Any, default: int, allowed: Collection[int]) -> int:
        if isinstance(value, int) and value in allowed:
            return value
        notes.note(f"sampler {key} {describe(value)} is unknown; the default was used")
        return default

    minify_linear, mipmap = MINIFY[known("minFilter", entry.min_filter, 9987, MINIFY)]
    wrap_u, wrap_v = known("wrapS", entry.wrap_s, 10497, WRAP_MODES), known("wrapT", entry.wrap_t, 10497, WRAP_MODES)
    return Sampler(
        wrap=(WRAP_MODES[wrap_u], WRAP_MODES[wrap_v]),
        magnify_linear=known("magFilter", entry.mag_filter, 9729, (9728, 9729)) == 9729,
        minify_linear=minify_linear,
        mipmap=mipmap,
    )


def texture_image(file: GltfFile, number: int, notes: ReportNotes) -> int | None:
    """Return the image of texture `number`: that of a WebP or DDS extension, else the plain one, else one of COPIES."""
    texture, where, count = (
        file.entry("textures", number, schema.Texture),
        f"textures[{number}]",
        len(file.entries("images")),
    )
    for name in IMAGE_EXTENSIONS:
        extension = file.extension(texture, name, schema.OtherImage, where)
        if extension is None or extension.source == schema.ABSENT:
            continue
        if name in COPIES and texture.source != schema.ABSENT:
            # The Basis Universal, ASTC or AVIF image was compressed from the plain one, which is closer to the original.
            notes.note(f"{name}: textures whose plain image is read instead")
            continue
        notes.honoured(f"{name}: textures")
        return file.index(extension.source, count, f"{where}.extensions.{name}.source")
    if texture.source != schema.ABSENT:
        return file.index(texture.source, count, f"{where}.source")
    notes.missing(f"{where}: no image; its factor is used")
    return None


def read_reference(
    file: GltfFile, info: schema.TextureInfo | UnsetType, where: str, notes: ReportNotes
) -> TextureReference | None:
    """Return the texture reference of the textureInfo `info` in the field `where`; None without one, or without an image.
    Raises InputError."""
    if isinstance(info, UnsetType):
        return None
    number = file.index(info.index, len(file.entries("textures")), f"{where}.index")
    texture, entry = file.entry("textures", number, schema.Texture), file.entries("textures")[number]
    image = texture_image(file, number, notes)
    sampler = _sampler(file, texture, f"textures[{number}]", notes)
    uv_set, transform = int(info.tex_coord), None
    placed = file.extension(info, TRANSFORM, schema.TextureTransform, where)
    if placed is not None:
        notes.honoured(f"{TRANSFORM}: texture references")
        transform = UvTransform(placed.offset, placed.rotation, placed.scale)
        uv_set = uv_set if isinstance(placed.tex_coord, UnsetType) else int(placed.tex_coord)
    notes.honoured("second and further UV sets: texture references", int(uv_set > 0))
    if image is None:
        return None
    category = category_of(file, file.entries("images")[image]) or category_of(file, entry)
    packed = pack_option(file, number, notes)
    packed_hash = packed.pixel_hash if packed is not None else ""
    return TextureReference(image, sampler, uv_set, transform, category, number, packed_hash)
