"""Maps of textures in the layouts that hardware reads: planes that shaders sample, and pictures that block formats compress."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import MAP_CHANNELS, MAP_TABLE, PLANE_COMPONENTS, MapName, Plane, map_slices
from ntc.codec.mips import mip_chain
from ntc.metrics.block_compression import BlockFormat
from ntc.metrics.compressed_textures import CompressedTexture, CompressedTextures, CompressionRequest
from viewer.scene.model import Scene, SceneTexture

PICTURES: tuple[tuple[MapName, ...], ...] = tuple(
    tuple(each.name for each in MAP_TABLE if each.picture == picture)
    for picture in dict.fromkeys(each.picture for each in MAP_TABLE if each.picture)
)
"""Groups of maps that share a picture of a block format."""
Requests = tuple[tuple[CompressionRequest, ...], ...]
NEUTRAL = 255
"""Value of components that a texture lacks; nothing reads them."""


def pictures_of(maps: Sequence[MapName]) -> tuple[tuple[MapName, ...], ...]:
    """Return the maps of each picture of a texture with these maps."""
    present = (tuple(name for name in picture if name in maps) for picture in PICTURES)
    return tuple(picture for picture in present if picture)


def map_pictures(texture: SceneTexture) -> dict[tuple[MapName, ...], NDArray[np.uint8]]:
    """Return the pictures [H, W, 1 to 3] uint8 of `texture`, by their maps."""
    pictures: dict[tuple[MapName, ...], NDArray[np.uint8]] = {}
    for maps in pictures_of(texture.maps):
        if maps == ("base",):
            pictures[maps] = texture.pixels
        else:
            pixels = np.concatenate([texture.further_maps[name] for name in maps], axis=2)
            # Block formats read the second of two channels as alpha, except in pictures of normals.
            unused = int(pixels.shape[2] == 2 and maps != ("normal",))
            pictures[maps] = np.pad(pixels, ((0, 0), (0, 0), (0, unused)))
    return pictures


def compression_requests(scene: Scene, block_format: BlockFormat, cache: Path | None) -> Requests:
    """Return the compression requests of each texture: one for each of its pictures, the base colour first."""
    return tuple(
        tuple(
            CompressionRequest(np.ascontiguousarray(pixels), block_format, cache, maps=maps)
            for maps, pixels in map_pictures(texture).items()
        )
        for texture in scene.textures
    )


def compressed_scene(
    block_format: BlockFormat, requests: Requests, compressed: Sequence[CompressedTexture]
) -> CompressedTextures:
    """Return the compressed textures of a scene from `compressed`, the results of all `requests` in order."""
    rest = iter(compressed)
    pictures = [tuple(next(rest) for _ in of_texture) for of_texture in requests]
    return CompressedTextures(
        block_format, tuple(of_texture[0] for of_texture in pictures), tuple(of_texture[1:] for of_texture in pictures)
    )


def plane_of_maps(plane: Plane, chains: Mapping[MapName, Sequence[NDArray[np.uint8]]]) -> tuple[NDArray[np.uint8], ...]:
    """Return all mips [h, w, 4] uint8 of a plane other than `base`, put together from the mips [h, w, channels] of its maps."""
    places = PLANE_COMPONENTS[plane]
    chosen = {name: chain for name, chain in chains.items() if name in places}
    mips = []
    for parts in zip(*chosen.values(), strict=True):
        whole = np.full((*parts[0].shape[:2], 4), NEUTRAL, np.uint8)
        for name, part in zip(chosen, parts, strict=True):
            whole[..., places[name] : places[name] + part.shape[2]] = part
        mips.append(whole)
    return tuple(mips)


def plane_mips(texture: SceneTexture, plane: Plane) -> tuple[NDArray[np.uint8], ...]:
    """Return all mips, down to 1x1 texel, of a plane that `texture` has maps of.

    Mips of the base colour are [h, w, 3] uint8 sRGB; those of other planes [h, w, 4] uint8, the plane's four components. Each map is
    filtered by its kind (`ntc.codec.mips`): normals stay unit vectors.
    """
    if plane == "base":
        return mip_chain(texture.pixels, "srgb")
    maps = tuple(name for name in texture.maps if name in PLANE_COMPONENTS[plane])
    pixels = np.concatenate([texture.further_maps[name] for name in maps], axis=2)
    mips = mip_chain(pixels, "srgb", maps)
    chains: dict[MapName, list[NDArray[np.uint8]]] = {
        name: [mip[..., place] for mip in mips] for name, place in map_slices(maps, pixels.shape[2]).items()
    }
    return plane_of_maps(plane, chains)


def compressed_plane_mips(
    compressed: CompressedTextures, texture_id: int, plane: Plane
) -> tuple[NDArray[np.uint8], ...]:
    """Return the mips of a plane in the layout of `plane_mips`, decoded from the compressed blocks of a texture."""
    pictures = (compressed.textures[texture_id], *compressed.further[texture_id])
    if plane == "base":
        return pictures[0].mips()
    chains: dict[MapName, list[NDArray[np.uint8]]] = {}
    for picture in pictures:
        if any(name in PLANE_COMPONENTS[plane] for name in picture.maps):
            mips = picture.mips()
            for name, place in map_slices(picture.maps, sum(MAP_CHANNELS[name] for name in picture.maps)).items():
                chains[name] = [mip[..., place] for mip in mips]
    return plane_of_maps(plane, chains)
