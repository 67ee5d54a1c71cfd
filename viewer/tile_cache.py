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


LONG_FRAME_MS = 33.0
"""A frame that takes longer lets the next one decode for less long."""
LEAST_MILLISECONDS = 4.0


class TilePace:
    """How long a frame may decode for tiles now: less where frames take long, whatever else takes their time.

    It falls by factors and rises by steps, so that a machine that other programs are busy on is found out within a few frames.
    """

    def __init__(self, config: TileCacheConfig) -> None:
        self._most = config.milliseconds
        self.milliseconds = config.milliseconds
        """As TileCacheConfig's, now."""

    def note_frame(self, milliseconds: float) -> None:
        """A frame that decoded tiles took so long, all in all."""
        if self._most is None or self.milliseconds is None:
            return
        if milliseconds > LONG_FRAME_MS:
            self.milliseconds = min(max(0.6 * self.milliseconds, LEAST_MILLISECONDS), self._most)
        else:
            self.milliseconds = min(self.milliseconds + 3.0, self._most)


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
