"""Quality of decoded textures over 8-bit values: PSNR in dB, by map too, and the angle between normals."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import BASE_ALONE, MapName, map_slices
from ntc.codec.mips import compiled_maps, normal_vectors
from ntc.codec.model import EncodedTexture
from ntc.errors import InputError

VALUES_AT_ONCE = 1 << 20
"""Values whose differences are in memory at a time."""


def finite_or_none(value: float | None) -> float | None:
    """Return `value`, or None where JSON cannot hold it: the PSNR of equal images is infinite."""
    return value if value is not None and math.isfinite(value) else None


def mean_square_error(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float:
    """Return the mean of squared differences, in units of 8-bit steps squared. `a` and `b` have one shape."""
    if not a.size:
        return 0.0
    total, rows = 0, max(1, VALUES_AT_ONCE * len(a) // a.size)
    for start in range(0, len(a), rows):
        difference = a[start : start + rows].astype(np.int32)
        difference -= b[start : start + rows]
        difference *= difference
        total += int(difference.sum(dtype=np.int64))
    return total / a.size


def psnr_of_mse(mean_square: float) -> float:
    """Return the PSNR in dB of a mean square error in 8-bit steps squared; infinity for 0."""
    return math.inf if mean_square <= 0.0 else 10.0 * math.log10(255.0**2 / mean_square)


def mse_of_psnr(psnr: float) -> float:
    """Return the mean square error in 8-bit steps squared of a PSNR in dB; 0 for infinity."""
    return float(255.0**2 * 10.0 ** (-psnr / 10.0))


def psnr_db(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float:
    """Return the PSNR in dB over 8-bit values (for pictures: sRGB RGB) of two arrays of one shape; infinity when equal."""
    return psnr_of_mse(mean_square_error(a, b))


def worst_share_db(psnrs_db: Sequence[float], share: float = 0.05) -> float:
    """Return the mean of the lowest `share` in (0, 1] of per-texture PSNRs in dB, their number rounded up, so at least one.

    Infinite when one of them is. Raises InputError for no PSNR, one that is not a number, and another `share`.
    """
    if not 0.0 < share <= 1.0:
        raise InputError(f"worst PSNR: share is {share}; set it above 0 and up to 1")
    if len(psnrs_db) == 0 or any(math.isnan(value) for value in psnrs_db):
        raise InputError("worst PSNR: needs one PSNR in dB at least, and no NaN")
    # 0.07 of 100 is a little more than 7 in floating point, and must not become 8.
    count = max(1, math.ceil(share * len(psnrs_db) - 1e-9))
    return float(np.mean(np.sort(np.asarray(psnrs_db, np.float64))[:count]))


@dataclass(frozen=True)
class PsnrSummary:
    """Five numbers about the PSNR of textures: a mean of dB alone hides bad textures behind easy ones."""

    mean_db: float
    median_db: float
    minimum_db: float
    worst_share_db: float
    """Mean of the worst 5 % of the textures."""
    of_mean_mse_db: float
    """PSNR of the mean over textures of their mean square errors."""

    @classmethod
    def of(cls, values_db: Sequence[float]) -> "PsnrSummary | None":
        """Summary of per-texture PSNRs in dB; None for none."""
        if not values_db:
            return None
        values = np.asarray(values_db, np.float64)
        mean_square = float(np.mean(255.0**2 * 10.0 ** (-values / 10.0)))
        return cls(
            mean_db=float(values.mean()),
            median_db=float(np.median(values)),
            minimum_db=float(values.min()),
            worst_share_db=worst_share_db(values_db),
            of_mean_mse_db=psnr_of_mse(mean_square),
        )


Texture = TypeVar("Texture", bound=EncodedTexture)
HIGH_PERCENTILE = 95.0


def normal_angles(coded: NDArray[np.uint8], others: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return [H, W] float64 degrees between the normals of two pictures [H, W, 2] uint8 of their xy, as shading reads them: z rebuilt,
    then made unit vectors."""
    compiled = compiled_maps(coded.size)
    if compiled is not None:
        degrees = np.empty(coded.shape[:2])
        compiled.write_angles(coded, others, degrees)
        return degrees
    first, second = (_unit(normal_vectors(each).astype(np.float64)) for each in (coded, others))
    # By both: the cosine alone has no digits left for small angles.
    sines = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.asarray(np.degrees(np.arctan2(sines, (first * second).sum(-1))))


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def map_psnr_db(maps: Sequence[MapName], decoded: NDArray[np.uint8], pixels: NDArray[np.uint8]) -> tuple[float, ...]:
    """Return the PSNR in dB over 8-bit values of each of `maps` of `decoded` [H, W, C] against `pixels`; infinity where they are
    equal."""
    places = map_slices(maps, pixels.shape[2]).values()
    return tuple(psnr_db(decoded[..., place], pixels[..., place]) for place in places)


def measured_texture(texture: Texture, decoded: NDArray[np.uint8], pixels: NDArray[np.uint8]) -> Texture:
    """Return `texture` with the quality of its mip 0, `decoded` [H, W, C], against the original's `pixels`."""
    found = replace(texture, psnr_db=psnr_db(decoded, pixels))
    if texture.maps == BASE_ALONE:
        return found
    degrees = None
    place = map_slices(texture.maps, texture.channels).get("normal")
    if place is not None:
        angles = normal_angles(decoded[..., place], pixels[..., place])
        degrees = (float(angles.mean()), float(np.percentile(angles, HIGH_PERCENTILE)))
    return replace(found, map_psnr_db=map_psnr_db(texture.maps, decoded, pixels), normal_degrees=degrees)
