"""Times of the frames that were drawn last: medians by pass, and a history for plots."""

import statistics
import time
from collections import defaultdict, deque
from collections.abc import Mapping

from viewer.render.frame_history import FrameHistory
from viewer.render.frame_result import FrameResult
from viewer.state.view_state import Slot

FRAMES_REMEMBERED = 15
"""Frames over which times are medians."""


class FrameTimes:
    """Takes in each frame between `begin` and `end`."""

    def __init__(self) -> None:
        self.history = FrameHistory()
        self.slot_ms: Mapping[Slot, float] = {}
        """Time that each slot took when it was last drawn whole, ms."""
        self.whole_frame_ms = 0.0
        """Of the last picture that was not coarse: all of its passes."""
        self.last_ms = 0.0
        """Of the last frame that drew a whole picture: all of it, by the wall clock."""
        self._passes: defaultdict[str, deque[float]] = defaultdict(lambda: deque(maxlen=FRAMES_REMEMBERED))
        self._started = 0.0
        self._drawn: Mapping[str, float] | None = None
        """Times of the passes of the frame that is being drawn."""

    def begin(self) -> None:
        """A frame begins."""
        self._started, self._drawn = time.perf_counter(), None

    def note(self, frame: FrameResult) -> None:
        """A whole picture was drawn. Times of a coarse one say nothing about it."""
        self._drawn, self.slot_ms = frame.timings_ms, frame.slot_ms
        self.whole_frame_ms = sum(frame.timings_ms.values())
        for name, milliseconds in frame.timings_ms.items():
            self._passes[name].append(milliseconds)

    def end(self) -> None:
        """The frame is on its framebuffer."""
        if self._drawn is not None:
            self.last_ms = 1000.0 * (time.perf_counter() - self._started)
            self.history.add(self._drawn, self.last_ms)

    def medians_ms(self) -> dict[str, float]:
        """Median time of each pass over the recent frames in which it ran, ms."""
        return {name: statistics.median(times) for name, times in self._passes.items()}

    def clear(self) -> None:
        """Another scene is drawn from now on."""
        self._passes.clear()
        self.history.clear()
