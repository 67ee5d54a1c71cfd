"""Quality of a decoded texture map by map: PSNR of each, and the angle between normals."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import BASE_ALONE, MapName, map_slices
from ntc.codec.mips import normal_vectors
from ntc.codec.model import EncodedTexture
from ntc.codec.psnr import psnr_db

Texture = TypeVar("Texture", bound=EncodedTexture)
HIGH_PERCENTILE = 95.0


def normal_angles(coded: NDArray[np.uint8], others: NDArray[np.uint8]) -> NDArray[np.float64]:
    """[H, W] float64 degrees between the normals of two pictures [H, W, 2] uint8 of their xy, as shading reads them: z rebuilt, then
    made unit vectors."""
    first, second = (_unit(normal_vectors(each).astype(np.float64)) for each in (coded, others))
    # By both: the cosine alone has no digits left for small angles.
    sines = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.asarray(np.degrees(np.arctan2(sines, (first * second).sum(-1))))


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def map_psnr_db(maps: Sequence[MapName], decoded: NDArray[np.uint8], pixels: NDArray[np.uint8]) -> tuple[float, ...]:
    """PSNR in dB over 8-bit values of each of `maps` of `decoded` [H, W, C] against `pixels`; infinity where they are equal."""
    places = map_slices(maps, pixels.shape[2]).values()
    return tuple(psnr_db(decoded[..., place], pixels[..., place]) for place in places)


def measured_texture(texture: Texture, decoded: NDArray[np.uint8], pixels: NDArray[np.uint8]) -> Texture:
    """`texture` with the quality of its mip 0, `decoded` [H, W, C], against the original's `pixels`."""
    found = replace(texture, psnr_db=psnr_db(decoded, pixels))
    if texture.maps == BASE_ALONE:
        return found
    degrees = None
    place = map_slices(texture.maps, texture.channels).get("normal")
    if place is not None:
        angles = normal_angles(decoded[..., place], pixels[..., place])
        degrees = (float(angles.mean()), float(np.percentile(angles, HIGH_PERCENTILE)))
    return replace(found, map_psnr_db=map_psnr_db(texture.maps, decoded, pixels), normal_degrees=degrees)
