"""Features: vectors that describe textures, by which groupings measure similarity (docs/reference/groupings.md#features)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import FeatureName
from ntc.codec.textures import SourceTexture
from ntc.content_cache import ContentCache
from ntc.features.extractor import Extractor, cache_key
from ntc.features.pixels import first_map

__all__ = ["FeatureOptions", "feature_matrix", "raw_features"]


@dataclass(frozen=True)
class FeatureOptions:
    """Options of feature extraction. Of these, only `clip_weights` changes the features."""

    cache: Path | None = None
    """Folder of cached raw features of each texture. None: no cache."""
    clip_weights: str | None = None
    """Weights of `clip`: the path of a file, or "download"."""
    progress: Callable[[int, int], None] | None = None
    """Function that is called with (textures done, number of textures)."""
    known: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    """Known raw features (`raw_features`) by pixel hash; they are not computed again."""


def _extractor(name: FeatureName, options: FeatureOptions) -> Extractor:
    # Imported on use: two of them import torch and more.
    if name == "low_level":
        from ntc.features.statistics import low_level_extractor

        return low_level_extractor()
    if name == "spectral":
        from ntc.features.statistics import spectral_extractor

        return spectral_extractor()
    if name == "efficientnet":
        from ntc.features.efficientnet import efficientnet_extractor

        return efficientnet_extractor()
    if name == "clip":
        from ntc.features.clip import clip_extractor

        return clip_extractor(options.clip_weights)
    raise ValueError(f"features {name!r}: must be low_level, spectral, efficientnet or clip")


def _raw_features(
    extractor: Extractor, textures: Sequence[SourceTexture], options: FeatureOptions
) -> NDArray[np.float64]:
    raw = np.zeros((len(textures), extractor.length))
    cache = ContentCache(options.cache)
    missing: list[int] = []
    for index, texture in enumerate(textures):
        features = options.known.get(texture.pixel_hash)
        if features is None and (data := cache.read(cache_key(extractor, texture))) is not None:
            features = np.frombuffer(data)
        if features is None or len(features) != extractor.length:
            missing.append(index)
        else:
            raw[index] = features
    done = len(textures) - len(missing)
    if options.progress and done:
        options.progress(done, len(textures))
    for start in range(0, len(missing), extractor.batch):
        batch = missing[start : start + extractor.batch]
        raw[batch] = extractor.extract([textures[index] for index in batch])
        for index in batch:
            cache.write(cache_key(extractor, textures[index]), raw[index].tobytes())
        done += len(batch)
        if options.progress:
            options.progress(done, len(textures))
    return raw


def raw_features(
    name: FeatureName, textures: Sequence[SourceTexture], options: FeatureOptions = FeatureOptions()
) -> NDArray[np.float64]:
    """Return [textures, F] float64: raw features of each texture, which do not depend on the other textures.

    Raises InputError as `feature_matrix` does.
    """
    return _raw_features(_extractor(name, options), [first_map(texture) for texture in textures], options)


def feature_matrix(
    name: FeatureName, textures: Sequence[SourceTexture], options: FeatureOptions = FeatureOptions()
) -> NDArray[np.float64]:
    """Return [textures, F] float64: features of `textures`, scaled within this set. Distances are Euclidean.

    "low_level" (F = 17) and "spectral" (31): columns of mean 0 and deviation 1, or 0 where constant.
    "efficientnet" (1280) and "clip" (512): directions of embeddings, centred, with mean squared length 1.
    A material set is described by its base colour, or by its first map if it has none.
    Raises InputError if a package or weights that `name` needs are missing or do not fit.
    """
    extractor = _extractor(name, options)
    textures = [texture if texture.pixel_hash in options.known else first_map(texture) for texture in textures]
    return extractor.scale(_raw_features(extractor, textures, options))
