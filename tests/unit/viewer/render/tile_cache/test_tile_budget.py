"""How long a frame may decode for tiles."""

import pytest

from viewer.render.tile_cache.budget import FRAME_MS, LEAST_MILLISECONDS, LEAST_SHARE, TileBudget, TileCacheConfig


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


def test_one_long_frame_changes_little() -> None:
    budget = TileBudget(TileCacheConfig(milliseconds=25.0))
    budget.note_frame(32.0)
    assert budget.milliseconds == pytest.approx(0.5 * (25.0 + LEAST_MILLISECONDS))


def test_what_has_no_limit_keeps_none_and_a_small_one_stays() -> None:
    assert paced(1000.0, limit=None) is None
    assert paced(1000.0, limit=1.0) == 1.0
