"""The divergence maps of what is shown: counted when the picture or a grouping has changed, and not while hidden."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ntc.metrics.divergence import DivergenceStatistics
from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.gl.read_back import ReadBack
from viewer.render.pass_scheduler import Output, PassScheduler, ToCome
from viewer.render.passes.composite import HeatmapOverlay
from viewer.render.passes.divergence import DivergenceInputs, DivergencePass
from viewer.render.resources.divergence_maps import DecoderTables, DivergenceTarget, Stage
from viewer.render.resources.visibility_buffer import VisibilityInputs, VisibilityTarget
from viewer.state.view_state import Overlay

LARGEST_COUNT = 3
"""Groupings that are counted in one pass: those of two slots, and one that was shown before."""


@dataclass(frozen=True)
class CountedGrouping:
    """One grouping whose decoders are counted."""

    version: int
    """Changes with the decoders, and only with them."""
    decoders: tuple[int, ...] = field(compare=False)
    """Decoder of each texture of the scene, -1 where nothing is decoded."""


@dataclass(frozen=True)
class MapPlace:
    """Which blocks of which picture are counted."""

    visibility: VisibilityTarget
    version: int
    """Of the visibility buffer's content."""
    block: tuple[int, int]


class DivergenceOverlay:
    """Maps and statistics of the groupings that are shown, all from one visibility buffer in one pass."""

    def __init__(
        self, context: GraphicsContext, programs: ProgramFactory, scheduler: PassScheduler, stage: Stage
    ) -> None:
        self._context, self._scheduler = context, scheduler
        self._pass = DivergencePass(context, programs, stage)
        self._target: DivergenceTarget | None = None
        self._tables: DecoderTables | None = None
        self._place: MapPlace | None = None
        self._groupings: dict[str, CountedGrouping] = {}
        """Of the tables, by source, in their order."""
        self._output = Output(0)
        """Of the maps."""
        self._back = ReadBack[tuple[DivergenceTarget, tuple[str, ...]]](context, "counts of the divergence maps")
        self.statistics: Mapping[str, DivergenceStatistics] = {}
        """Of each grouping, by the name of its source."""

    def update(
        self, view: VisibilityInputs, groupings: Mapping[str, CountedGrouping], block: tuple[int, int]
    ) -> Output:
        """Count the maps of `groupings` in blocks of (width, height) pixels, unless they are known.

        What was counted last for the same picture is counted with it: slots that alternate are then counted once.
        Unless frames wait, statistics are those of a frame or two before, but for groupings that have none.
        """
        visibility = view.visibility
        place = MapPlace(visibility, view.version, block)
        known = self._groupings if place == self._place else {}
        if any(known.get(source) != grouping for source, grouping in groupings.items()):
            others = [(source, grouping) for source, grouping in known.items() if source not in groupings]
            wanted = {**groupings, **dict(others[: LARGEST_COUNT - len(groupings)])}
        else:
            wanted = known
        # Until all of it is counted nothing is known.
        self._place = None
        if self._tables is None or list(wanted.items()) != list(self._groupings.items()):
            tables = DecoderTables(self._context, [grouping.decoders for grouping in wanted.values()])
            if self._tables is not None:
                self._tables.release()
            self._tables, self._groupings = tables, wanted
        shape = (visibility.size, block, len(wanted))
        target = self._target
        if target is None or (target.picture, target.block, target.groupings) != shape:
            made = DivergenceTarget(self._context, *shape)
            if target is not None:
                target.release()
            target = self._target = made
        output = self._scheduler.run(self._pass, DivergenceInputs(visibility, view.version, self._tables), target)
        if output != self._output:
            try:
                target.copy_counts(self._back, (target, tuple(wanted)))
            except GpuMemoryError:
                self._scheduler.invalidate(target)
                raise
            self._output = output
        has_all = all(source in self.statistics for source in wanted)
        waits = self._scheduler.whole or self._context.waits
        arrived = self._back.newest() if has_all and not waits else self._back.wait()
        if arrived is not None:
            content, (counted, sources) = arrived
            found = dict(zip(sources, counted.statistics_in(content), strict=True))
            self.statistics = {source: own for source, own in {**self.statistics, **found}.items() if source in wanted}
        self._place = place
        return Output(output.version, (ToCome("statistics", 1),) if self._back.is_pending else ())

    def overlay(self, settings: Overlay, first: str, second: str) -> HeatmapOverlay:
        """The maps of two sources as an overlay; both must have been counted."""
        if self._target is None:
            raise RuntimeError("count first")
        most = settings.most(max(self.statistics[source].maximum for source in (first, second)))
        rows = (self._row(first), self._row(second))
        return HeatmapOverlay(self._target, *rows, most, settings.opacity, settings.palette)

    def map(self, source: str) -> NDArray[np.uint16]:
        """[ceil(H / block height), ceil(W / block width)] uint16: D of a source that has been counted."""
        if self._target is None:
            raise RuntimeError("count first")
        return self._target.read(self._row(source))

    def _row(self, source: str) -> int:
        return list(self._groupings).index(source)

    def release(self) -> None:
        """Free everything on the GPU."""
        for part in (self._target, self._tables, self._back):
            if part is not None:
                part.release()
        self._target, self._tables, self._place, self._groupings = None, None, None, {}
