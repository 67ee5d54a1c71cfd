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
