"""The time left by a simulated clock: machines of several speeds, forecasts that are wrong, other load."""

from collections.abc import Iterator, Sequence

import pytest

from ntc.training.time_left import TimeLeft

FROM = 0.15
"""Share of the run, in time, from which on the time left must be right."""
RUNS: dict[str, Sequence[tuple[float, float, int]]] = {
    # (share of the work, time of it over what its weight says, reports) of each stage.
    "one large texture": [(0.05, 1.0, 2), (0.3, 1.15, 8), (0.65, 0.95, 60)],
    "three groups": [(0.1, 1.2, 3), (0.2, 0.9, 10), (0.1, 1.2, 3), (0.25, 0.9, 20), (0.1, 1.2, 3), (0.25, 0.9, 20)],
    "many textures": [(0.12, 0.85, 6), *[(0.016, 1.0, 1)] * 55],
    "tables that ship": [(0.04, 1.2, 3), (0.96, 1.0, 40)],
    "uneven textures": [(0.2, 1.1, 5), *[(0.02, 0.8, 1), (0.02, 1.2, 1)] * 20],
}


def reports(stages: Sequence[tuple[float, float, int]], seconds: float) -> list[tuple[float, float]]:
    """(second, share of the work done) of a run that takes about `seconds`."""
    second = share = 0.0
    found = []
    for weight, factor, count in stages:
        for _ in range(count):
            second, share = second + seconds * weight * factor / count, share + weight / count
            found.append((second, min(share, 1.0)))
    return found


def slowed(found: Sequence[tuple[float, float]], from_share: float, times: float) -> list[tuple[float, float]]:
    """`found` on a machine that does `times` as little from a share of the time on."""
    begins = from_share * found[-1][0]
    return [(min(second, begins) + max(second - begins, 0.0) * times, share) for second, share in found]


def errors(
    found: Sequence[tuple[float, float]], forecast: float | None, first: float = FROM
) -> Iterator[tuple[float, float]]:
    """(share of the time, estimate over truth) from `first` to 95 % of the time; halfway between reports too."""
    left, whole, before = TimeLeft(0.0, forecast), found[-1][0], 0.0
    for second, share in found:
        for now in (0.5 * (before + second), second):
            if now == second:
                left.advance(now, share)
            if first <= now / whole <= 0.95:
                estimate = left.left(now)
                assert estimate is not None
                yield now / whole, estimate / (whole - now)
        before = second


@pytest.mark.parametrize("name", RUNS)
@pytest.mark.parametrize("seconds", [2.0, 40.0, 3000.0])
@pytest.mark.parametrize("wrong", [0.3, 0.5, 1.0, 2.0, 3.0, None])
def test_the_time_left_is_right_within_a_third(name: str, seconds: float, wrong: float | None) -> None:
    found = reports(RUNS[name], seconds)
    forecast = None if wrong is None else wrong * found[-1][0]
    for at, ratio in errors(found, forecast):
        assert 2.0 / 3.0 <= ratio <= 4.0 / 3.0, (at, ratio)


def test_a_slow_start_is_not_taken_for_the_speed_of_the_whole() -> None:
    # Of 42 seconds, the first 2 % of the work take 4.
    found = [(2.0, 0.01), (4.0, 0.02), *((4.0 + 0.38 * number, 0.02 + 0.0098 * number) for number in range(1, 101))]
    for at, ratio in errors(found, 38.0, 0.05):
        assert ratio <= 2.0, (at, ratio)
    for at, ratio in errors(found, 38.0):
        assert 2.0 / 3.0 <= ratio <= 4.0 / 3.0, (at, ratio)


@pytest.mark.parametrize("name", RUNS)
@pytest.mark.parametrize("times", [0.5, 2.0])
def test_it_follows_other_load_that_begins_or_ends_half_way(name: str, times: float) -> None:
    plain = reports(RUNS[name], 60.0)
    found = slowed(plain, 0.5, times)
    half = plain[-1][0] * 0.5 / found[-1][0]
    # A third of what was left then is enough to see it.
    seen = half + (1.0 - half) / 3.0
    for at, ratio in errors(found, plain[-1][0], seen):
        assert 2.0 / 3.0 <= ratio <= 4.0 / 3.0, (at, ratio)


def test_before_any_progress_the_forecast_runs_down() -> None:
    left = TimeLeft(100.0, 40.0)
    assert [left.left(second) for second in (100.0, 110.0, 150.0)] == [40.0, 30.0, 0.0]
    assert TimeLeft(100.0).left(110.0) is None


def test_work_that_goes_on_from_a_share_counts_what_is_left() -> None:
    left = TimeLeft(0.0, None, 0.5)
    assert left.left(1.0) is None
    left.advance(10.0, 0.75)
    assert left.left(10.0) == pytest.approx(10.0)
    assert left.left(14.0) == pytest.approx(6.0)
    left.advance(20.0, 1.0)
    assert left.left(20.0) == 0.0


def test_work_that_is_planned_on_the_way_takes_its_time() -> None:
    left = TimeLeft(0.0, 30.0)
    for second in range(1, 11):
        left.advance(float(second), 10.0 * second, 200.0)
    assert left.left(10.0) == pytest.approx(10.0, rel=0.2)
    left.advance(11.0, 110.0, 400.0)
    assert left.left(11.0) == pytest.approx(29.0, rel=0.2)


def test_a_report_without_progress_changes_nothing() -> None:
    left = TimeLeft(0.0, 100.0)
    left.advance(10.0, 0.1)
    before = left.left(12.0)
    left.advance(12.0, 0.1)
    assert left.left(12.0) == before
