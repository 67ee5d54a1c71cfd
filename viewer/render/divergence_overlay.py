"""The divergence maps of what is shown: counted when the picture or a grouping has changed, and not while hidden."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ntc.metrics.divergence import DivergenceStatistics
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.gl.timer import PassTimer
from viewer.render.passes.composite import HeatmapOverlay
from viewer.render.passes.divergence import DivergencePass
from viewer.render.resources.divergence_maps import DecoderTables, DivergenceTarget, Stage
from viewer.render.resources.visibility_buffer import VisibilityTarget
from viewer.scene.model import Camera
from viewer.state.view_state import BLOCKS, BlockName, Overlay

LARGEST_COUNT = 3
"""Groupings that are counted in one pass: those of two slots, and one that was shown before."""


@dataclass(frozen=True)
class CountedGrouping:
    """One grouping whose decoders are counted."""

    version: int
    """Changes with the decoders, and only with them."""
    decoders: tuple[int, ...] = field(compare=False)
    """Decoder of each texture of the scene, -1 where nothing is decoded."""


class DivergenceOverlay:
    """Maps and statistics of the groupings that are shown, all from one visibility buffer in one pass."""

    def __init__(self, context: GraphicsContext, programs: ProgramFactory, timer: PassTimer, stage: Stage) -> None:
        self._context, self._timer = context, timer
        self._pass = DivergencePass(context, programs, stage)
        self._target: DivergenceTarget | None = None
        self._tables: DecoderTables | None = None
        self._place: object = None
        self._groupings: dict[str, CountedGrouping] = {}
        self._key: object = None
        self._rows: dict[str, int] = {}
        self.statistics: Mapping[str, DivergenceStatistics] = {}
        """Of each grouping, by the name of its source."""

    @property
    def key(self) -> object:
        """What the maps were counted from: equal keys mean equal maps."""
        return self._key

    def update(
        self,
        visibility: VisibilityTarget,
        camera: Camera,
        groupings: Mapping[str, CountedGrouping],
        block: BlockName,
    ) -> bool:
        """Count unless the maps are still good; whether it counted.

        What was counted last for the same picture is counted with it: slots that alternate are then counted once.
        """
        place = (visibility, camera, block)
        known = self._groupings if place == self._place else {}
        if all(known.get(source) == grouping for source, grouping in groupings.items()):
            return False
        kept = dict(list(known.items())[: LARGEST_COUNT - len(groupings)])
        groupings = {**groupings, **{source: grouping for source, grouping in kept.items() if source not in groupings}}
        same_tables = self._tables is not None and list(groupings.items()) == list(self._groupings.items())
        # Nothing has been counted until all of it has.
        self._place, self._groupings, self._key = None, {}, None
        if not same_tables or self._tables is None:
            tables = DecoderTables(self._context, [grouping.decoders for grouping in groupings.values()])
            if self._tables is not None:
                self._tables.release()
            self._tables = tables
        shape = (visibility.size, BLOCKS[block], len(groupings))
        target = self._target
        if target is None or (target.picture, target.block, target.groupings) != shape:
            made = DivergenceTarget(self._context, *shape)
            if target is not None:
                target.release()
            target = self._target = made
        with self._timer.measure("divergence"):
            self._pass.run(visibility, self._tables, target)
        self._rows = {source: row for row, source in enumerate(groupings)}
        self.statistics = {source: target.statistics(row) for source, row in self._rows.items()}
        self._place, self._groupings = place, dict(groupings)
        self._key = (place, tuple(groupings.items()))
        return True

    def overlay(self, settings: Overlay, first: str, second: str) -> HeatmapOverlay:
        """The maps of two sources as an overlay; both must have been counted."""
        if self._target is None:
            raise RuntimeError("count first")
        most = max(2, *(self.statistics[source].maximum for source in (first, second)))
        rows = self._rows
        return HeatmapOverlay(self._target, rows[first], rows[second], most, settings.opacity, settings.palette)

    def map(self, source: str) -> NDArray[np.uint16]:
        """[ceil(H / block height), ceil(W / block width)] uint16: D of a source that has been counted."""
        if self._target is None:
            raise RuntimeError("count first")
        return self._target.read(self._rows[source])

    def release(self) -> None:
        """Free everything on the GPU."""
        for part in (self._target, self._tables):
            if part is not None:
                part.release()
        self._target, self._tables, self._key, self._place = None, None, None, None
        self._groupings = {}
