"""What may lie over the picture: its kind, colours, and the scale of the map of decoders per block. Plain values."""

from dataclasses import dataclass
from typing import Final, Literal

from viewer.scene.json_text import Share
from viewer.state.palettes import PaletteName

OverlayKind = Literal["none", "divergence", "error-texture", "error-decoder"]
BlockName = Literal["8x8", "8x4", "16x4", "4x4"]
ScaleName = Literal["block", "picture"]

BLOCKS: Final[dict[BlockName, tuple[int, int]]] = {"8x8": (8, 8), "8x4": (8, 4), "16x4": (16, 4), "4x4": (4, 4)}
"""(width, height) in pixels of the blocks that decoders are counted in: waves of 64, 32, 64 and 16 lanes."""

MOST_OF_BLOCK: Final[dict[BlockName, int]] = {"8x8": 8, "8x4": 6, "16x4": 8, "4x4": 4}
"""Decoders at the far end of the palette for blocks of each shape: one colour means the same number in every picture."""


@dataclass(frozen=True)
class Overlay:
    """What lies over the picture."""

    kind: OverlayKind = "none"
    """Nothing, the map of decoders per block, or the error of each texture or decoder between A and B."""
    opacity: Share = 1.0
    palette: PaletteName = "viridis"
    block: BlockName = "8x8"
    scale: ScaleName = "block"
    """What the map's palette ends at: as many decoders as MOST_OF_BLOCK says, or as the picture has."""

    def most(self, maximum: int) -> int:
        """Decoders at the far end of the palette, at least 2, where a block of the picture has at most `maximum`."""
        return MOST_OF_BLOCK[self.block] if self.scale == "block" else max(2, maximum)


NO_OVERLAY: Final = Overlay()
