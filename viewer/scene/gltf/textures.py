"""References to textures as materials state them: which image, how it is sampled, and by which UVs."""

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
"""Extensions among IMAGE_EXTENSIONS that are used where there is no plain image."""
TRANSFORM = "KHR_texture_transform"
LEAST_DETERMINANT = 1e-12
"""A transform that shrinks areas more than this is taken to be without an inverse."""
LARGEST_TERM = 1e30
"""Terms of a combined transform above it do not fit into single precision with UVs."""

Affine = tuple[float, float, float, float, float, float]
"""Rows (a, b, c) and (d, e, f) of u' = a u + b v + c, v' = d u + e v + f."""
IDENTITY: Affine = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


@dataclass(frozen=True)
class UvTransform:
    """KHR_texture_transform: uv' = T R S uv, the picture turning clockwise for positive angles."""

    offset: tuple[float, float]
    rotation: float
    """Radians."""
    scale: tuple[float, float]

    @property
    def affine(self) -> Affine:
        """Transform as the rows of a matrix."""
        cosine, sine = math.cos(self.rotation), math.sin(self.rotation)
        across, along = self.scale
        return cosine * across, sine * along, self.offset[0], -sine * across, cosine * along, self.offset[1]

    def apply(self, uvs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Transformed copy of `uvs` [N, 2]."""
        cosine, sine = math.cos(self.rotation), math.sin(self.rotation)
        u, v = uvs[:, 0].astype(np.float64) * self.scale[0], uvs[:, 1].astype(np.float64) * self.scale[1]
        turned = np.stack([cosine * u + sine * v + self.offset[0], cosine * v - sine * u + self.offset[1]], axis=1)
        return np.asarray(turned, np.float32)


def after_inverse(first: UvTransform | None, second: UvTransform | None) -> Affine | None:
    """Return what takes UVs that `first` was applied to to those that `second` gives; None without an inverse, and on overflow."""
    if first == second:
        return IDENTITY
    a, b, c, d, e, f = IDENTITY if first is None else first.affine
    determinant = a * e - b * d
    if abs(determinant) < LEAST_DETERMINANT:
        return None
    inverse = np.array([[e, -b, b * f - c * e], [-d, a, c * d - a * f], [0.0, 0.0, determinant]]) / determinant
    wanted = np.array([*(IDENTITY if second is None else second.affine), 0.0, 0.0, 1.0]).reshape(3, 3)
    with np.errstate(over="ignore", invalid="ignore"):
        combined = wanted @ inverse
    if not (np.abs(combined) < LARGEST_TERM).all():
        return None
    u, v, _ = combined.tolist()
    return u[0], u[1], u[2], v[0], v[1], v[2]


@dataclass(frozen=True)
class TextureReference:
    """A textureInfo of a material."""

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
    """Identity of the texture of a pack that stands for it (NV_texture_swizzle); "" for none."""


def category_of(file: GltfFile, owner: dict[str, Any]) -> str | None:
    """Return the text "category" in the extras of `owner`, if it has one."""
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
    """Image of texture `number`: a WebP or DDS extension's, else the plain one, else one that is read nevertheless."""
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
            # What Basis Universal, ASTC or AVIF holds was compressed from the plain image, which is nearer to what was made.
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
    """Return the reference of the textureInfo `info` in the field `where`; None when there is none, or none with an image that is
    read. Raises InputError."""
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
