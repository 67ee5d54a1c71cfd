"""Frames: the result of one, and times of the last ones."""

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
    """Bytes that a frame uploaded of packs that replace others of the same textures."""

    uploaded: int = 0
    """Number of bytes that the frame uploaded."""
    kept: int = 0
    """Number of bytes that stayed on the GPU because they are the same in the packs that replaced others in this frame."""
    is_pending: bool = False
    """True while an older version of a pack is drawn until the newer one is uploaded."""


@dataclass(frozen=True, eq=False)
class PackMemory:
    """GPU memory of one pack in one precision, as one decode path uses it, in bytes."""

    parts: Mapping[str, int]
    """Numbers of bytes by their use: latents, decoders (with adapters), tables, tile cache."""
    idle: int
    """Number of bytes of other decode paths, which are kept for switching to them at once; not among the parts."""
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

    Of a renderer that does not wait: those of a frame before."""
    slot_ms: Mapping[Slot, float] = field(default_factory=dict)
    """Time in ms that each shown slot took when it was last drawn at this size."""
    timer: str = ""
    """Method by which the times were taken."""
    skipped: Mapping[str, int] = field(default_factory=dict)
    """Numbers of passes, images, triangles and other parts that were left out, by name."""
    divergence: Mapping[str, DivergenceStatistics] = field(default_factory=dict)
    """Statistics of the shown packs' divergence maps, by the pack's name; empty without the overlay."""
    drawn: Mapping[str, int] = field(default_factory=dict)
    """Triangles and draw commands of the visibility buffer."""
    tiles: Mapping[Slot, TileCounts] = field(default_factory=dict)
    """The tile caches of the shown slots that have one."""
    paths: Mapping[Slot, PathChoice] = field(default_factory=dict)
    """Path by which each slot of the view is drawn: the choice of `auto`, else the slot's own."""
    samples: Mapping[Slot, int] = field(default_factory=dict)
    """Number of samples in the picture of each slot that the stochastic filter draws."""
    blend_samples: Mapping[Slot, int] = field(default_factory=dict)
    """Number of samples in the picture of each shown slot, BLEND surfaces in another pattern in each; empty without such surfaces."""
    loads: Mapping[Slot, LoadCounts] = field(default_factory=dict)
    """The compressed textures of the shown slots of path `on-load`."""
    short_latents: str = ""
    """Reason why latents are coarser than the picture needs: too little GPU memory, or a limit of what shaders read. Empty without."""

    upload: UploadCounts = UploadCounts()
    blocking_calls: int = 0
    """Number of calls since the frame before for which the CPU waited for the GPU."""
    pending: tuple[Pending, ...] = ()
    """Parts that drawing the same view again adds; empty where the picture is complete."""

    @property
    def is_complete(self) -> bool:
        """True where drawing the same view again would change nothing."""
        return not self.pending

    @property
    def is_short(self) -> bool:
        """True where the picture is coarser than it should be, because the GPU has too little memory."""
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
    """Slots A and B of one view, drawn whole."""

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
        """Number of frames so far, those that are forgotten included."""

    def add(self, passes_ms: Mapping[str, float], wall_ms: float) -> None:
        """Remember a frame: time of each pass that ran, and of the whole frame on the wall clock, in ms."""
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
        """[frames] float64 of every pass that ran in one of them, 0 where it did not; in the order of their first run."""
        times = {name: np.array([own.get(name, 0.0) for own, _ in self._frames], np.float64) for name in self._names}
        return {name: own for name, own in times.items() if own.any()}

    def clear(self) -> None:
        """Remove all frames."""
        self._frames.clear()
        self._names.clear()
        self.version = 0


class FrameTimes:
    """Times of frames, measured between `begin` and `end` of each."""

    def __init__(self, waits: bool) -> None:
        """Take `waits` of the GraphicsContext: times of each frame are known within it; else frames are timed by the wall clock."""
        self.history = FrameHistory()
        self._waits = waits
        self.whole_frame_ms = 0.0
        """Time of a picture that is not coarse, in ms: all passes of the last one, or the wall time of the shorter of the last two."""
        self._wall_ms: deque[float] = deque(maxlen=2)
        self.last_ms = 0.0
        """Wall time in ms of the last frame that drew a whole picture."""
        self._passes: defaultdict[str, deque[float]] = defaultdict(lambda: deque(maxlen=FRAMES_REMEMBERED))
        self._started = 0.0
        self._drawn: Mapping[str, float] | None = None
        """Times in ms of the passes of the frame that is being drawn."""

    def begin(self) -> None:
        """Begin a frame."""
        self._started, self._drawn = time.perf_counter(), None

    def note(self, frame: FrameResult) -> None:
        """Note a picture that was drawn at full resolution; coarse ones are not to be passed here."""
        self._drawn = frame.timings_ms
        if self._waits:
            self.whole_frame_ms = sum(frame.timings_ms.values())
        self.note_passes(frame.timings_ms)

    def note_passes(self, passes_ms: Mapping[str, float]) -> None:
        """Note times of passes, in ms, that have become known."""
        for name, milliseconds in passes_ms.items():
            self._passes[name].append(milliseconds)

    def end(self) -> None:
        """End the frame: it is on its framebuffer, or was handed to the window system, which holds up what comes too fast."""
        if self._drawn is None:
            return
        self.last_ms = 1000.0 * (time.perf_counter() - self._started)
        self.history.add(self._drawn, self.last_ms)
        self._wall_ms.append(self.last_ms)
        if not self._waits and len(self._wall_ms) > 1:
            # The shorter of two, because the first one compiles.
            self.whole_frame_ms = min(self._wall_ms)

    def medians_ms(self) -> dict[str, float]:
        """Return the median time in ms of each pass over the recent frames in which it ran."""
        return {name: statistics.median(times) for name, times in self._passes.items()}

    def clear(self) -> None:
        """Forget all times: another scene is drawn from now on."""
        self._passes.clear()
        self._wall_ms.clear()
        self.history.clear()
