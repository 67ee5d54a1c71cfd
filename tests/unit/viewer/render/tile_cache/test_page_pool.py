"""Pages of the tile atlas: nothing that is seen goes, what was seen longest ago goes first."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from viewer.render.tile_cache.tiles import PagePool


def entries(*numbers: int) -> NDArray[np.int64]:
    """These entries."""
    return np.array(numbers, np.int64)


def never_asked() -> NDArray[np.uint32]:
    """Stands for a read-back that must not happen."""
    raise AssertionError("read back without need")


def test_free_pages_come_first_and_ask_nothing() -> None:
    pool = PagePool(3)
    pages, gone = pool.place(entries(7, 9), 1, never_asked)
    assert pages.tolist() == [0, 1]
    assert gone.tolist() == []
    assert (pool.taken, pool.reach(0)) == (2, 2)


def test_the_tile_that_was_read_longest_ago_goes() -> None:
    pool = PagePool(3)
    pool.place(entries(1, 2, 3), 1, never_asked)
    pages, gone = pool.place(entries(4), 5, lambda: np.array([4, 2, 5], np.uint32))
    assert pages.tolist() == [1]
    assert gone.tolist() == [2]
    assert sorted(pool.held().tolist()) == [1, 3, 4]


def test_what_this_frame_reads_or_has_just_placed_stays() -> None:
    pool = PagePool(2)
    pool.place(entries(1), 5, never_asked)
    pages, gone = pool.place(entries(2, 3, 4), 5, lambda: np.zeros(2, np.uint32))
    assert pages.tolist() == [1]
    assert gone.tolist() == []
    pages, gone = pool.place(entries(5), 6, lambda: np.array([6, 6], np.uint32))
    assert (pages.tolist(), gone.tolist()) == ([], [])


def test_dropped_tiles_leave_room() -> None:
    pool = PagePool(2)
    pool.place(entries(1, 2), 1, never_asked)
    pool.drop(entries(1, 99))
    assert pool.taken == 1
    pages, _ = pool.place(entries(3), 2, never_asked)
    assert pages.tolist() == [0]


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
        missing = entries(*sorted(wanted - where.keys()))
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
