"""What `feature_matrix` needs to know of a kind of features."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import FeatureName
from ntc.codec.textures import SourceTexture

Extraction = Callable[[Sequence[SourceTexture]], NDArray[np.float64]]
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
    """`features` of one texture ([F] float64), made to take several."""

    def extract(textures: Sequence[SourceTexture]) -> NDArray[np.float64]:
        return np.stack([features(texture) for texture in textures])

    return extract
