"""Data that panels show besides the session: immutable, made for each frame."""

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
from viewer.inspect.picking import BlockContent, PixelContent
from viewer.render.frames import FrameFigures, FrameHistory, PackMemory
from viewer.state.session import Session
from viewer.state.view_state import Slot
from viewer.training.live_training import LiveTraining
from viewer.ui.widgets import WidgetRects

FIRST_PICTURE = "compiling shaders"
"""Title of the work before the first picture."""


class Emit(Protocol):
    """Function that runs a command for the UI. Errors become messages."""

    def __call__(self, command_id: str, *values: Any) -> None:
        """Run a command with values for its parameters; missing values take their defaults."""
        ...


@dataclass(frozen=True)
class Work:
    """Background work, for the status bar."""

    title: str
    share: float | None = None
    """Progress of the work, 0 to 1; None where unknown."""
    seconds_left: float | None = None
    """Time left in seconds; None where unknown."""
    cancel: str = ""
    """Id of the command that cancels the work; "" for none."""


@dataclass(frozen=True)
class UiData:
    """Figures of the renderer and of background work, for panels."""

    renderer: str
    """Name of the GPU from its driver."""
    frame: FrameFigures = field(default_factory=FrameFigures)
    """Figures of the last frame that drew something."""
    timings_ms: Mapping[str, float] = field(default_factory=dict)
    """Median time of each pass in ms, over the recent frames in which it ran."""
    divergence: Mapping[str, DivergenceStatistics] = field(default_factory=dict)
    """Divergence of the shown packs by name, while the divergence map is shown."""
    block: BlockContent | None = None
    """Pinned block, else the one under the mouse, while the divergence map is shown."""
    live: LiveFigures = field(default_factory=LiveFigures)
    """Figures of the comparison of A with B."""
    is_training: bool = False
    """True while a training runs. A and B are not compared then, because the processors are busy."""
    encoding: Mapping[BlockFormat, float] = field(default_factory=dict)
    """Progress of each block format that is encoded for a slot, 0 to 1."""
    work: tuple[Work, ...] = ()
    """Background work, for the status bar."""
    drawn_because: tuple[str, ...] = ()
    """Reasons why the last frame was drawn; empty where mouse or keyboard was the reason."""
    pixel: PixelContent | None = None
    """Pinned pixel, else the one under the mouse, while the panel Pixel is open."""
    thumbnail: Callable[[int], imgui.ImTextureRef] | None = None
    """Function that returns the thumbnail of a texture by its id."""
    frames_drawn: int = 0
    is_preview: bool = False
    """True while the picture has fewer pixels because the camera moves. `divergence` is then that of the last whole picture."""
    history: FrameHistory | None = None
    """Times of the recent frames."""
    memory: Mapping[Slot, PackMemory] = field(default_factory=dict)
    """GPU memory of the shown slots' packs."""
    matches: Mapping[str, PackMatch] = field(default_factory=dict)
    """Match of each open pack with the scene, by the pack's name."""
    image: Callable[[str, NDArray[np.uint8]], imgui.ImTextureRef] | None = None
    """Function that returns the texture of an image [h, w, 3] uint8 sRGB under a name; it uploads arrays that changed."""


@dataclass(frozen=True, eq=False)
class UiFrame:
    """Inputs of the user interface in one frame, and its access to commands."""

    session: Session
    training: LiveTraining
    facts: UiData
    emit: Emit
    rects: WidgetRects
    why_not: Callable[[str], str] = lambda _command_id: ""
    """Function that returns the reason why a command cannot run now; "" where it can."""
