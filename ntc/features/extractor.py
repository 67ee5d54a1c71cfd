"""A kind of features: its extraction from one texture, and its scaling within a set of textures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import FeatureName
from ntc.codec.textures import SourceTexture

Extraction = Callable[[Sequence[SourceTexture]], NDArray[np.float64]]
_SMALLEST = 1e-12
"""Deviations and lengths below this come from rounding of equal numbers."""
Scaling = Callable[[NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True)
class Extractor:
    """One kind of features: raw features of each texture alone, and their scaling within a set."""

    name: FeatureName
    version: str
    """Version of the raw features, a key of the cache. It changes with the algorithm and with a network's weights."""
    length: int
    """F, the numbers of a texture."""
    batch: int
    """Best number of textures in a call of `extract`."""
    scale: Scaling
    """Function from [textures, F] raw features to [textures, F] scaled ones."""
    extract: Extraction
    """Function from textures to [textures, F] float64 raw features. A network is loaded at the first call."""


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

    The number makes the mean squared distance from the centre 1 for any F; equal rows become 0. Columns are not scaled one by one,
    because networks are trained on the angles between embeddings.
    """
    if not len(raw):
        return raw
    rows = raw / np.maximum(np.linalg.norm(raw, axis=1, keepdims=True), _SMALLEST)
    centred = rows - rows.mean(axis=0)
    spread = float(np.sqrt(np.mean(np.sum(centred**2, axis=1))))
    # Networks compute in float32: equal pictures in different batches differ by about 1e-7.
    return centred / spread if spread > 1e-6 else np.zeros_like(centred)


def cache_key(extractor: Extractor, texture: SourceTexture) -> str:
    """Return the key of the raw features of `texture` in a cache.

    The pixel hash is that of the original image, so the key has the shape of the pixels given too, and their colour space, by which
    mips are filtered.
    """
    key = (extractor.name, extractor.version, texture.pixel_hash, texture.pixels.shape, texture.color_space)
    return repr(key)
