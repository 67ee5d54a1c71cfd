"""A kind of features as `feature_matrix` uses it: how raw features are found, kept on disk, and made comparable within a set."""

import hashlib
import io
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import FeatureName
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.io import write_bytes

Extraction = Callable[[Sequence[SourceTexture]], NDArray[np.float64]]
_SMALLEST = 1e-12
"""Deviations and lengths below are rounding errors of equal numbers."""
Scaling = Callable[[NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True)
class Extractor:
    """One kind of features: raw ones of each texture alone, and how those of a set are made comparable."""

    name: FeatureName
    version: str
    """Changes with everything that changes raw features, the weights of a network too: what is cached follows it."""
    length: int
    """F, the numbers per texture."""
    batch: int
    """Textures that are best given to `extract` at once."""
    scale: Scaling
    """[textures, F] raw features to [textures, F] comparable ones."""
    extract: Extraction
    """Textures to [textures, F] float64 raw features. A network is loaded at the first call."""


def one_by_one(features: Callable[[SourceTexture], NDArray[np.float64]]) -> Extraction:
    """Return a function that applies `features` ([F] float64 of one texture) to several."""

    def extract(textures: Sequence[SourceTexture]) -> NDArray[np.float64]:
        return np.stack([features(texture) for texture in textures])

    return extract


def standardised_columns(raw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return [textures, F] float64: each column of `raw` with mean 0 and deviation 1, or 0 where it is constant."""
    if not len(raw):
        return raw
    deviation = raw.std(axis=0)
    return np.asarray((raw - raw.mean(axis=0)) / np.where(deviation > _SMALLEST, deviation, 1.0))


def centred_directions(raw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return [textures, F] float64: the rows of `raw` at length 1, minus their mean, times one number for all.

    The number makes the mean squared distance from the centre 1, whatever F is; equal rows become 0. Columns are not
    scaled one by one, as an embedding's angles between textures are what it was trained for.
    """
    if not len(raw):
        return raw
    rows = raw / np.maximum(np.linalg.norm(raw, axis=1, keepdims=True), _SMALLEST)
    centred = rows - rows.mean(axis=0)
    spread = float(np.sqrt(np.mean(np.sum(centred**2, axis=1))))
    # Networks compute in float32, so equal pictures of different batches differ by about 1e-7.
    return centred / spread if spread > 1e-6 else np.zeros_like(centred)


_FLOAT64 = np.dtype("<f8")


def cache_path(folder: Path, extractor: Extractor, texture: SourceTexture) -> Path:
    """Return the path of the raw features of `texture` in `folder`.

    The pixel hash is that of the original image, so the shape of the pixels given and their colour space, by which
    mips are filtered, are part of the name as well. It is a digest: nothing of a texture becomes a path.
    """
    height, width, channels = texture.pixels.shape
    key = (extractor.version, texture.pixel_hash, width, height, channels, texture.color_space)
    return folder / f"{extractor.name}-{hashlib.sha256(repr(key).encode()).hexdigest()[:32]}.npy"


def _header(length: int) -> bytes:
    stream = io.BytesIO()
    described = {"descr": _FLOAT64.str, "fortran_order": False, "shape": (length,)}
    np.lib.format.write_array_header_1_0(stream, described)
    return stream.getvalue()


def read_features(path: Path, length: int) -> NDArray[np.float64] | None:
    """Return [length] float64 of the file at `path`, or None where there is none or it is not such a file.

    The header must be, byte for byte, the one that `write_features` writes: nothing in the file is interpreted.
    """
    header = _header(length)
    size = len(header) + length * _FLOAT64.itemsize
    try:
        if not path.is_file() or path.stat().st_size != size:
            return None
        with path.open("rb") as file:
            data = file.read(size)
    except OSError:
        return None
    if len(data) != size or not data.startswith(header):
        return None
    features = np.frombuffer(data, _FLOAT64, offset=len(header)).astype(np.float64)
    return features if bool(np.isfinite(features).all()) else None


def write_features(path: Path, features: NDArray[np.float64]) -> None:
    """Keep `features` [F] at `path`; does nothing where the folder cannot be written."""
    data = _header(len(features)) + features.astype(_FLOAT64).tobytes()
    # Without the cache everything works, only slower.
    with suppress(InputError):
        write_bytes(path, data)
