"""What the user interface asks for. The UI emits these; the session applies them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from viewer.scene.model import Camera
from viewer.state.view_state import CompareMode, Overlay, Slot
from viewer.state.zoom import Zoom

Side = Literal["a", "b"]


@dataclass(frozen=True)
class SetSlot:
    """Show something else on one side."""

    side: Side
    slot: Slot


@dataclass(frozen=True)
class SetCompare:
    """Show A, B, both, or their difference."""

    mode: CompareMode


@dataclass(frozen=True)
class MoveDivider:
    """Put the divider at a share of the picture's width or height."""

    position: float


@dataclass(frozen=True)
class SetCamera:
    """Look from elsewhere."""

    camera: Camera


@dataclass(frozen=True)
class SetAnisotropy:
    """Anisotropic filtering of the reference, 1 to 16."""

    value: int


@dataclass(frozen=True)
class SetOverlay:
    """What lies over the picture, and how it looks."""

    overlay: Overlay


@dataclass(frozen=True)
class SetZoom:
    """Which part of the picture is shown, how large."""

    zoom: Zoom


@dataclass(frozen=True)
class InspectBlock:
    """Say what is in the block at this place (shares of the picture from its upper left corner); None: in none."""

    at: tuple[float, float] | None


@dataclass(frozen=True)
class KeepPixel:
    """Keep the pixel at this place in the panel Pixel (shares of the picture from its upper left corner); None: none."""

    at: tuple[float, float] | None


@dataclass(frozen=True)
class SetResolution:
    """Pixels of the picture along one side, as a share of the window's."""

    share: float


@dataclass(frozen=True)
class SetCoarseWhileMoving:
    """Whether a moving camera may draw fewer pixels."""

    value: bool


@dataclass(frozen=True)
class OpenFile:
    """Open a scene or a pack."""

    path: Path


@dataclass(frozen=True)
class RunCommand:
    """Run a command of `viewer.commands` by its id."""

    id: str
    arguments: tuple[str, ...] = ()


Action = (
    SetSlot
    | SetCompare
    | MoveDivider
    | SetCamera
    | SetAnisotropy
    | SetOverlay
    | SetZoom
    | InspectBlock
    | KeepPixel
    | SetResolution
    | SetCoarseWhileMoving
    | OpenFile
    | RunCommand
)
