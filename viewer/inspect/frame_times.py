"""Axes of the plot of frame times."""

import numpy as np
from numpy.typing import NDArray

from viewer.scene.json_text import counted

RECENT = 15
"""Number of recent frames that always fit on the axis. The panel shows the medians of these."""
COMPILING_MS = 1000.0
COMPILING_TIMES = 5.0
"""Factor of the second longest recent frame. A frame that takes longer than that and than COMPILING_MS compiled shaders."""
TICKS = 3
"""Largest number of ticks on the axis of frames, besides the last one."""


def axis_top(frames_ms: NDArray[np.float64]) -> float:
    """Return the upper end in ms of an axis for times of frames [frames], oldest first.

    All recent frames fit, and 95 % of the others. Frames that compile shaders do not count, because they would flatten the rest.
    """
    if not len(frames_ms):
        return 1.0
    usual = frames_ms
    if len(frames_ms) > 2:
        second = max(COMPILING_TIMES * float(np.partition(frames_ms[-RECENT:], -2)[-2]), COMPILING_MS)
        usual = frames_ms[frames_ms <= second]
    recent = frames_ms[-RECENT:][frames_ms[-RECENT:] <= usual.max()]
    return max(1.15 * max(float(np.percentile(usual, 95)), float(recent.max(initial=0.0))), 1.0)


def frame_ticks(frames: int) -> list[int]:
    """Return the ticks, in frames before the last one, of an axis of `frames` (at least 2) frames, falling to 0."""
    steps = (digit * 10**decade for decade in range(9) for digit in (1, 2, 5))
    step = next(step for step in steps if step * TICKS >= frames - 1)
    return list(range((frames - 1) // step * step, -1, -step))


def beyond_text(frames_ms: NDArray[np.float64], top: float) -> str:
    """Return a note about frames that take longer than `top` (ms); "" where none does."""
    beyond = frames_ms[frames_ms > top]
    if not len(beyond):
        return ""
    return f"{counted(len(beyond), 'frame')} beyond the axis, up to {beyond.max():,.0f} ms"
