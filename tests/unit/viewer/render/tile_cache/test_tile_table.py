"""Tiles of a scene's textures: which of them stand in for others."""

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc.pack.match import PackMatch
from tests.support.picture_scenes import texture
from viewer.render.tile_cache.tiles import TileTable
from viewer.scene.model import Material

SIZES = ((256, 128), (16, 16), (32, 512), (70, 70))


@pytest.fixture(scope="module")
def table() -> TileTable:
    pack = random_pack(list(SIZES), (0, 0, 1, 1), hashes=[texture(seed=n).pixel_hash for n in range(len(SIZES))])
    materials = tuple(Material(str(index), index, (1.0, 1.0, 1.0, 1.0)) for index in range(len(SIZES)))
    return TileTable.of(materials, pack, PackMatch(tuple(range(len(SIZES))), (), ()))


def test_the_first_single_tile_and_the_coarsest_mip_stand_in(table: TileTable) -> None:
    firsts = table.first_level_of_material.astype(np.int64)
    for number, first in enumerate(firsts):
        last = (*firsts[1:], len(table.levels))[number] - 1
        single = next((row for row in range(first, last + 1) if table.single_of_level[row]), last)
        expected = sorted({int(table.levels["first_entry"][row]) for row in (single, last)})
        assert table.stand_ins(firsts[number : number + 1]).tolist() == expected
    everything = table.stand_ins(firsts)
    assert sorted(set(table.textures(everything).tolist())) == firsts.tolist()
    assert len(table.stand_ins(firsts[:0])) == 0


def test_entries_belong_to_the_texture_of_their_level(table: TileTable) -> None:
    entries = np.arange(table.entries)
    firsts = table.textures(entries)
    assert (np.diff(firsts) >= 0).all()
    np.testing.assert_array_equal(table.texture_of_level[firsts], table.tiles(entries)["texture_id"])
