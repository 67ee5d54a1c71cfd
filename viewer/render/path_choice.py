"""Decode path `auto`: all paths are timed on the view at hand, and the fastest is taken."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import get_args

from ntc.errors import InputError
from viewer.gl.program import ShaderError
from viewer.state.navigation import turned
from viewer.state.view_state import DecodePath, Slot, ViewState

SHARE = 4
"""Paths that decode every pixel are timed on pictures whose sides are this many times smaller: their time goes with the pixels.
`cached` is timed on whole ones, for the tiles that come into sight do not; what it decodes for that stays decoded."""
DEGREES = 1.0
"""The camera turns by so much from picture to picture: what `cached` decoded before counts, but not a view that stands still."""
PICTURES = 3
"""Of each path; the first compiles and fills the cache, the least of the others counts."""


@dataclass(frozen=True)
class PathTimes:
    """What `auto` found."""

    milliseconds: Mapping[DecodePath, float]
    """Of a whole picture after a small turn; paths that this driver cannot run are absent."""

    @property
    def fastest(self) -> DecodePath:
        """The path with the least time; `deferred` where none could be timed."""
        return min(self.milliseconds, key=lambda path: self.milliseconds[path], default="deferred")


def time_paths(slot_ms: Callable[[ViewState], float], view: ViewState, slot: Slot) -> PathTimes:
    """Times of all paths for `slot`; `slot_ms` draws a view whole and says what its slot A took, in ms."""
    times: dict[DecodePath, float] = {}
    for path in get_args(DecodePath):
        share = 1 if path == "cached" else SHARE
        size = (max(1, view.size[0] // share), max(1, view.size[1] // share))
        plain = replace(view, size=size, slot_a=replace(slot, path=path), compare="a")
        try:
            taken = [
                slot_ms(replace(plain, camera=turned(view.camera, DEGREES * number))) for number in range(PICTURES)
            ]
        except (ShaderError, InputError):
            continue
        times[path] = min(taken[1:]) * (view.size[0] * view.size[1]) / (size[0] * size[1])
    return PathTimes(times)
