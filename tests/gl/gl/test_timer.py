"""Times of passes: waited for, or read later; 64 bits; and nothing where nobody asks."""

import ctypes
import time
from dataclasses import replace
from typing import Any

import pytest

from viewer.gl.context import GraphicsContext
from viewer.gl.timer import MOST_FRAMES, PassTimer

LATE = (False, True)
"""Without and with timer queries: software renderers' own are of use between the ends of passes only."""


class WatchedFunctions:
    """GlFunctions that write down what is called, and may answer queries themselves."""

    def __init__(self, functions: Any) -> None:
        self._functions, self.called, self.is_late = functions, list[str](), False
        self.stamps: list[int] | None = None

    def __call__(self, name: str, *arguments: Any) -> Any:
        self.called.append(name)
        result = self._functions(name, *arguments)
        if name == "glGetQueryObjectuiv" and self.is_late:
            ctypes.c_uint.from_address(arguments[2]).value = 0
        if name == "glGetQueryObjectui64v" and self.stamps is not None:
            ctypes.c_uint64.from_address(arguments[2]).value = self.stamps.pop(0)
        return result


@pytest.fixture(params=LATE)
def watched(graphics: GraphicsContext, request: pytest.FixtureRequest) -> tuple[GraphicsContext, WatchedFunctions]:
    functions = WatchedFunctions(graphics.functions)
    features = replace(graphics.features, timer_queries=request.param)
    return replace(graphics, functions=functions, features=features), functions  # type: ignore[arg-type]


def until_times(timer: PassTimer) -> dict[str, float]:
    """Times of the oldest frame under way."""
    end = time.monotonic() + 20.0
    while time.monotonic() < end:
        if found := timer.take():
            return found
    raise AssertionError("no times within 20 s")


def test_a_timer_that_waits_knows_the_times_at_once_and_says_how_often_it_waited(
    watched: tuple[GraphicsContext, WatchedFunctions],
) -> None:
    context, _ = watched
    timer, before, noted = PassTimer(context), context.memory.blocking.count, list[float]()
    with timer.owned_by("A"), timer.measure("draw"), timer.watch(noted.append):
        context.gl.memory_barrier()
    with timer.counted_as("all"), timer.owned_by("A"), timer.measure("draw"):
        pass
    assert context.memory.blocking.count > before
    owned = timer.take_owned()
    assert list(owned) == ["A"]
    times = timer.take()
    assert list(times) == ["draw", "all"]
    assert times["draw"] == owned["A"] >= noted[0] >= 0.0
    assert timer.take() == {}


def test_times_that_are_read_later_come_in_order_and_nothing_waits(
    watched: tuple[GraphicsContext, WatchedFunctions],
) -> None:
    context, functions = watched
    timer, before = PassTimer(replace(context, waits=False)), context.memory.blocking.count
    functions.is_late = True
    for number in range(3):
        with timer.owned_by(number), timer.measure(f"pass {number}"):
            context.gl.memory_barrier()
        assert timer.take() == {}
    functions.is_late = False
    for number in range(3):
        times = until_times(timer)
        assert list(times) == [f"pass {number}"]
        assert timer.take_owned() == {number: times[f"pass {number}"]}
    assert context.memory.blocking.count == before


def test_a_driver_that_never_answers_costs_no_more_than_some_queries(
    watched: tuple[GraphicsContext, WatchedFunctions],
) -> None:
    context, functions = watched
    timer = PassTimer(replace(context, waits=False))
    functions.is_late = True
    for _ in range(100):
        with timer.measure("pass"):
            pass
        assert timer.take() == {}
    assert functions.called.count("glGenQueries") <= 2 * (MOST_FRAMES + 2)
    assert "glGetQueryObjectui64v" not in functions.called


def test_times_have_64_bits(graphics: GraphicsContext) -> None:
    functions = WatchedFunctions(graphics.functions)
    features = replace(graphics.features, timer_queries=True)
    context = replace(graphics, functions=functions, features=features)  # type: ignore[arg-type]
    timer = PassTimer(context)
    begin = 7 << 40
    functions.stamps = [begin + 6_000_000_000, begin]
    with timer.measure("long"):
        pass
    assert timer.take() == {"long": 6000.0}
