"""Whole materials in block formats: which pictures there are, what hardware reads back of each map, and what they take."""

import numpy as np
import pytest

from ntc.codec.maps import MAP_CHANNELS, MAPS, PLANES, MapName
from ntc.metrics.block_compression import BlockFormat
from ntc.metrics.compressed_textures import compress_texture
from tests.support.picture_scenes import as_set, scene_of, texture_of
from viewer.scene.map_pictures import (
    compressed_plane_mips,
    compressed_scene,
    compression_requests,
    map_pictures,
    plane_mips,
)
from viewer.scene.model import SceneTexture

pytest.importorskip("quicktex", reason="block encoders are not installed (extra: lab)")
SIDE = 32


def smooth(channels: int, seed: int) -> np.ndarray:
    """[SIDE, SIDE, channels] uint8 that changes slowly, as maps do."""
    rows, columns = np.indices((SIDE, SIDE)) / SIDE
    parts = [
        128 + 90 * np.sin(3.0 * rows + seed + number) * np.cos(2.0 * columns + number) for number in range(channels)
    ]
    return np.stack(parts, axis=2).astype(np.uint8)


def material_set(maps: tuple[MapName, ...]) -> SceneTexture:
    """A set of smooth maps."""
    further: dict[MapName, np.ndarray] = {
        name: smooth(MAP_CHANNELS[name], place) for place, name in enumerate(maps) if name != "base"
    }
    return as_set(texture_of(smooth(3, 7)), maps, further)


@pytest.mark.parametrize("block_format", ["bc1", "bc7", "astc-6x6"])
@pytest.mark.parametrize(
    "maps", [MAPS, ("base", "normal"), ("normal", "roughness", "metalness"), ("base", "occlusion")]
)
def test_hardware_reads_every_map_back(block_format: BlockFormat, maps: tuple[MapName, ...]) -> None:
    texture = material_set(maps)
    scene = scene_of([], [], [texture, material_set(("base",))])
    requests = compression_requests(scene, block_format, None)
    found = compressed_scene(block_format, requests, [compress_texture(one) for own in requests for one in own])
    assert len(found.further[0]) == len(map_pictures(texture)) - 1
    assert found.further[1] == ()
    sizes = [picture.stored_bytes for picture in (*found.textures, *found.further[0])]
    assert found.stored_bytes == sum(sizes)
    for plane in PLANES:
        if not any(name in maps for name in {"base": ("base",), "surface": MAPS[1:4], "emission": MAPS[4:]}[plane]):
            continue
        original, read = plane_mips(texture, plane), compressed_plane_mips(found, 0, plane)
        assert [mip.shape for mip in read] == [mip.shape for mip in original]
        for mine, theirs in zip(read[:2], original[:2], strict=True):
            assert np.abs(mine.astype(int) - theirs).mean() < 9.0, plane
