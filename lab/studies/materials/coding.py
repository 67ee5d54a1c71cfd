"""What a coding of material sets comes to: errors by channel, angles of normals, and stored bits."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lab.studies.set_quality import texel_count
from ntc.codec.maps import MapName, map_slices
from ntc.codec.quality import HIGH_PERCENTILE, normal_angles, psnr_of_mse
from ntc.codec.textures import SourceTexture, hash_pixels
from viewer.scene.map_pictures import PICTURES

Part = tuple[MapName, ...]
PARTS: tuple[Part, ...] = PICTURES
"""Maps that lie in one picture where maps are not encoded together."""
LEAST_ERROR = 1e-3
"""Mean square error in 8-bit steps squared that an exact map counts as."""


@dataclass(frozen=True)
class CodedMaps:
    """Some maps of one material, decoded."""

    errors: Mapping[MapName, tuple[float, ...]]
    """By map: mean square error of each of its channels, in 8-bit steps squared."""
    degrees: tuple[float, float] | None
    """Mean and 95th percentile of the angle between normals; None without any."""

    @classmethod
    def of(cls, maps: Sequence[MapName], decoded: NDArray[np.uint8], pixels: NDArray[np.uint8]) -> "CodedMaps":
        """Of `decoded` [H, W, C] against `pixels`, the channels of `maps`."""
        squares = np.square(decoded.astype(np.float64) - pixels).mean((0, 1))
        errors, degrees = dict[MapName, tuple[float, ...]](), None
        for name, place in map_slices(maps, pixels.shape[2]).items():
            errors[name] = tuple(squares[place].tolist())
            if name == "normal":
                angles = normal_angles(decoded[..., place], pixels[..., place])
                degrees = (float(angles.mean()), float(np.percentile(angles, HIGH_PERCENTILE)))
        return cls(errors, degrees)

    def psnr_db(self, maps: Sequence[MapName] | None = None) -> float:
        """Of all channels of some maps, or of all."""
        chosen = self.errors if maps is None else [name for name in maps if name in self.errors]
        values = [error for name in chosen for error in self.errors[name]]
        return psnr_of_mse(max(float(np.mean(values)), LEAST_ERROR))


@dataclass(frozen=True)
class Coding:
    """Some maps of all materials, and what they take."""

    materials: tuple[CodedMaps | None, ...]
    """None for a material that has none of these maps."""
    stored_bits: float
    """Of all mips and tables."""


def joined(codings: Sequence[Coding]) -> Coding:
    """Codings of different maps of the same materials, as one."""
    found = []
    for each in zip(*(coding.materials for coding in codings), strict=True):
        own = [coded for coded in each if coded is not None]
        errors = {name: error for coded in own for name, error in coded.errors.items()}
        found.append(CodedMaps(errors, next((coded.degrees for coded in own if coded.degrees), None)))
    return Coding(tuple(found), sum(coding.stored_bits for coding in codings))


def part_of(texture: SourceTexture, part: Part) -> SourceTexture | None:
    """The maps of `part` that a material set has, as a texture; None without any."""
    slices = map_slices(texture.maps, texture.channels)
    maps = tuple(name for name in texture.maps if name in part)
    if not maps:
        return None
    pixels = np.ascontiguousarray(np.concatenate([texture.pixels[..., slices[name]] for name in maps], axis=2))
    return replace(texture, pixels=pixels, maps=maps, pixel_hash=hash_pixels(pixels))


@dataclass(frozen=True)
class MaterialPoint:
    """A coding of all maps of all materials, as means over the materials."""

    curve: str
    setting: str
    bits_per_texel: float
    """Everything that is stored, of all maps together, per texel of mip 0."""
    mean_db: float
    """PSNR over all channels of a material."""
    base_db: float | None
    normal_db: float | None
    linear_db: float | None
    """Of roughness, metalness and occlusion together."""
    emissive_db: float | None
    degrees: float | None
    """Mean angle of normals."""
    degrees_95: float | None
    """95th percentile."""

    @classmethod
    def of(cls, curve: str, setting: str, coding: Coding, textures: Sequence[SourceTexture]) -> "MaterialPoint":
        """That of `coding`, which holds all maps of `textures`."""
        found = [coded for coded in coding.materials if coded is not None]
        by_part = []
        for part in PARTS:
            values = [coded.psnr_db(part) for coded in found if any(name in part for name in coded.errors)]
            by_part.append(float(np.mean(values)) if values else None)
        angles = [coded.degrees for coded in found if coded.degrees is not None]
        means = np.mean(angles, axis=0).tolist() if angles else (None, None)
        bits = coding.stored_bits / texel_count([texture.size for texture in textures])
        return cls(curve, setting, bits, mean_psnr_db(coding), *by_part, *means)


def mean_psnr_db(coding: Coding) -> float:
    """Mean over materials of the PSNR over all their channels."""
    return float(np.mean([coded.psnr_db() for coded in coding.materials if coded is not None]))
