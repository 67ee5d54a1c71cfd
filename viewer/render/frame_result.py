"""Results of the renderer: one frame, and the pictures of both slots."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.metrics.divergence import DivergenceStatistics
from viewer.render.pass_scheduler import ToCome
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.visibility_buffer import VisibilityTarget
from viewer.render.tile_cache.budget import TileCounts
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
class FrameResult:
    """Picture of one frame, with its times and counts."""

    image: moderngl.Texture
    """RGBA8, sRGB-coded, row 0 at the bottom."""
    timings_ms: Mapping[str, float]
    """Time of each step that ran, in ms; `cull` is the CPU's, the others are passes. Two slots of one path are added up.

    Of a renderer that does not wait: those of a frame before, if anybody wants them."""
    slot_ms: Mapping[Slot, float]
    """Time in ms that each shown slot took when it was last drawn at this size."""
    timer: str
    """Method by which the times were taken."""
    skipped: Mapping[str, int]
    """Numbers of passes, images, triangles and other parts that were left out, by name."""
    divergence: Mapping[str, DivergenceStatistics]
    """Statistics of the shown packs' divergence maps, by the pack's name; empty without the overlay."""
    drawn: Mapping[str, int]
    """Triangles and draw commands of the visibility buffer."""
    tiles: Mapping[Slot, TileCounts]
    """The tile caches of the shown slots that have one."""
    paths: Mapping[Slot, PathChoice]
    """Path by which each slot of the view is drawn: the choice of `auto`, else the slot's own."""
    samples: Mapping[Slot, int]
    """Number of samples in the picture of each slot that the stochastic filter draws."""
    blend_samples: Mapping[Slot, int] = field(default_factory=dict)
    """Number of samples in the picture of each shown slot, BLEND surfaces in another pattern in each; empty without such surfaces."""
    short_latents: str = ""
    """Reason why latents are coarser than the picture needs: too little GPU memory, or a limit of what shaders read. Empty without."""

    upload: UploadCounts = UploadCounts()
    blocking_calls: int = 0
    """Number of calls since the frame before for which the CPU waited for the GPU."""
    to_come: tuple[ToCome, ...] = ()
    """Parts that drawing the same view again adds; empty where the picture is complete."""

    @property
    def is_complete(self) -> bool:
        """True where drawing the same view again would change nothing."""
        return not self.to_come

    @property
    def is_short(self) -> bool:
        """True where the picture is coarser than it should be, because the GPU has too little memory."""
        return bool(self.short_latents) or any(
            counts.out_of_memory and counts.starved > 0 for counts in self.tiles.values()
        )


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
