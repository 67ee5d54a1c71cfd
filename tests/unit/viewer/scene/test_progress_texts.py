"""The time left and the percentage of work under way."""

import pytest

from viewer.scene.json_text import percent, time_left


@pytest.mark.parametrize(
    ("seconds", "share", "first", "left"),
    [
        (10.0, 0.05, 0.0, None),
        (10.0, 0.25, 0.0, 30.0),
        (10.0, 0.999, 0.0, 1.0),
        (10.0, 1.0, 0.0, None),
        (10.0, 0.55, 0.5, None),
        (5.0, 0.75, 0.5, 5.0),
    ],
)
def test_the_time_left_follows_the_mean_speed_after_a_tenth(
    seconds: float, share: float, first: float, left: float | None
) -> None:
    assert time_left(seconds, share, first) == (None if left is None else pytest.approx(left))


def test_work_under_way_is_never_at_100_percent() -> None:
    assert [percent(share) for share in (0.0, 0.34, 0.9999, 1.0)] == ["0 %", "34 %", "99 %", "99 %"]
