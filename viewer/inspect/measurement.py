"""Quality and divergence of what slots show: the one measuring of the command `render`, of Measure in the window, and of scripts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.color import linear_to_srgb8
from ntc.codec.model import Pack
from ntc.codec.quality import psnr_db
from ntc.metrics.divergence import DivergenceStatistics, divergence_map
from ntc.pack.match import PackMatch
from viewer.render.renderer import Renderer
from viewer.state.view_state import BLOCKS, REFERENCE, BlockName, Overlay, Slot


def decoder_ids(texture_ids: NDArray[np.int32], pack: Pack, match: PackMatch) -> NDArray[np.int32]:
    """[H, W] int32 decoder of each pixel from its texture id [H, W]; -1 where the pack decodes nothing."""
    return np.array([*match.decoders(pack), -1], dtype=np.int32)[texture_ids]


@dataclass(frozen=True, eq=False)
class MeasuredPicture:
    """What a slot shows of a view, drawn whole, beside the original images. All arrays have row 0 on top."""

    source: str
    color: NDArray[np.uint8]
    """[H, W, 3] uint8 sRGB: what the view shows of the materials; maps have a black background."""
    reference: NDArray[np.uint8]
    """[H, W, 3] uint8 sRGB: the same from the original images."""
    covered: NDArray[np.bool_]
    """[H, W] where a surface is visible."""
    texture_ids: NDArray[np.int32]
    """[H, W] index into the scene's textures, -1 for none."""
    decoder_ids: NDArray[np.int32]
    """[H, W] group of the texture in the pack, -1 where nothing is decoded."""
    divergence: NDArray[np.uint16]
    """[ceil(H / block height), ceil(W / block width)] distinct decoders per block."""

    @property
    def divergence_statistics(self) -> DivergenceStatistics:
        """Figures of the divergence map."""
        return DivergenceStatistics.of(self.divergence)

    def psnr_db(self, mask: NDArray[np.bool_]) -> float | None:
        """PSNR in dB over 8-bit sRGB RGB of the pixels of `mask` [H, W], infinite where they are equal; None for the reference
        itself, and where there is no pixel."""
        if self.source == REFERENCE or not mask.any():
            return None
        return psnr_db(self.color[mask], self.reference[mask])


def measure(
    renderer: Renderer, slots: Sequence[Slot], packs: Mapping[str, Pack], block: BlockName = Overlay.block
) -> list[MeasuredPicture]:
    """What `slots` show of the renderer's last view, drawn whole now; `block` names the shape in which decoders are counted.

    Raises ContextLostError.
    """
    reference = linear_to_srgb8(renderer.picture(Slot(REFERENCE)))
    covered, texture_ids = renderer.covered(), renderer.texture_ids()
    width, height = BLOCKS[block]
    found = []
    for slot in slots:
        color = reference if slot.source == REFERENCE else linear_to_srgb8(renderer.picture(slot))
        pack, match = packs.get(slot.source), renderer.matches.get(slot.source)
        ids = np.full_like(texture_ids, -1)
        if pack is not None and match is not None:
            ids = decoder_ids(texture_ids, pack, match)
        counts = divergence_map(ids, (height, width))
        found.append(MeasuredPicture(slot.source, color, reference, covered, texture_ids, ids, counts))
    return found
