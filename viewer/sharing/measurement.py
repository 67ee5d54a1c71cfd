"""Results of a grouping: quality, bytes, divergence in views that it was and was not optimised for, milliseconds by path."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.model import Grouping, Pack
from ntc.codec.quality import finite_or_none
from ntc.metrics.divergence import DivergenceStatistics, divergence_map
from ntc.metrics.metrics import psnr_table
from ntc.training.turns import CurvePoint
from viewer.gl.context import GraphicsContext
from viewer.render.path_choice import drawable_paths
from viewer.render.renderer import Renderer
from viewer.scene.model import Camera, Scene
from viewer.state.view_state import EXACT_PATHS, DecodePath, Slot, ViewState


@dataclass(frozen=True, eq=False)
class SplitViews:
    """Views of a scene in two halves: groupings are optimised for one; divergence is measured in both."""

    optimised: tuple[NDArray[np.int32], ...]
    """Texture ids [H, W] of the views that `covisible` reduces divergence in; -1 for none."""
    held_out: tuple[NDArray[np.int32], ...]
    """Texture ids [H, W] of the views that no grouping was optimised for."""

    @classmethod
    def of(cls, views: Sequence[NDArray[np.int32]]) -> "SplitViews":
        """Return `views` with every second one held out. A single view is in both halves."""
        return cls(tuple(views[::2]), tuple(views[1::2] or views))


@dataclass(frozen=True)
class DivergenceFigures:
    """Divergence of a grouping over several views."""

    views: int
    blocks: int
    """Number of blocks of 8x8 pixels in which something is decoded."""
    divergent_blocks: int
    """Number of blocks with more than one decoder."""
    excess: int
    """Sum of max(D - 1, 0) over all blocks, D the number of decoders in a block (paper, Sec. 2)."""
    score: float
    """Mean of max(D - 1, 0) over all blocks, covered or not (paper, Eq. 1)."""

    @classmethod
    def of(cls, views: Sequence[NDArray[np.int32]], grouping: Grouping) -> "DivergenceFigures":
        """Return the figures of `grouping` over `views` [H, W] int32 of texture ids, -1 for none."""
        decoders = np.array([*grouping.groups, -1], np.int32)
        counts = [divergence_map(decoders[view]).reshape(-1) for view in views]
        all_blocks = DivergenceStatistics.of(np.concatenate(counts))
        return cls(
            views=len(views),
            blocks=all_blocks.covered_blocks,
            divergent_blocks=all_blocks.divergent_blocks,
            excess=all_blocks.excess,
            score=all_blocks.score,
        )


@dataclass(frozen=True)
class SharingRow:
    """Results of one grouping and seed."""

    name: str
    grouping: str
    codec: str
    decoders: int
    seed: int
    steps: int
    """Training steps; for a codec without training, textures encoded."""
    samples: int
    """Number of texels that training sampled, or that were encoded."""
    seconds: float
    """Time of this training alone, in seconds."""
    psnr_db: float | None
    """Mean over textures of the PSNR in dB of mip 0, over 8-bit values; None where all are exact."""
    worst_db: float | None
    """Smallest PSNR of a texture in dB."""
    worst_texture: str
    bytes: int
    """Codes, decoders and constants of textures together."""
    decoder_bytes: int
    latent_bytes: int
    held_out: DivergenceFigures | None
    """Divergence in the views that no grouping was optimised for; None without a scene."""
    optimised: DivergenceFigures | None
    """Divergence in the views that `covisible` was optimised for; None without a scene."""
    ms: Mapping[DecodePath, float]
    """Time in ms of one picture by decode path; empty where nothing was drawn."""
    curve: tuple[CurvePoint, ...]
    """Training curve: PSNR on a fixed sample of texels, by step."""


def measured_row(
    name: str, seed: int, pack: Pack, samples: int, curve: Sequence[CurvePoint], views: SplitViews | None
) -> SharingRow:
    """Return the results of a trained `pack`, without drawing times."""
    table = psnr_table(pack)
    summary = table.summary
    worst = min(pack.textures, key=lambda texture: np.inf if texture.psnr_db is None else texture.psnr_db)
    last = curve[-1]
    return SharingRow(
        name=name,
        grouping=pack.grouping.name,
        codec=pack.config.kind,
        decoders=pack.grouping.group_count,
        seed=seed,
        steps=last.step,
        samples=samples,
        seconds=last.seconds,
        psnr_db=None if summary is None else finite_or_none(summary.mean_db),
        worst_db=finite_or_none(worst.psnr_db),
        worst_texture=worst.name,
        bytes=table.latent_bytes + table.decoder_bytes + table.adapter_bytes,
        decoder_bytes=table.decoder_bytes,
        latent_bytes=table.latent_bytes,
        held_out=None if views is None else DivergenceFigures.of(views.held_out, pack.grouping),
        optimised=None if views is None else DivergenceFigures.of(views.optimised, pack.grouping),
        ms={},
        curve=tuple(curve),
    )


class PathTimer:
    """Timer of one picture of packs, by decode path."""

    def __init__(self, context: GraphicsContext, scene: Scene, camera: Camera, size: tuple[int, int]) -> None:
        """Prepare to draw `scene` from `camera` at `size` (width, height) in pixels."""
        self._renderer = Renderer(context, scene)
        self._camera, self._size = camera, size
        self.paths = tuple(path for path in EXACT_PATHS if path in drawable_paths(context))

    def ms(self, pack: Pack) -> dict[DecodePath, float]:
        """Return the time in ms of one picture by path: the median of several drawings, without compiling.

        Raises GpuMemoryError.
        """
        name = pack.grouping.name
        self._renderer.set_packs({name: pack})
        times: dict[DecodePath, float] = {}
        for path in self.paths:
            slot = Slot(name, path)
            self._renderer.render(ViewState(self._camera, self._size, slot_a=slot), whole=True)
            times[path] = self._renderer.drawing_ms(slot)
        return times

    def release(self) -> None:
        """Free all GPU memory."""
        self._renderer.release()
