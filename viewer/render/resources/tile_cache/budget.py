"""Limits and statistics of the cache of decoded tiles (path `cached`)."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True)
class TileCacheConfig:
    """Memory limit of one pack's tile cache, and decoding time of a frame."""

    budget_bytes: int = 256 << 20
    """Size limit of the atlas in bytes; one page is always allowed."""
    milliseconds: float | None = None
    """Time in ms that a frame may spend on decoding tiles; None: no limit. The next frames decode the rest; coarser tiles are
    shown until then."""
    least_tiles: int = 8
    """Tiles that a frame decodes however long it takes: missing tiles are there after at most ceil(missing / least_tiles) frames."""


FRAME_MS = 25.0
"""Target time in ms of a whole frame that decodes tiles."""
LEAST_MILLISECONDS = 4.0
AHEAD_MILLISECONDS = 8.0
"""Decoding time of a frame, in ms, for tiles that are shown in an older version."""
TILES_AT_ONCE = 8192
"""Tiles of one dispatch: for codec `block` the work groups along one axis, of which OpenGL guarantees 65535."""
LEAST_SHARE = 0.125
"""Share of the rest of a frame's time that tiles may take where that rest alone exceeds FRAME_MS."""


class TileBudget:
    """Adapts the decoding time of a frame to the measured time of the rest of the frame."""

    def __init__(self, config: TileCacheConfig | None = None) -> None:
        """Begin with the limits of `config`; None: the defaults of a TileCacheConfig."""
        self.config = config or TileCacheConfig()
        """Limits of each tile cache."""
        self.milliseconds = self.config.milliseconds
        """Decoding time of the next frame in ms; None: no limit."""
        self.is_tight = False
        """True where frames take FRAME_MS without decoding tiles. Then the picture is redrawn once for several frames of decoding."""
        self._spent = 0.0

    def note_tiles(self, milliseconds: float) -> None:
        """Add decoding time of the current frame, in ms."""
        self._spent += milliseconds

    def note_frame(self, milliseconds: float) -> None:
        """End the frame, which took `milliseconds` in all, and set the decoding time of the next one."""
        rest, self._spent = max(milliseconds - self._spent, 0.0), 0.0
        most = self.config.milliseconds
        if most is None or self.milliseconds is None:
            return
        self.is_tight = FRAME_MS - rest < LEAST_MILLISECONDS
        room = max(FRAME_MS - rest, LEAST_SHARE * rest, LEAST_MILLISECONDS)
        # Half of the way: one frame that something else held up says little about the next.
        self.milliseconds = min(0.5 * (self.milliseconds + room), most)


@dataclass(frozen=True)
class TileCounts:
    """State of a tile cache: numbers of tiles."""

    resident: int
    """Decoded tiles in the cache."""
    waiting: int
    """Tiles that the last view requested and that are not decoded yet."""
    starved: int
    """Requested tiles that cannot be decoded, because all pages of the budget are visible too."""
    kept: int
    """Tiles that were in the cache when the last view made its request."""
    decoded: int
    """Tiles decoded so far."""
    evicted: int
    """Tiles evicted so far to make room for others."""
    out_of_memory: bool = False
    """True where the GPU had less memory than the budget: the cache keeps the size that it reached."""
    coarse_latents: bool = False
    """True where tiles were decoded from coarser latents than they need, because finer ones did not fit into GPU memory."""


def total_counts(counts: Sequence[TileCounts]) -> TileCounts | None:
    """Return the sums of several caches that draw one picture; None for none."""
    if not counts:
        return None
    totals: dict[str, Any] = {
        own.name: (any if own.type is bool else sum)(getattr(each, own.name) for each in counts)
        for own in fields(TileCounts)
    }
    return TileCounts(**totals)
