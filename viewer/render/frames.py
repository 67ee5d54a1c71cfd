"""Result of a frame, and times of the recent frames."""

import statistics
import time
from collections import defaultdict, deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.metrics.divergence import DivergenceStatistics
from viewer.render.pass_scheduler import Pending
from viewer.render.passes.load_textures import LoadCounts
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.tile_cache.budget import TileCounts
from viewer.render.resources.visibility_buffer import VisibilityTarget
from viewer.state.view_state import PathChoice, Slot


@dataclass(frozen=True)
class UploadCounts:
    """Numbers of bytes of the packs that replaced others of the same textures in a frame."""

    uploaded: int = 0
    """Number of bytes that the frame uploaded."""
    unchanged: int = 0
    """Number of bytes that both versions share, so they stayed on the GPU."""
    is_pending: bool = False
    """True while an older version of a pack is drawn until the newer one is uploaded."""


@dataclass(frozen=True, eq=False)
class PackMemory:
    """GPU memory of one pack in one precision, as one decode path uses it, in bytes."""

    parts: Mapping[str, int]
    """Numbers of bytes by their use: latents, decoders (with adapters), tables, tile cache."""
    idle: int
    """Number of bytes of other decode paths, not among `parts`. They stay allocated, so a switch of the path is immediate."""
    latents: NDArray[np.int64]
    """[textures of the scene] int64 number of bytes of each texture's latents."""

    @property
    def total(self) -> int:
        """Number of bytes of all parts: what the path uses."""
        return sum(self.parts.values())


@dataclass(frozen=True, eq=False, kw_only=True)
class FrameFigures:
    """Times and counts of one frame; before the first one all are empty."""

    timings_ms: Mapping[str, float] = field(default_factory=dict)
    """Time of each step that ran, in ms; `cull` is the CPU's, the others are passes. Two slots of one path are added up.

    A renderer that does not wait for the GPU has the times of an earlier frame."""
    slot_ms: Mapping[Slot, float] = field(default_factory=dict)
    """Time in ms that each shown slot took when it was last drawn at this size."""
    timer: str = ""
    """Method that measured the times."""
    skipped: Mapping[str, int] = field(default_factory=dict)
    """Numbers of skipped passes, images, triangles and other work, by name."""
    divergence: Mapping[str, DivergenceStatistics] = field(default_factory=dict)
    """Statistics of the shown packs' divergence maps, by the pack's name; empty without the overlay."""
    drawn: Mapping[str, int] = field(default_factory=dict)
    """Triangles and draw commands of the visibility buffer."""
    tiles: Mapping[Slot, TileCounts] = field(default_factory=dict)
    """The tile caches of the shown slots that have one."""
    paths: Mapping[Slot, PathChoice] = field(default_factory=dict)
    """Decode path that drew each slot of the view: the choice of `auto`, else the path that the slot names."""
    samples: Mapping[Slot, int] = field(default_factory=dict)
    """Number of samples in the picture of each slot that the stochastic filter draws."""
    blend_samples: Mapping[Slot, int] = field(default_factory=dict)
    """Number of samples in the picture of each shown slot with BLEND surfaces; empty without such surfaces."""
    loads: Mapping[Slot, LoadCounts] = field(default_factory=dict)
    """The compressed textures of the shown slots of path `on-load`."""
    short_latents: str = ""
    """Reason why latents are coarser than the picture needs: too little GPU memory, or a limit on buffers. Else empty."""

    upload: UploadCounts = UploadCounts()
    blocking_calls: int = 0
    """Number of calls since the previous frame in which the CPU waited for the GPU."""
    pending: tuple[Pending, ...] = ()
    """Parts that further frames of the same view add; empty if the picture is complete."""

    @property
    def is_complete(self) -> bool:
        """True if drawing the same view again would change nothing."""
        return not self.pending

    @property
    def is_short(self) -> bool:
        """True if the picture is coarser than it should be, because the GPU has too little memory."""
        return bool(self.short_latents) or any(
            counts.out_of_memory and counts.starved > 0 for counts in self.tiles.values()
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class FrameResult(FrameFigures):
    """Picture of one frame, with its times and counts."""

    image: moderngl.Texture
    """RGBA8, sRGB-coded, row 0 at the bottom."""


@dataclass(frozen=True)
class PairKey:
    """Key of the content of both slots: equal keys mean equal pictures."""

    a: Slot
    b: Slot
    versions: tuple[int, int]
    """Versions of the pictures of A and B; 0 for one that is not drawn."""


@dataclass(frozen=True, eq=False)
class DrawnPair:
    """Complete pictures of slots A and B of one view."""

    key: PairKey
    a: ColorTarget
    b: ColorTarget
    visibility: VisibilityTarget


def read_picture(image: moderngl.Texture) -> NDArray[np.uint8]:
    """Return the image of a FrameResult as [H, W, 3] uint8 sRGB, row 0 on top."""
    width, height = image.size
    pixels = np.frombuffer(image.read(), np.uint8).reshape(height, width, 4)
    return np.ascontiguousarray(pixels[::-1, :, :3])


FRAMES_REMEMBERED = 15
"""Number of frames over which medians of times are taken."""
FRAMES = 300
"""Number of frames that are plotted."""


class FrameHistory:
    """History of the last frames in which something was drawn, oldest first."""

    def __init__(self) -> None:
        self._frames: deque[tuple[Mapping[str, float], float]] = deque(maxlen=FRAMES)
        self._names: dict[str, None] = {}
        """Names of passes in the order of their first run."""
        self.version = 0
        """Number of frames so far, including those that have left the history."""

    def add(self, passes_ms: Mapping[str, float], wall_ms: float) -> None:
        """Add a frame: time of each pass that ran, and wall time of the whole frame, in ms."""
        self._names |= dict.fromkeys(passes_ms)
        self._frames.append((passes_ms, wall_ms))
        self.version += 1

    def __len__(self) -> int:
        return len(self._frames)

    @property
    def wall_ms(self) -> NDArray[np.float64]:
        """[frames] float64 wall time of each frame in ms."""
        return np.array([wall_ms for _, wall_ms in self._frames], np.float64)

    @property
    def passes_ms(self) -> dict[str, NDArray[np.float64]]:
        """[frames] float64 time in ms of each pass, 0 in frames where it did not run; in the order of their first run."""
        times = {
            name: np.array([frame.get(name, 0.0) for frame, _ in self._frames], np.float64) for name in self._names
        }
        return {name: milliseconds for name, milliseconds in times.items() if milliseconds.any()}

    def clear(self) -> None:
        """Remove all frames."""
        self._frames.clear()
        self._names.clear()
        self.version = 0


class FrameTimes:
    """Times of frames, measured between `begin` and `end` of each."""

    def __init__(self, waits: bool) -> None:
        """Take `waits` of the GraphicsContext. If true, `note` has the times of its frame; else the wall clock times frames."""
        self.history = FrameHistory()
        self._waits = waits
        self.whole_frame_ms = 0.0
        """Time of a full-resolution frame in ms: all passes of the last one, or the shorter wall time of the last two."""
        self._wall_ms: deque[float] = deque(maxlen=2)
        self.last_ms = 0.0
        """Wall time in ms of the last full-resolution frame."""
        self._passes: defaultdict[str, deque[float]] = defaultdict(lambda: deque(maxlen=FRAMES_REMEMBERED))
        self._started = 0.0
        self._drawn: Mapping[str, float] | None = None
        """Times in ms of the passes of the frame that is being drawn."""

    def begin(self) -> None:
        """Begin a frame."""
        self._started, self._drawn = time.perf_counter(), None

    def note(self, frame: FrameResult) -> None:
        """Note a frame at full resolution. Do not pass coarse frames."""
        self._drawn = frame.timings_ms
        if self._waits:
            self.whole_frame_ms = sum(frame.timings_ms.values())
        self.note_passes(frame.timings_ms)

    def note_passes(self, passes_ms: Mapping[str, float]) -> None:
        """Add times of passes, in ms, that have arrived from the GPU."""
        for name, milliseconds in passes_ms.items():
            self._passes[name].append(milliseconds)

    def end(self) -> None:
        """End the frame, after it was drawn or handed to the window system (whose vertical synchronisation may delay it)."""
        if self._drawn is None:
            return
        self.last_ms = 1000.0 * (time.perf_counter() - self._started)
        self.history.add(self._drawn, self.last_ms)
        self._wall_ms.append(self.last_ms)
        if not self._waits and len(self._wall_ms) > 1:
            # The first frame compiles shaders, so the shorter of two counts.
            self.whole_frame_ms = min(self._wall_ms)

    def medians_ms(self) -> dict[str, float]:
        """Return the median time in ms of each pass over the recent frames in which it ran."""
        return {name: statistics.median(times) for name, times in self._passes.items()}

    def clear(self) -> None:
        """Remove all times, for another scene."""
        self._passes.clear()
        self._wall_ms.clear()
        self.history.clear()
