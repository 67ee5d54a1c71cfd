"""Facts of a frame that panels show besides the session. They are immutable and made for each frame."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from ntc.metrics.block_compression import BlockFormat
from ntc.metrics.divergence import DivergenceStatistics
from ntc.pack.match import PackMatch
from viewer.inspect.comparison import LiveFigures
from viewer.inspect.place_content import BlockContent, PixelContent
from viewer.render.frames import FrameHistory
from viewer.render.passes.load_textures import LoadCounts
from viewer.render.resources.tile_cache.budget import TileCounts
from viewer.state.session import Session
from viewer.state.view_state import PathChoice, Slot
from viewer.training.live_training import LiveTraining
from viewer.ui.widgets import WidgetRects

FIRST_PICTURE = "compiling shaders"
"""Title of the work before the first picture."""


class Emit(Protocol):
    """Function by which the UI runs a command; an error becomes a message."""

    def __call__(self, command_id: str, *values: Any) -> None:
        """Run a command with values for its parameters; missing values take their defaults."""
        ...


@dataclass(frozen=True)
class Work:
    """Work in the background."""

    title: str
    share: float | None = None
    """Share of the work that is done, 0 to 1; None where unknown."""
    seconds_left: float | None = None
    """Time left in seconds; None where unknown."""
    cancel: str = ""
    """Id of the command that cancels the work; "" where none does."""


@dataclass(frozen=True)
class FrameFacts:
    """Figures of recent frames."""

    renderer: str
    timer: str
    """Kind of the timer."""
    timings_ms: Mapping[str, float] = field(default_factory=dict)
    """Median time of each pass in ms, over the recent frames in which it ran."""
    skipped: Mapping[str, int] = field(default_factory=dict)
    drawn: Mapping[str, int] = field(default_factory=dict)
    divergence: Mapping[str, DivergenceStatistics] = field(default_factory=dict)
    """Divergence of the shown packs by name, while the map is shown."""
    block: BlockContent | None = None
    """Kept block, else the one under the mouse, while the map is shown."""
    live: LiveFigures = field(default_factory=LiveFigures)
    """Figures of A against B."""
    is_training: bool = False
    """True while a training keeps the processors busy: A is not compared with B then."""
    encoding: Mapping[BlockFormat, float] = field(default_factory=dict)
    """Progress of each block format that is encoded for a slot, 0 to 1."""
    work: tuple[Work, ...] = ()
    """Work in the background, for the status bar."""
    drawn_because: tuple[str, ...] = ()
    """Reasons why the last frame was drawn; empty where mouse or keyboard was the reason."""
    pixel: PixelContent | None = None
    """Kept pixel, else the one under the mouse, while the panel Pixel is open."""
    thumbnail: Callable[[int], imgui.ImTextureRef] | None = None
    """Function that returns the thumbnail of a texture by its id."""
    frames_drawn: int = 0
    blocking_calls: int = 0
    """Calls in the last frame in which the CPU waited for the GPU."""
    is_preview: bool = False
    """True while the picture has fewer pixels because the camera moves. `divergence` is then that of the last whole picture."""
    paths: Mapping[Slot, PathChoice] = field(default_factory=dict)
    """Decode path of each slot: the choice of `auto`, else its own."""
    tiles: Mapping[Slot, TileCounts] = field(default_factory=dict)
    """Tile caches of slots that have one."""
    loads: Mapping[Slot, LoadCounts] = field(default_factory=dict)
    """Compressed textures of slots of path `on-load`."""
    history: FrameHistory | None = None
    """Times of the recent frames."""
    gpu_parts: Mapping[Slot, Mapping[str, int]] = field(default_factory=dict)
    """Bytes on the GPU of the shown slots, by purpose."""
    gpu_idle: Mapping[Slot, int] = field(default_factory=dict)
    """Bytes on the GPU of their packs for other decode paths."""
    latent_bytes: NDArray[np.int64] | None = None
    """Bytes of slot A's latents on the GPU by texture id: [textures] int64."""
    matches: Mapping[str, PackMatch] = field(default_factory=dict)
    """Match of each open pack with the scene, by the pack's name."""
    image: Callable[[str, NDArray[np.uint8]], imgui.ImTextureRef] | None = None
    """Function that uploads an image [h, w, 3] uint8 sRGB under a name, where the array is a new one."""
    thumbnails_made: int = 0
    thumbnails_skipped: int = 0
    """Textures of the scene without a thumbnail so far."""


@dataclass(frozen=True, eq=False)
class UiFrame:
    """Inputs of the user interface in one frame, and its access to commands."""

    session: Session
    training: LiveTraining
    facts: FrameFacts
    emit: Emit
    rects: WidgetRects
    why_not: Callable[[str], str] = lambda _command_id: ""
    """Function that says why a command cannot run now; "" where it can."""
