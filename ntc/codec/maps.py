"""The maps of a material, and where each lies among the channels of a material set and in the planes that it is decoded by.

A material set is encoded as one texture whose channels are those of its maps, in the order of CODED_MAPS. Renderers decode it by
planes of up to four channels, so that a view decodes only what it needs.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

ShownMap = Literal["base", "normal", "roughness", "metalness", "emissive", "occlusion"]
MapName = Literal[ShownMap, "alpha"]
"""`base` and `emissive` are sRGB colours, `normal` the xy of a tangent-space normal as (n + 1) / 2; all others are linear."""
Plane = Literal["base", "surface", "emission", "coverage"]

MAPS: Final[tuple[ShownMap, ...]] = ("base", "normal", "roughness", "metalness", "emissive", "occlusion")
"""The maps that views show, in the order of their channels in a material set."""
CODED_MAPS: Final[tuple[MapName, ...]] = (*MAPS, "alpha")
"""All maps of a material set: MAPS, and alpha, which says what of a surface is there."""
MAP_CHANNELS: Final[Mapping[MapName, int]] = MappingProxyType(
    {"base": 3, "normal": 2, "roughness": 1, "metalness": 1, "emissive": 3, "occlusion": 1, "alpha": 1}
)
"""Channels of each map. A texture that is no material set is a `base` of 1 to 4 channels, alpha last."""
SRGB_MAPS: Final = frozenset[MapName](("base", "emissive"))
"""Maps that hold colours in sRGB values."""
BASE_ALONE: Final[tuple[MapName, ...]] = ("base",)
"""The maps of a texture that is no material set."""
PLANES: Final[tuple[Plane, ...]] = ("base", "surface", "emission")
"""The planes that views show, in their order on the GPU."""
CODED_PLANES: Final[tuple[Plane, ...]] = (*PLANES, "coverage")
"""All planes of a material set."""
PLANE_COMPONENTS: Final[Mapping[Plane, Mapping[MapName, int]]] = MappingProxyType(
    {
        "base": MappingProxyType({"base": 0}),
        "surface": MappingProxyType({"normal": 0, "roughness": 2, "metalness": 3}),
        "emission": MappingProxyType({"emissive": 0, "occlusion": 3}),
        "coverage": MappingProxyType({"alpha": 0}),
    }
)
"""Maps of each plane, and the first of the plane's four components that each takes."""
PLANE_OF_MAP: Final[Mapping[MapName, Plane]] = MappingProxyType(
    {name: plane for plane, places in PLANE_COMPONENTS.items() for name in places}
)
LARGEST_CHANNELS: Final = 13
"""Channels of a material set at most: all maps, with a base of four channels."""


def ordered_maps(maps: Sequence[MapName]) -> bool:
    """Return whether `maps` are some of CODED_MAPS, each once, in their order."""
    return bool(maps) and list(maps) == [name for name in CODED_MAPS if name in maps]


def is_material(maps: Sequence[MapName]) -> bool:
    """Return whether `maps` are more than a base colour and its alpha."""
    return any(name not in ("base", "alpha") for name in maps)


def map_slices(maps: Sequence[MapName], channels: int) -> dict[MapName, slice]:
    """Return the slice of each of `maps` among the `channels` channels of a texture. `base` takes what the other maps leave: 1 to 4.

    Raises ValueError for maps that are not in the order of MAPS, and for channels that are too few or too many for them.
    """
    if not ordered_maps(maps):
        raise ValueError(f"maps {', '.join(maps) or 'of none'}: name each once, in the order {', '.join(CODED_MAPS)}")
    counts = {name: MAP_CHANNELS[name] for name in maps}
    left = channels - sum(count for name, count in counts.items() if name != "base")
    if not (1 <= left <= 4 if "base" in counts else left == 0):
        raise ValueError(f"{channels} channels do not fit the maps {', '.join(maps)}")
    if "base" in counts:
        counts["base"] = left
    slices: dict[MapName, slice] = {}
    first = 0
    for name, count in counts.items():
        slices[name] = slice(first, first + count)
        first += count
    return slices


def plane_channels(maps: Sequence[MapName], channels: int) -> dict[Plane, dict[int, int]]:
    """Return, for each plane that has maps, its components (0 to 3) and the channel of the texture that each shows."""
    found: dict[Plane, dict[int, int]] = {}
    for name, place in map_slices(maps, channels).items():
        plane = PLANE_OF_MAP[name]
        first = PLANE_COMPONENTS[plane][name]
        components = found.setdefault(plane, {})
        components.update({first + number: channel for number, channel in enumerate(range(place.start, place.stop))})
    return {plane: found[plane] for plane in CODED_PLANES if plane in found}


def maps_fit(maps: Sequence[MapName], channels: int) -> bool:
    """Return whether a texture of `channels` channels can have `maps`."""
    try:
        map_slices(maps, channels)
    except ValueError:
        return False
    return True


def channel_places(
    maps: Sequence[MapName], channels: int, codec_maps: Sequence[MapName], codec_channels: int
) -> tuple[int, ...]:
    """Return, for each channel of a texture of `maps`, the channel that stands for it in a codec of `codec_maps` with `codec_channels`
    channels, rising.

    A base takes the first channels of the codec's. Raises ValueError for a map, or a channel of the base, that the codec lacks.
    """
    codec = map_slices(codec_maps, codec_channels)
    places: list[int] = []
    for name, own in map_slices(maps, channels).items():
        place = codec.get(name)
        count = own.stop - own.start
        if place is None or count > place.stop - place.start:
            raise ValueError(f"{count} channels of map {name}: the codec has none, or fewer")
        places.extend(range(place.start, place.start + count))
    return tuple(places)


def joint_maps(kinds: Iterable[tuple[Sequence[MapName], int]]) -> tuple[tuple[MapName, ...], int]:
    """Return (maps, channels) of a codec for textures of these maps and channels: all maps that any of them has, and the largest
    base."""
    counts: dict[MapName, int] = {}
    for maps, channels in kinds:
        for name, place in map_slices(maps, channels).items():
            counts[name] = max(counts.get(name, 0), place.stop - place.start)
    return tuple(name for name in CODED_MAPS if name in counts), sum(counts.values())


MapWeightsName = Literal["seen", "equal"]
LEAST_WEIGHT, LARGEST_WEIGHT = 0.01, 100.0


@dataclass(frozen=True)
class MapWeights:
    """Weights of the squared error of a stored value, by map. Only ratios matter. Decoding knows nothing of them."""

    base: float = 1.0
    normal: float = 1.0
    roughness: float = 1.0
    metalness: float = 1.0
    emissive: float = 1.0
    occlusion: float = 1.0
    alpha: float = 1.0

    def __post_init__(self) -> None:
        for field in fields(self):
            if not LEAST_WEIGHT <= getattr(self, field.name) <= LARGEST_WEIGHT:
                raise ValueError(f"map_weights.{field.name} = {getattr(self, field.name)!r} is out of range")

    def of_channels(self, maps: Sequence[MapName], channels: int) -> NDArray[np.float64]:
        """Return [channels] float64 of a texture of `maps`: their mean is 1."""
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
