"""The tile cache: pages, time for tiles, and which tiles stand in for others."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from lab.bench.random_pack import random_pack
from ntc.pack.match import PackMatch
from tests.support.picture_scenes import texture
from viewer.render.resources.tile_cache.budget import (
    FRAME_MS,
    LEAST_MILLISECONDS,
    LEAST_SHARE,
    TileBudget,
    TileCacheConfig,
)
from viewer.render.resources.tile_cache.tiles import PagePool, TileTable
from viewer.scene.model import Material


def numbers(*numbers: int) -> NDArray[np.int64]:
    """These entries."""
    return np.array(numbers, np.int64)


def never_asked() -> NDArray[np.uint32]:
    """Stands for a read-back that must not happen."""
    raise AssertionError("read back without need")


def test_the_tile_that_was_read_longest_ago_goes() -> None:
    pool = PagePool(3)
    pool.place(numbers(1, 2, 3), 1, never_asked)
    pages, gone = pool.place(numbers(4), 5, lambda: np.array([4, 2, 5], np.uint32))
    assert pages.tolist() == [1]
    assert gone.tolist() == [2]
    assert sorted(pool.held().tolist()) == [1, 3, 4]


def test_what_this_frame_reads_or_has_just_placed_stays() -> None:
    pool = PagePool(2)
    pool.place(numbers(1), 5, never_asked)
    pages, gone = pool.place(numbers(2, 3, 4), 5, lambda: np.zeros(2, np.uint32))
    assert pages.tolist() == [1]
    assert gone.tolist() == []
    pages, gone = pool.place(numbers(5), 6, lambda: np.array([6, 6], np.uint32))
    assert (pages.tolist(), gone.tolist()) == ([], [])


@given(
    pages=st.integers(1, 8),
    frames=st.lists(st.sets(st.integers(0, 30), min_size=1, max_size=10), min_size=1, max_size=12),
)
@settings(max_examples=60, deadline=None)
def test_no_page_holds_two_tiles_and_none_is_lost(pages: int, frames: list[set[int]]) -> None:
    pool, where, read = PagePool(pages), dict[int, int](), np.zeros(pages, np.uint32)
    for frame, wanted in enumerate(frames, start=1):
        for entry in wanted & where.keys():
            read[where[entry]] = frame
        missing = numbers(*sorted(wanted - where.keys()))
        placed, gone = pool.place(missing, frame, lambda: read)
        assert not set(gone.tolist()) & wanted
        for entry in gone.tolist():
            del where[entry]
        where |= dict(zip(missing.tolist(), placed.tolist(), strict=False))
        assert len(set(where.values())) == len(where) == pool.taken
        assert len(placed) == len(missing) or len(where) == pages
        assert set(pool.held().tolist()) == set(where)


def test_a_pool_needs_a_page() -> None:
    with pytest.raises(ValueError, match="page"):
        PagePool(0)


def paced(rest: float, limit: float | None = 25.0, frames: int = 20) -> float | None:
    """Time for tiles after frames that took `rest` ms besides."""
    budget = TileBudget(TileCacheConfig(milliseconds=limit))
    for _ in range(frames):
        budget.note_tiles(5.0)
        budget.note_tiles(2.0)
        budget.note_frame(rest + 7.0)
    return budget.milliseconds


def test_tiles_get_what_the_rest_of_a_frame_leaves() -> None:
    assert paced(2.0) == pytest.approx(FRAME_MS - 2.0, abs=1e-3)
    assert paced(15.0) == pytest.approx(FRAME_MS - 15.0, abs=1e-3)
    assert paced(2.0, limit=10.0) == pytest.approx(10.0, abs=1e-3)


def test_where_the_rest_is_long_tiles_get_a_share_of_it() -> None:
    assert paced(120.0) == pytest.approx(LEAST_SHARE * 120.0, abs=1e-3)
    assert paced(1000.0) == pytest.approx(25.0, abs=1e-3)
    assert min(paced(rest) or 0.0 for rest in range(60)) >= LEAST_MILLISECONDS


SIZES = ((256, 128), (16, 16), (32, 512), (70, 70))


@pytest.fixture(scope="module")
def table() -> TileTable:
    pack = random_pack(list(SIZES), (0, 0, 1, 1), hashes=[texture(seed=n).pixel_hash for n in range(len(SIZES))])
    materials = tuple(Material(str(index), index, (1.0, 1.0, 1.0, 1.0)) for index in range(len(SIZES)))
    return TileTable.of(materials, pack, PackMatch(tuple(range(len(SIZES))), (), ()))
