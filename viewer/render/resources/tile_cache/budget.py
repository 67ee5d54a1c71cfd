"""Budget and statistics of the cache of decoded tiles (path `cached`).

A frame has FRAME_MS. TileBudget measures how long the frame takes without decoding tiles, and gives the remaining time to decoding, at
least a small share so that missing tiles always arrive. It moves half the way to a new value in each frame, because a single slow
frame says little (an exponential moving average). TileCache divides the time by the measured time of a tile to get a number of tiles.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True)
class TileCacheConfig:
    """Settings of a tile cache: memory limit, and decoding time of a frame."""

    budget_bytes: int = 256 << 20
    """Size limit of the tile atlas in bytes; one page is always allowed."""
    milliseconds: float | None = None
    """Time in ms that a frame may spend on decoding tiles; None: no limit. The next frames decode the rest; coarser tiles are
    shown until then."""
    least_tiles: int = 8
    """Fewest tiles that a frame decodes. So n missing tiles are decoded after at most ceil(n / least_tiles) frames."""


FRAME_MS = 25.0
"""Target time in ms of a whole frame that decodes tiles."""
LEAST_MILLISECONDS = 4.0
AHEAD_MILLISECONDS = 8.0
"""Decoding time of a frame in ms if tiles are only outdated, not missing."""
TILES_AT_ONCE = 8192
"""Most tiles of one dispatch. Codec `block` has a work group for each along one axis; OpenGL guarantees 65535."""
LEAST_SHARE = 0.125
"""Decoding time relative to the rest of the frame, if that rest alone exceeds FRAME_MS."""


class TileBudget:
    """Decoding time of a frame, adapted to the measured time of the rest of the frame."""

    def __init__(self, config: TileCacheConfig | None = None) -> None:
        """Take the settings; None: the defaults of TileCacheConfig."""
        self.config = config or TileCacheConfig()
        """Settings of each tile cache."""
        self.milliseconds = self.config.milliseconds
        """Decoding time of the next frame in ms; None: no limit."""
        self.is_tight = False
        """True if frames take FRAME_MS even without decoding tiles. Then one redrawing follows several frames of decoding."""
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
        # Half the way, because a single slow frame says little about the next.
        self.milliseconds = min(0.5 * (self.milliseconds + room), most)


@dataclass(frozen=True)
class TileCounts:
    """State of a tile cache: numbers of tiles."""

    resident: int
    """Number of decoded tiles in the cache."""
    waiting: int
    """Number of tiles that the last view requested and that are not decoded yet."""
    starved: int
    """Number of requested tiles that cannot be decoded, because all pages of the budget are visible."""
    reused: int
    """Number of tiles that were in the cache at the last view's request."""
    decoded: int
    """Number of tiles decoded so far."""
    evicted: int
    """Number of tiles evicted so far to make room for others."""
    out_of_memory: bool = False
    """True if the GPU has less memory than the budget; the cache then keeps the size that it has reached."""
    coarse_latents: bool = False
    """True if tiles were decoded from coarser latents than they need, because finer ones did not fit into GPU memory."""


def total_counts(counts: Sequence[TileCounts]) -> TileCounts | None:
    """Return the sums of the counts of several caches; None for an empty sequence."""
    if not counts:
        return None
    totals: dict[str, Any] = {
        field.name: (any if field.type is bool else sum)(getattr(each, field.name) for each in counts)
        for field in fields(TileCounts)
    }
    return TileCounts(**totals)
