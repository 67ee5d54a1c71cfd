"""Quality, divergence and memory of what a slot shows, measured on the picture that is shown."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.color import linear_to_srgb8
from ntc.codec.model import Pack
from ntc.metrics.divergence import DivergenceStatistics, divergence_map
from ntc.metrics.metrics import psnr_db
from ntc.pack.match import PackMatch
from viewer.state.session import SlotMeasurement
from viewer.state.view_state import REFERENCE


def decoder_ids(texture_ids: NDArray[np.int32], pack: Pack, match: PackMatch) -> NDArray[np.int32]:
    """[H, W] int32 decoder of each pixel from its texture id [H, W]; -1 where the pack decodes nothing."""
    return np.array([*match.decoders(pack), -1], dtype=np.int32)[texture_ids]


@dataclass(frozen=True, eq=False)
class SlotPicture:
    """What the renderer drew for one slot and its reference. All arrays have row 0 on top."""

    shown: NDArray[np.float32]
    """[H, W, 3] linear."""
    reference: NDArray[np.float32]
    """[H, W, 3] linear, from the original images."""
    covered: NDArray[np.bool_]
    """[H, W]."""
    texture_ids: NDArray[np.int32]
    """[H, W], -1 for none."""


def measure_slot(
    source: str, picture: SlotPicture, pack: Pack | None, match: PackMatch | None, gpu_bytes: int | None
) -> SlotMeasurement:
    """Figures of a picture; without a pack nothing of it is decoded."""
    if source == REFERENCE:
        return SlotMeasurement(source, None, None, None)
    shown, truth = linear_to_srgb8(picture.shown), linear_to_srgb8(picture.reference)
    covered = picture.covered
    quality = psnr_db(shown[covered], truth[covered]) if covered.any() else None
    if pack is None or match is None:
        return SlotMeasurement(source, quality, None, gpu_bytes)
    divergence = DivergenceStatistics.of(divergence_map(decoder_ids(picture.texture_ids, pack, match)))
    return SlotMeasurement(source, quality, divergence, gpu_bytes)
