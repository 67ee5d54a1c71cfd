"""Plan of path `on-load`: the block formats of a plane's maps, the texture arrays, and the order of compression.

Path `on-load` decodes each texture once and compresses it to BC7, BC5 or BC4, which the hardware samples. Textures of equal size and
sampler share an array of at most ARRAY_BYTES, because an array is allocated as a whole. The work is cut into pieces of at most
PIECE_TILES tiles: one or more rows of tiles of a mip. A piece is decoded into a tile atlas, compressed there, and copied to its array.
Pieces of coarse mips come first, so a texture is visible soon, and sharper with each frame. See
docs/explanation/decode-paths.md#path-on-load-block-compression-on-the-gpu.
"""

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
"""Size limit of an array of compressed textures in bytes, unless one layer is larger."""
PIECE_TILES = 896
"""Most tiles of a piece, unless one row of tiles is longer. A layer of the atlas holds about so many."""


FORMAT_OF_CHANNELS: dict[int, GpuBlockFormat] = {1: "bc4", 2: "bc5", 3: "bc7"}


@dataclass(frozen=True)
class StoredPart:
    """Components of a plane that one compressed texture stores."""

    block_format: GpuBlockFormat
    components: range
    """Range among the plane's four components."""


def stored_parts(plane: Plane, maps: Sequence[MapName], channels: int) -> tuple[StoredPart, ...]:
    """Return the compressed textures, up to two, that store a plane of textures with these maps and channels.

    Formats: BC7 for colours, BC5 for normals, BC5 for roughness and metalness (BC4 for only one of them), BC4 for occlusion.
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
    """Texture of the scene with one sampler."""

    texture: int
    sampler: Sampler


@dataclass(frozen=True)
class MipRows:
    """Piece of a mip: some rows of tiles."""

    key: LoadedKey
    level: int
    top: int
    """First row of tiles."""
    rows: int
    across: int
    """Number of tiles in a row."""
    size: tuple[int, int]
    """(width, height) in texels."""

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
    """Places and mips of the textures of one plane of a pack."""

    parts: tuple[StoredPart, ...]
    arrays: Mapping[int, ImageArrayPlan]
    """Arrays by number."""
    places: Mapping[LoadedKey, tuple[int, int]]
    """(array, layer) of each texture."""
    levels: Mapping[int, tuple[LatentLevel, ...]]
    """Mips by texture id of the scene, the finest first."""
    keys: Mapping[int, LoadedKey]
    """Texture by material; materials that read none are absent."""
    materials: int
    """Number of materials of the scene."""

    @staticmethod
    def of(materials: Sequence[Material], pack: Pack, match: PackMatch, plane: Plane) -> "LoadPlan":
        """Make the plan for all materials whose texture in this plane is in `pack`."""
        keys: dict[int, LoadedKey] = {}
        levels: dict[int, tuple[LatentLevel, ...]] = {}
        members: dict[tuple[tuple[int, int], Sampler], list[LoadedKey]] = defaultdict(list)
        for number, material in enumerate(materials):
            plane_texture = material.plane(plane)
            index = match.texture_index[plane_texture.texture_id] if plane_texture is not None else -1
            if plane_texture is None or index < 0:
                continue
            texture = pack.textures[index]
            if plane not in plane_channels(texture.maps, texture.channels):
                continue
            key = keys[number] = LoadedKey(plane_texture.texture_id, plane_texture.sampler)
            levels[plane_texture.texture_id] = tuple(texture_levels(texture, pack.config))
            same = members[(texture.width, texture.height), plane_texture.sampler]
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
        """Return the pieces of all mips of a texture, the coarsest first."""
        pieces = []
        for number, level in reversed(list(enumerate(self.levels[key.texture]))):
            width, height = level.texel_width, level.texel_height
            across, down = -(-width // TILE_SIDE), -(-height // TILE_SIDE)
            rows = max(1, PIECE_TILES // across)
            for top in range(0, down, rows):
                row_count = min(rows, down - top)
                size = (width, min(row_count * TILE_SIDE, height - top * TILE_SIDE))
                pieces.append(MipRows(key, number, top, row_count, across, size))
        return pieces


def tile_grid(piece: MipRows) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return [tiles] columns and rows of a piece's tiles in their mip, row by row."""
    number = np.arange(piece.tiles)
    return number % piece.across, piece.top + number // piece.across
