"""What the panels show besides the session: immutable, handed over by the window for each frame."""

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
from viewer.render.frame_times import FrameHistory
from viewer.render.tile_cache.budget import TileCounts
from viewer.state.session import Session
from viewer.state.view_state import PathChoice, Slot
from viewer.training.live_training import LiveTraining
from viewer.ui.widgets import WidgetRects

FIRST_PICTURE = "compiling shaders"
"""What is done before there is a first picture."""


class Emit(Protocol):
    """How the UI runs a command. What keeps it from being carried out becomes a message."""

    def __call__(self, command_id: str, *values: Any) -> None:
        """Run the command with values for its parameters; those that are left out take their defaults."""
        ...


@dataclass(frozen=True)
class Work:
    """Something that is under way beside the frames."""

    title: str
    share: float | None = None
    """Of it that is done, 0 to 1; None where that is not known."""
    seconds_left: float | None = None
    """None where that is not known."""
    cancel: str = ""
    """Id of the command that ends it; "" where none does."""


@dataclass(frozen=True)
class FrameFacts:
    """Figures of recent frames."""

    renderer: str
    timer: str
    """How times are taken."""
    timings_ms: Mapping[str, float] = field(default_factory=dict)
    """Median time of each pass over the recent frames in which it ran, ms."""
    slot_ms: Mapping[Slot, float] = field(default_factory=dict)
    """Time that each slot took when it was last drawn whole, ms."""
    skipped: Mapping[str, int] = field(default_factory=dict)
    drawn: Mapping[str, int] = field(default_factory=dict)
    divergence: Mapping[str, DivergenceStatistics] = field(default_factory=dict)
    """Of the shown packs, by name, while the overlay is shown."""
    block: BlockContent | None = None
    """The block that is kept, else the one under the mouse, while the overlay is shown."""
    live: LiveFigures = field(default_factory=LiveFigures)
    """A against B."""
    is_training: bool = False
    """Whether a training keeps the processors busy: A is not compared with B then."""
    encoding: Mapping[BlockFormat, float] = field(default_factory=dict)
    """Share of the work done of each block format that is encoded for a slot, 0 to 1."""
    work: tuple[Work, ...] = ()
    """What is under way beside the frames."""
    drawn_because: tuple[str, ...] = ()
    """What the last frame was drawn for; empty where the mouse or a key was the cause."""
    pixel: PixelContent | None = None
    """The pixel that is kept, else the one under the mouse, while the panel Pixel is open."""
    thumbnail: Callable[[int], imgui.ImTextureRef] | None = None
    """Small picture of a texture by its id."""
    frames_drawn: int = 0
    blocking_calls: int = 0
    """Calls in the last frame for which the CPU waited until the GPU had caught up."""
    is_preview: bool = False
    """Whether the picture has fewer pixels than at rest, because the camera moves. `divergence` is that of the last whole one then."""
    paths: Mapping[Slot, PathChoice] = field(default_factory=dict)
    """The path by which each slot is drawn: what `auto` chose, else its own."""
    tiles: Mapping[Slot, TileCounts] = field(default_factory=dict)
    """The tile caches of slots that have one."""
    history: FrameHistory | None = None
    """Times of the last frames."""
    gpu_parts: Mapping[Slot, Mapping[str, int]] = field(default_factory=dict)
    """Bytes that the shown slots use on the GPU, by what they are for."""
    gpu_idle: Mapping[Slot, int] = field(default_factory=dict)
    """Bytes of their packs on the GPU that belong to other decode paths."""
    latent_bytes: NDArray[np.int64] | None = None
    """[textures] int64: latents of slot A that are on the GPU, by texture id."""
    matches: Mapping[str, PackMatch] = field(default_factory=dict)
    """How each open pack fits the scene, by the pack's name."""
    image: Callable[[str, NDArray[np.uint8]], imgui.ImTextureRef] | None = None
    """An image [h, w, 3] uint8 sRGB, uploaded when the array under that name is another one than before."""
    thumbnails_made: int = 0
    thumbnails_skipped: int = 0
    """Textures of the scene that no panel has shown a thumbnail of."""


@dataclass(frozen=True, eq=False)
class UiFrame:
    """What the user interface of one frame is drawn from, and how it runs commands."""

    session: Session
    training: LiveTraining
    facts: FrameFacts
    emit: Emit
    rects: WidgetRects
    why_not: Callable[[str], str] = lambda _command_id: ""
    """Why the command of this id cannot run now; "" where it can."""
