"""What the user looks at, as immutable values: read by the renderer, the UI, scripts and `render`; changed by commands."""

from dataclasses import dataclass
from typing import Final, Literal

from ntc.precision import Precision as Precision
from viewer.palettes import PaletteName
from viewer.scene.model import Camera
from viewer.zoom import WHOLE, Zoom

DecodePath = Literal["forward", "deferred", "binned", "cached"]
PathChoice = Literal["auto", "forward", "deferred", "binned", "cached"]
CompareMode = Literal["a", "b", "wipe"]
OverlayKind = Literal["none", "divergence"]
BlockName = Literal["8x8", "8x4", "16x4", "4x4"]

BLOCKS: Final[dict[BlockName, tuple[int, int]]] = {"8x8": (8, 8), "8x4": (8, 4), "16x4": (16, 4), "4x4": (4, 4)}
"""(width, height) in pixels of the blocks that decoders are counted in: waves of 64, 32, 64 and 16 lanes."""

REFERENCE: Final = "reference"
"""The slot source that shows the original images instead of a pack."""


@dataclass(frozen=True)
class Slot:
    """One side of the comparison."""

    source: str = REFERENCE
    """REFERENCE, or the name under which a pack is open."""
    path: PathChoice = "deferred"
    """Decode path, or `auto` for the one that is measured to be fastest here; of no effect for the reference."""
    precision: Precision = "fp32"
    """Storage of decoder weights, and arithmetic with them, on the GPU; of no effect for the reference."""


@dataclass(frozen=True)
class Overlay:
    """What lies over the picture."""

    kind: OverlayKind = "none"
    """Nothing, or the map of decoders per block."""
    opacity: float = 0.6
    """0 to 1."""
    palette: PaletteName = "green-red"
    block: BlockName = "8x8"


@dataclass(frozen=True)
class ViewState:
    """Everything that determines a picture, given the scene and the open packs."""

    camera: Camera
    size: tuple[int, int]
    """Framebuffer (width, height) in pixels."""
    slot_a: Slot = Slot()
    slot_b: Slot = Slot()
    compare: CompareMode = "a"
    wipe_position: float = 0.5
    """Divider of the wipe as a share of the width: A is left of it."""
    overlay: Overlay = Overlay()
    zoom: Zoom = WHOLE
    anisotropy: int = 1
    """Anisotropic filtering of the reference and of path `cached`: 1 (trilinear, as the other paths filter) to 16."""
