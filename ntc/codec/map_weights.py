"""What an error in each map of a material set is worth to the encoder, relative to the others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import MapName, map_slices

MapWeightsName = Literal["seen", "equal"]
LEAST_WEIGHT, LARGEST_WEIGHT = 0.01, 100.0


@dataclass(frozen=True)
class MapWeights:
    """By map: what the squared error of a stored value is worth. Only ratios matter. Decoding knows nothing of them."""

    base: float = 1.0
    normal: float = 1.0
    roughness: float = 1.0
    metalness: float = 1.0
    emissive: float = 1.0
    occlusion: float = 1.0

    def __post_init__(self) -> None:
        for field in fields(self):
            if not LEAST_WEIGHT <= getattr(self, field.name) <= LARGEST_WEIGHT:
                raise ValueError(f"map_weights.{field.name} = {getattr(self, field.name)!r} is out of range")

    def of_channels(self, maps: Sequence[MapName], channels: int) -> NDArray[np.float64]:
        """[channels] float64 of a texture of `maps`: their mean is 1."""
        found = np.ones(channels)
        for name, place in map_slices(maps, channels).items():
            found[place] = getattr(self, name)
        return np.asarray(found / found.mean())


SEEN_WEIGHTS: Final = MapWeights(base=1.0, normal=2.5, roughness=0.5, metalness=1.0, emissive=1.0, occlusion=0.5)
EQUAL_WEIGHTS: Final = MapWeights()
MAP_WEIGHTS: Final[Mapping[MapWeightsName, MapWeights]] = MappingProxyType(
    {"seen": SEEN_WEIGHTS, "equal": EQUAL_WEIGHTS}
)
"""Presets. `seen`: by how much an error changes the lit picture. `equal`: the mean square error of all channels."""
