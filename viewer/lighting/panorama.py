"""Panoramas from HDR and EXR files."""

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.io import read_file
from viewer.scene.images import library_message

LARGEST_WIDTH: Final = 8192
"""Largest width in texels of a panorama that is read."""
USED_WIDTH: Final = 4096
"""Width in texels to which larger panoramas are reduced."""
LARGEST_FILE: Final = 1 << 28
TEXELS_PER_BYTE: Final = 256
FREE_TEXELS: Final = 1 << 21
"""Number of texels that any file may hold. A file with more than that and TEXELS_PER_BYTE for each byte has a broken header."""
LARGEST_RADIANCE: Final = 65000.0
"""Limit to which brighter texels are clamped. Suns in panoramas are often brighter than the largest half float."""
NEGATIVE_ALLOWED: Final = 0.05
"""Largest size of a negative value, as a share of the mean. Filters leave such values; they are set to 0."""


@dataclass(frozen=True, eq=False)
class Panorama:
    """Panorama: light from all directions around a point, equirectangular (`viewer.lighting.directions`)."""

    pixels: NDArray[np.float32] = field(repr=False)
    """[H, 2 H, 3] linear RGB radiance, finite, at least 0; row 0 on top."""
    digest: str
    """Digest of the file's content."""


def _checked_size(path: Path, width: int, height: int, channels: int, byte_count: int) -> None:
    if width != 2 * height or height < 2:
        raise InputError(
            f"{path}: {width} x {height} texels; an equirectangular panorama is twice as wide as high: crop or resize it"
        )
    if width > LARGEST_WIDTH:
        raise InputError(f"{path}: {width} x {height} texels; at most {LARGEST_WIDTH} across are read: make it smaller")
    if not 1 <= channels <= 64:
        raise InputError(f"{path}: has {channels} channels; give a panorama of RGB")
    if width * height > FREE_TEXELS + TEXELS_PER_BYTE * byte_count:
        raise InputError(f"{path}: {width} x {height} texels in {byte_count} bytes; the file is broken, replace it")


def _read_pixels(path: Path, byte_count: int) -> NDArray[np.float32]:
    image = OpenImageIO.ImageInput.open(str(path))
    if image is None:
        library_message(OpenImageIO.geterror)
        raise InputError(f"{path}: not an image that can be read; give a panorama as HDR or EXR")
    try:
        spec = image.spec()
        _checked_size(path, spec.width, spec.height, spec.nchannels, byte_count)
        if (spec.x, spec.y, spec.full_width, spec.full_height) != (0, 0, spec.width, spec.height) or spec.deep:
            raise InputError(
                f"{path}: holds a part of a picture, or samples at depths; write the panorama as one flat picture"
            )
        if spec.depth > 1 or str(spec.format) not in ("float", "half", "double"):
            raise InputError(f"{path}: holds {spec.format} colours and no radiance; give a panorama as HDR or EXR")
        pixels: Any = image.read_image(0, 0, 0, min(spec.nchannels, 3), "float")
        if pixels is None or image.has_error:
            reason = library_message(image.geterror)
            raise InputError(f"{path}: the panorama does not decode ({reason}); replace it")
        radiance = np.asarray(pixels, np.float32).reshape(spec.height, spec.width, -1)
    finally:
        image.close()
    return np.repeat(radiance[..., :1], 3, axis=2) if radiance.shape[2] < 3 else radiance


def _checked_radiance(path: Path, pixels: NDArray[np.float32]) -> NDArray[np.float32]:
    if not np.isfinite(pixels).all():
        count = int((~np.isfinite(pixels).all(axis=2)).sum())
        raise InputError(
            f"{path}: {count} texels are infinite or no number; clamp them to {LARGEST_RADIANCE:.0f} first"
        )
    lowest, mean = float(pixels.min()), float(pixels.mean(dtype=np.float64))
    if lowest < -max(NEGATIVE_ALLOWED * mean, 1e-6):
        raise InputError(f"{path}: holds negative radiance, down to {lowest:.4g}; clamp it to 0 first")
    return np.clip(pixels, 0.0, LARGEST_RADIANCE)


def reduced(pixels: NDArray[np.float32], width: int) -> NDArray[np.float32]:
    """Reduce `pixels` [H, 2 H, 3] to means of squares of texels; the result is the narrowest of at least `width` texels across."""
    factor = next((n for n in range(pixels.shape[1] // width, 1, -1) if pixels.shape[0] % n == 0), 1)
    if factor <= 1:
        return pixels
    rows, columns = pixels.shape[0] // factor, pixels.shape[1] // factor
    means = pixels.reshape(rows, factor, columns, factor, 3).mean(axis=(1, 3), dtype=np.float64)
    return np.asarray(means, np.float32)


def load_panorama(path: Path) -> Panorama:
    """Read the panorama in an HDR or EXR file, reduced to USED_WIDTH texels across where its size divides.

    Raises InputError, naming file and remedy: for a file that cannot be read or is no such image, for other sizes than 2:1 and sizes
    beyond LARGEST_WIDTH (before memory is allocated), for values that are not finite, and for negative ones.
    """
    path = Path(path)
    try:
        data = read_file(path, LARGEST_FILE)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    pixels = _checked_radiance(path, _read_pixels(path, len(data)))
    return Panorama(np.ascontiguousarray(reduced(pixels, USED_WIDTH)), hashlib.sha256(data).hexdigest())
