"""How long a frame may decode for tiles."""

from viewer.tile_cache import LEAST_MILLISECONDS, TileCacheConfig, TilePace


def test_long_frames_leave_less_time_to_tiles_and_short_ones_more_again() -> None:
    pace = TilePace(TileCacheConfig(milliseconds=25.0))
    for _ in range(4):
        pace.note_frame(80.0)
    assert pace.milliseconds is not None
    assert pace.milliseconds < 5.0
    for _ in range(20):
        pace.note_frame(500.0)
    assert pace.milliseconds == LEAST_MILLISECONDS
    for _ in range(20):
        pace.note_frame(10.0)
    assert pace.milliseconds == 25.0


def test_what_has_no_limit_keeps_none() -> None:
    pace = TilePace(TileCacheConfig())
    pace.note_frame(1000.0)
    assert pace.milliseconds is None


def test_a_limit_below_the_least_stays() -> None:
    pace = TilePace(TileCacheConfig(milliseconds=1.0))
    pace.note_frame(1000.0)
    assert pace.milliseconds == 1.0
