"""Times of the last frames, pass by pass."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

FRAMES = 300


class FrameHistory:
    """The last frames in which something was drawn, oldest first."""

    def __init__(self) -> None:
        self._passes: dict[str, NDArray[np.float64]] = {}
        self._wall = np.zeros(FRAMES)
        self.version = 0
        """Frames so far, those that are gone included."""

    def add(self, passes_ms: Mapping[str, float], wall_ms: float) -> None:
        """Remember a frame: time of each pass that ran, and of the whole frame on the wall clock, in ms."""
        place = self.version % FRAMES
        for name in passes_ms:
            self._passes.setdefault(name, np.zeros(FRAMES))
        for name, times in self._passes.items():
            times[place] = passes_ms.get(name, 0.0)
        self._wall[place] = wall_ms
        self.version += 1

    def __len__(self) -> int:
        return min(self.version, FRAMES)

    def _in_order(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        return times[: self.version] if self.version <= FRAMES else np.roll(times, -(self.version % FRAMES))

    @property
    def wall_ms(self) -> NDArray[np.float64]:
        """[frames] float64."""
        return self._in_order(self._wall)

    @property
    def passes_ms(self) -> dict[str, NDArray[np.float64]]:
        """[frames] float64 of every pass that ran in one of them, 0 where it did not; in the order of their first run."""
        return {name: ordered for name, times in self._passes.items() if (ordered := self._in_order(times)).any()}

    def clear(self) -> None:
        """Forget all frames."""
        self._passes.clear()
        self.version = 0
