"""What path `on-load` compresses of a pack: formats of a plane's maps, arrays of textures, and pieces of mips, coarse ones first."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np
from numpy.typing import NDArray

from ntc.codec.latents import LatentLevel, texture_levels
from ntc.codec.maps import MAP_TABLE, MapName, Plane, plane_channels
from ntc.codec.model import Pack
from ntc.pack.match import PackMatch
from viewer.gl.texture_arrays import BLOCK_BYTES, GpuBlockFormat
from viewer.render.resources.image_places import LAYERS_AT_MOST, ImageArrayPlan
from viewer.render.resources.layout import TILE_SIDE
from viewer.scene.model import Material, Sampler

ARRAY_BYTES = 1 << 27
"""Size limit in bytes of an array of compressed textures, unless one layer takes more."""
PIECE_TILES = 896
"""Most tiles of a piece of a mip, unless one row of tiles is longer: about as many as a layer of the atlas holds."""


FORMAT_OF_CHANNELS: dict[int, GpuBlockFormat] = {1: "bc4", 2: "bc5", 3: "bc7"}


@dataclass(frozen=True)
class StoredPart:
    """Components of a plane that are stored in one texture."""

    block_format: GpuBlockFormat
    components: range
    """Components of the plane's four."""


def stored_parts(plane: Plane, maps: Sequence[MapName], channels: int) -> tuple[StoredPart, ...]:
    """Return the one or two textures that hold a plane of textures with these maps and channels; none where they have none of it.

    Colours are in BC7, normals in BC5, roughness and metalness in BC5 or, where one of them is alone, in BC4, occlusion in BC4.
    """
    components_held = plane_channels(maps, channels).get(plane, {})
    held = [each for each in MAP_TABLE if each.plane == plane and each.component in components_held]
    parts: list[StoredPart] = []
    for each in held:
        components = range(each.component, each.component + each.channels)
        if plane == "base":
            parts.append(StoredPart("bc7", range(4)))
        elif each.channels == 1 and parts and parts[-1] == StoredPart("bc4", range(each.component - 1, each.component)):
            parts[-1] = StoredPart("bc5", range(each.component - 1, each.component + 1))
        else:
            parts.append(StoredPart(FORMAT_OF_CHANNELS[each.channels], components))
    return tuple(parts)


@dataclass(frozen=True)
class LoadedKey:
    """Texture of the scene, as materials with one sampler read it."""

    texture: int
    sampler: Sampler


@dataclass(frozen=True)
class MipRows:
    """Rows of tiles of a mip."""

    key: LoadedKey
    level: int
    top: int
    """First row of tiles."""
    rows: int
    across: int
    """Number of tiles in a row."""
    size: tuple[int, int]
    """Size in texels."""

    @property
    def tiles(self) -> int:
        """Number of tiles."""
        return self.rows * self.across

    @property
    def texels(self) -> int:
        """Number of texels."""
        return self.size[0] * self.size[1]


@dataclass(frozen=True, eq=False)
class LoadPlan:
    """Places of the textures of one plane of a pack, and their mips."""

    parts: tuple[StoredPart, ...]
    arrays: Mapping[int, ImageArrayPlan]
    """Arrays by number."""
    places: Mapping[LoadedKey, tuple[int, int]]
    """(array, layer) of each texture."""
    levels: Mapping[int, tuple[LatentLevel, ...]]
    """Mips by texture of the scene, the finest first."""
    keys: Mapping[int, LoadedKey]
    """Texture by material; materials that read none are absent."""
    materials: int
    """Number of materials of the scene."""

    @staticmethod
    def of(materials: Sequence[Material], pack: Pack, match: PackMatch, plane: Plane) -> "LoadPlan":
        """Make the plan of all materials whose texture `pack` holds in a plane."""
        keys: dict[int, LoadedKey] = {}
        levels: dict[int, tuple[LatentLevel, ...]] = {}
        members: dict[tuple[tuple[int, int], Sampler], list[LoadedKey]] = defaultdict(list)
        for number, material in enumerate(materials):
            own = material.plane(plane)
            index = match.texture_index[own.texture_id] if own is not None else -1
            if own is None or index < 0:
                continue
            texture = pack.textures[index]
            if plane not in plane_channels(texture.maps, texture.channels):
                continue
            key = keys[number] = LoadedKey(own.texture_id, own.sampler)
            levels[own.texture_id] = tuple(texture_levels(texture, pack.config))
            same = members[(texture.width, texture.height), own.sampler]
            if key not in same:
                same.append(key)
        parts = stored_parts(plane, pack.config.maps, pack.config.output_channels)
        texel_bytes = sum(BLOCK_BYTES[part.block_format] for part in parts) / 16
        arrays: dict[int, ImageArrayPlan] = {}
        places: dict[LoadedKey, tuple[int, int]] = {}
        numbers = count()
        for (size, sampler), same in members.items():
            fitting = int(ARRAY_BYTES / (size[0] * size[1] * texel_bytes * 4 / 3))
            most = min(LAYERS_AT_MOST, max(1, fitting))
            for start in range(0, len(same), most):
                layers = same[start : start + most]
                number = next(numbers)
                arrays[number] = ImageArrayPlan(size, sampler, len(layers))
                places |= {key: (number, layer) for layer, key in enumerate(layers)}
        return LoadPlan(parts, arrays, places, levels, keys, len(materials))

    def wanted(self, materials: Iterable[int]) -> dict[LoadedKey, None]:
        """Return the textures of these materials, each once, in their order."""
        return dict.fromkeys(self.keys[number] for number in materials if number in self.keys)

    def pieces(self, key: LoadedKey) -> list[MipRows]:
        """Return the pieces of all mips of a texture, the coarsest mip first."""
        found = []
        for number, level in reversed(list(enumerate(self.levels[key.texture]))):
            width, height = level.texel_width, level.texel_height
            across, down = -(-width // TILE_SIDE), -(-height // TILE_SIDE)
            rows = max(1, PIECE_TILES // across)
            for top in range(0, down, rows):
                own = min(rows, down - top)
                size = (width, min(own * TILE_SIDE, height - top * TILE_SIDE))
                found.append(MipRows(key, number, top, own, across, size))
        return found


def tile_grid(piece: MipRows) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return [tiles] columns and rows of a piece's tiles in their mip, row by row."""
    number = np.arange(piece.tiles)
    return number % piece.across, piece.top + number // piece.across
