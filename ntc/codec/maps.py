"""The maps of a material, and where each lies among the channels of a material set and in the planes that it is decoded by.

A material set is encoded as one texture whose channels are those of its maps, in the order of CODED_MAPS. Renderers decode it by
planes of up to four channels, so that a view decodes only what it needs.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

ShownMap = Literal["base", "normal", "roughness", "metalness", "emissive", "occlusion"]
MapName = Literal[ShownMap, "alpha"]
"""`base` and `emissive` are sRGB colours, `normal` the xy of a tangent-space normal as (n + 1) / 2; all others are linear."""
Plane = Literal["base", "surface", "emission", "coverage"]


@dataclass(frozen=True)
class MaterialMap:
    """A map: its channels, its place in the planes, how glTF names it, and how it is filtered and weighed."""

    name: MapName
    channels: int
    plane: Plane
    component: int
    """First component of the plane that it takes, 0 to 3."""
    color_space: Literal["srgb", "linear"] = "linear"
    neutral: float = 1.0
    """Value of all its channels, 0 to 1, where a texture lacks the map."""
    is_direction: bool = False
    """True if its channels are the xy of a unit vector, which is filtered as one."""
    gltf: tuple[str, ...] = ()
    """Places where a glTF material names its texture (glTF 2.0, Sec. 3.9); of several places the last one that is there."""
    gltf_channels: tuple[int, ...] = ()
    """Channels of that texture that hold it."""
    picture: str = ""
    """Picture that block formats store it in, together with the other maps of that picture; "" for a map that they do not store."""
    weight: float = 1.0
    """Weight of a squared error by how much it changes the lit picture."""


_ORM = "pbrMetallicRoughness.metallicRoughnessTexture"
_BASE = ("pbrMetallicRoughness.baseColorTexture", "extensions.KHR_materials_pbrSpecularGlossiness.diffuseTexture")
MAP_TABLE: Final = (
    MaterialMap("base", 3, "base", 0, "srgb", gltf=_BASE, gltf_channels=(0, 1, 2), picture="base"),
    MaterialMap("normal", 2, "surface", 0, "linear", 0.5, True, ("normalTexture",), (0, 1), "normal", 2.5),
    MaterialMap("roughness", 1, "surface", 2, gltf=(_ORM,), gltf_channels=(1,), picture="orm", weight=0.5),
    MaterialMap("metalness", 1, "surface", 3, gltf=(_ORM,), gltf_channels=(2,), picture="orm"),
    MaterialMap("emissive", 3, "emission", 0, "srgb", 1.0, False, ("emissiveTexture",), (0, 1, 2), "emissive"),
    MaterialMap("occlusion", 1, "emission", 3, "linear", 1.0, False, ("occlusionTexture",), (0,), "orm", 0.5),
    MaterialMap("alpha", 1, "coverage", 0),
)
"""All maps of a material set, in the order of their channels: what is said of maps elsewhere is made from it. `base` is 1 to 4
channels, alpha last, in a texture that is no material set. ntc/c/ntc.c repeats names, channels and planes."""
TABLE_OF_MAP: Final[Mapping[MapName, MaterialMap]] = MappingProxyType({each.name: each for each in MAP_TABLE})
CODED_MAPS: Final[tuple[MapName, ...]] = tuple(TABLE_OF_MAP)
"""All maps of a material set: MAPS, and alpha, which says what of a surface is there."""
MAPS: Final[tuple[ShownMap, ...]] = tuple(name for name in CODED_MAPS if name != "alpha")
"""The maps that views show."""
MAP_CHANNELS: Final[Mapping[MapName, int]] = MappingProxyType({each.name: each.channels for each in MAP_TABLE})
SRGB_MAPS: Final = frozenset(each.name for each in MAP_TABLE if each.color_space == "srgb")
"""Maps that hold colours in sRGB values."""
BASE_ALONE: Final[tuple[MapName, ...]] = ("base",)
"""The maps of a texture that is no material set."""
PLANE_OF_MAP: Final[Mapping[MapName, Plane]] = MappingProxyType({each.name: each.plane for each in MAP_TABLE})
CODED_PLANES: Final[tuple[Plane, ...]] = tuple(dict.fromkeys(PLANE_OF_MAP.values()))
"""All planes of a material set."""
PLANES: Final[tuple[Plane, ...]] = tuple(plane for plane in CODED_PLANES if plane != "coverage")
"""The planes that views show, in their order on the GPU."""
PLANE_COMPONENTS: Final[Mapping[Plane, Mapping[MapName, int]]] = MappingProxyType(
    {
        plane: MappingProxyType({each.name: each.component for each in MAP_TABLE if each.plane == plane})
        for plane in CODED_PLANES
    }
)
"""Maps of each plane, and the first of the plane's four components that each takes."""
LARGEST_CHANNELS: Final = sum(MAP_CHANNELS.values()) + 1
"""Channels of a material set at most: all maps, with a base of four channels."""


def neutral_plane(plane: Plane) -> tuple[float, float, float, float]:
    """Return the four components of a plane whose maps a texture lacks."""
    values = [1.0] * 4
    for each in MAP_TABLE:
        if each.plane == plane:
            values[each.component : each.component + each.channels] = [each.neutral] * each.channels
    red, green, blue, alpha = values
    return red, green, blue, alpha


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

    weights: Mapping[MapName, float] = field(default_factory=dict)
    """Maps that are not named have weight 1."""

    def __post_init__(self) -> None:
        for name, weight in self.weights.items():
            if not LEAST_WEIGHT <= weight <= LARGEST_WEIGHT:
                raise ValueError(f"map_weights.{name} = {weight!r} is out of range")

    def of_channels(self, maps: Sequence[MapName], channels: int) -> NDArray[np.float64]:
        """Return [channels] float64 of a texture of `maps`: their mean is 1."""
        found = np.ones(channels)
        for name, place in map_slices(maps, channels).items():
            found[place] = self.weights.get(name, 1.0)
        return np.asarray(found / found.mean())


SEEN_WEIGHTS: Final = MapWeights({each.name: each.weight for each in MAP_TABLE})
EQUAL_WEIGHTS: Final = MapWeights()
MAP_WEIGHTS: Final[Mapping[MapWeightsName, MapWeights]] = MappingProxyType(
    {"seen": SEEN_WEIGHTS, "equal": EQUAL_WEIGHTS}
)
"""Presets. `seen`: by how much an error changes the lit picture. `equal`: the mean square error of all channels."""
