"""Limits and figures of the cache of decoded tiles (path `cached`)."""

from dataclasses import dataclass


@dataclass(frozen=True)
class TileCacheConfig:
    """How large the cache of one pack may become, and how long a frame may decode for it."""

    budget_bytes: int = 256 << 20
    """Of the atlas; at least one page."""
    milliseconds: float | None = None
    """Decoding time of a frame, in ms. What is left comes in the next frames; until then a coarser tile is shown. None: no limit."""
    least_tiles: int = 8
    """Tiles that a frame decodes whatever the time: what is missing arrives within ceil(missing / least_tiles) frames."""


FRAME_MS = 25.0
"""What a frame that decodes tiles should take, all in all."""
LEAST_MILLISECONDS = 4.0
LEAST_SHARE = 0.125
"""Of what a frame takes besides: where that is long, tiles are not what makes it so."""


class TileBudget:
    """How long a frame may decode for tiles now: what the rest of a frame leaves, whatever that goes to."""

    def __init__(self, config: TileCacheConfig) -> None:
        self._most = config.milliseconds
        self.milliseconds = config.milliseconds
        """As TileCacheConfig's, now."""
        self.is_tight = False
        """Whether a frame is long without any tiles: the picture is then not drawn anew for every few of them."""
        self._spent = 0.0

    def note_tiles(self, milliseconds: float) -> None:
        """Tiles took so long in the frame that is being drawn."""
        self._spent += milliseconds

    def note_frame(self, milliseconds: float) -> None:
        """That frame took so long, all in all."""
        rest, self._spent = max(milliseconds - self._spent, 0.0), 0.0
        if self._most is None or self.milliseconds is None:
            return
        self.is_tight = FRAME_MS - rest < LEAST_MILLISECONDS
        room = max(FRAME_MS - rest, LEAST_SHARE * rest, LEAST_MILLISECONDS)
        # Half of the way: one frame that something else held up says little about the next.
        self.milliseconds = min(0.5 * (self.milliseconds + room), self._most)


@dataclass(frozen=True)
class TileCounts:
    """The state of the cache."""

    resident: int
    """Tiles that are decoded and kept."""
    waiting: int
    """Tiles that the last view asked for and that are still to come."""
    starved: int
    """Tiles that cannot come, because all others in the budget are seen too."""
    kept: int
    """Tiles that were there when the last view asked."""
    decoded: int
    """Tiles decoded so far."""
    evicted: int
    """Tiles that others have taken the place of so far."""
    out_of_memory: bool = False
    """Whether the GPU had less memory than the budget: the cache stays as large as it could become."""
    coarse_latents: bool = False
    """Whether there are or were tiles that were decoded from coarser latents than they need, because there was no room for those."""
