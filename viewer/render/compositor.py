"""The last part of a frame: divergence maps, the comparison, overlays and marks."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.metrics.divergence import DivergenceStatistics
from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.read_back import ReadBack
from viewer.render.pass_scheduler import Output, Pending
from viewer.render.passes.composite import (
    COMPARISONS,
    CompositeInputs,
    CompositeParams,
    CompositePass,
    CompositeTarget,
    DifferenceParams,
    HeatmapOverlay,
    MarksOverlay,
    TextureMarks,
)
from viewer.render.passes.divergence import DivergenceInputs, DivergencePass
from viewer.render.picture_targets import PictureTargets
from viewer.render.render_context import RenderContext
from viewer.render.resources.divergence_maps import CountedGrouping, DecoderTables, DivergenceTarget, Stage
from viewer.render.resources.visibility_buffer import VisibilityInputs, VisibilityTarget
from viewer.state.compare_layout import layout_of, shown_slots
from viewer.state.view_state import Difference, Overlay, ViewState, is_image_source

LARGEST_COUNT = 3
"""Most groupings that one pass counts: those of two slots, and one that was shown before."""


class DivergenceOverlay:
    """Divergence maps and statistics of the shown groupings. One pass counts all of them from one visibility buffer."""

    def __init__(self, context: RenderContext, stage: Stage) -> None:
        self._context, self._scheduler = context.graphics, context.scheduler
        self._pass = DivergencePass(context.graphics, context.programs, stage)
        self._target: DivergenceTarget | None = None
        self._tables: DecoderTables | None = None
        self._place: tuple[VisibilityTarget, int, tuple[int, int]] | None = None
        """Visibility buffer, version of its content, and size of a block that the maps were counted for."""
        self._groupings: dict[str, CountedGrouping] = {}
        """Groupings of the tables by source, in their order."""
        self._output = Output(0)
        """Output of the divergence pass."""
        self._back = ReadBack[tuple[DivergenceTarget, tuple[str, ...]]](
            context.graphics, "counts of the divergence maps"
        )
        self.statistics: Mapping[str, DivergenceStatistics] = {}
        """Statistics of each grouping, by the name of its source."""

    def update(
        self, view: VisibilityInputs, groupings: Mapping[str, CountedGrouping], block: tuple[int, int]
    ) -> Output:
        """Count the maps of `groupings` in blocks of (width, height) pixels, unless they are known.

        Groupings counted last for the same picture are counted again with these, so alternating slots cause one count.
        Unless frames wait for the GPU, statistics arrive a frame or two later. Only a grouping without any is waited for.
        """
        visibility = view.visibility
        place = (visibility, view.version, block)
        known = self._groupings if place == self._place else {}
        if any(known.get(source) != grouping for source, grouping in groupings.items()):
            others = [(source, grouping) for source, grouping in known.items() if source not in groupings]
            counted_groupings = {**groupings, **dict(others[: LARGEST_COUNT - len(groupings)])}
        else:
            counted_groupings = known
        # No map is valid until all are counted.
        self._place = None
        if self._tables is None or list(counted_groupings.items()) != list(self._groupings.items()):
            tables = DecoderTables(self._context, [grouping.decoders for grouping in counted_groupings.values()])
            if self._tables is not None:
                self._tables.release()
            self._tables, self._groupings = tables, counted_groupings
        shape = (visibility.size, block, len(counted_groupings))
        target = self._target
        if target is None or (target.picture, target.block, target.groupings) != shape:
            new_target = DivergenceTarget(self._context, *shape)
            if target is not None:
                target.release()
            target = self._target = new_target
        output = self._scheduler.advance(self._pass, DivergenceInputs(visibility, view.version, self._tables), target)
        if output != self._output:
            try:
                target.copy_counts(self._back, (target, tuple(counted_groupings)))
            except GpuMemoryError:
                self._scheduler.invalidate(target)
                raise
            self._output = output
        has_all = all(source in self.statistics for source in counted_groupings)
        arrived = self._back.arrived(waits=self._scheduler.budget.waits or not has_all)
        if arrived is not None:
            content, (counted, sources) = arrived
            fresh = dict(zip(sources, counted.statistics_in(content), strict=True))
            self.statistics = {
                source: counts for source, counts in {**self.statistics, **fresh}.items() if source in counted_groupings
            }
        self._place = place
        return Output(output.version, (Pending("statistics", 1),) if self._back.is_pending else ())

    def overlay(self, settings: Overlay, first: str, second: str) -> HeatmapOverlay:
        """Return the maps of two sources as an overlay; both must have been counted."""
        if self._target is None:
            raise RuntimeError("call update first")
        most = settings.most(max(self.statistics[source].maximum for source in (first, second)))
        rows = (self._row(first), self._row(second))
        return HeatmapOverlay(self._target, *rows, most, settings.opacity, settings.palette)

    def _row(self, source: str) -> int:
        return list(self._groupings).index(source)

    def release(self) -> None:
        """Free everything on the GPU."""
        for part in (self._target, self._tables, self._back):
            if part is not None:
                part.release()
        self._target, self._tables, self._place, self._groupings = None, None, None, {}


LEAST_ERROR = 1e-6
"""Smallest divisor of errors, in steps of 8-bit sRGB."""


@dataclass(frozen=True, eq=False)
class ComparisonErrors:
    """Root mean square errors between A and B, in steps of 8-bit sRGB; NaN for textures that are not visible."""

    by_texture: NDArray[np.float32]
    """[textures] error of each texture."""
    by_decoder: NDArray[np.float32]
    """[textures] error over all textures of the texture's decoder."""


class ErrorOverlay:
    """Errors of the comparison on the GPU. Textures and buffers are made once, when they are shown."""

    def __init__(self, context: GraphicsContext, textures: int) -> None:
        self._context, self._textures = context, textures
        self._errors: ComparisonErrors | None = None
        self._marks: TextureMarks | None = None
        self._marks_key: tuple[ComparisonErrors | None, bool, tuple[int, ...]] | None = None
        """Errors, whether by decoder, and highlighted textures that the marks were made from."""
        self._flip: moderngl.Texture | None = None
        self._flip_key: object = None

    def set_errors(self, errors: ComparisonErrors | None) -> None:
        """Show these errors from now on; None: there are none."""
        self._errors = errors

    def set_flip(self, flip: NDArray[np.float32] | None, key: object) -> None:
        """Set the FLIP map [H, W], row 0 on top, of the picture that `key` identifies; None: it is not known."""
        if self._flip is not None:
            self._flip.release()
            self._flip = None
        if flip is not None:
            self._flip = self._context.memory.texture(
                "the FLIP map", (flip.shape[1], flip.shape[0]), 1, flip[::-1].astype("<f4").tobytes(), dtype="f4"
            )
            self._flip.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._flip_key = key

    def flip_map(self, key: object) -> moderngl.Texture | None:
        """Return the FLIP map if it belongs to the picture that `key` identifies, else None."""
        return self._flip if key == self._flip_key else None

    def marks(
        self, overlay: Overlay, highlighted: tuple[int, ...], visibility: VisibilityTarget
    ) -> MarksOverlay | None:
        """Return the colours and the dimming of the picture's textures; None if no texture has any."""
        errors = self._errors if overlay.kind in ("error-texture", "error-decoder") else None
        if errors is None and not highlighted:
            return None
        by_decoder = errors is not None and overlay.kind == "error-decoder"
        key = (errors, by_decoder, highlighted)
        if self._marks is None or key != self._marks_key:
            shares = None
            if errors is not None:
                values = errors.by_decoder if by_decoder else errors.by_texture
                shares = values / np.float32(largest_error(values))
            made = TextureMarks(self._context, shares, highlighted, self._textures)
            if self._marks is not None:
                self._marks.release()
            self._marks, self._marks_key = made, key
        return MarksOverlay(self._marks, visibility, overlay.opacity, overlay.palette)

    def release(self) -> None:
        """Free everything on the GPU."""
        if self._marks is not None:
            self._marks.release()
        self.set_flip(None, None)
        self._marks = self._marks_key = None


def largest_error(values: NDArray[np.float32]) -> float:
    """Return the error at the far end of the palette."""
    known = values[np.isfinite(values)]
    return max(float(known.max()), LEAST_ERROR) if known.size else LEAST_ERROR


class Compositor:
    """Composition of the pictures of both slots."""

    def __init__(self, context: RenderContext, divergence_stage: Stage) -> None:
        self._scheduler = context.scheduler
        self._composite = CompositePass(context.graphics, context.programs)
        self._divergence = DivergenceOverlay(context, divergence_stage)
        self.errors = ErrorOverlay(context.graphics, len(context.scene.textures))
        """Results of the comparison of A and B, for overlays and the FLIP map."""

    def count_divergence(
        self, view: ViewState, groupings: Mapping[str, CountedGrouping], targets: PictureTargets
    ) -> tuple[Output, ...]:
        """Count the decoders per block under these groupings (by source) if the overlay is `divergence`."""
        if view.overlay.kind != "divergence":
            self._scheduler.skipped["divergence_passes"] += 1
            return ()
        return (self._divergence.update(targets.view, groupings, view.block),)

    def statistics(self, view: ViewState, sources: Iterable[str]) -> dict[str, DivergenceStatistics]:
        """Return statistics of the divergence maps of `sources` without images; empty without the overlay.

        Unless frames wait for the GPU, they may be of an earlier frame.
        """
        known = self._divergence.statistics if view.overlay.kind == "divergence" else {}
        return {source: known[source] for source in sources if source in known and not is_image_source(source)}

    def draw(
        self, view: ViewState, targets: PictureTargets, target: CompositeTarget, counted: Sequence[Output]
    ) -> Output:
        """Draw the composite if its inputs have changed; `counted` are the outputs of the divergence pass."""
        reads = [targets.shown[slot].output for slot in shown_slots(view)]
        return self._scheduler.advance(self._composite, self._inputs(view, targets), target, (*reads, *counted))

    def _inputs(self, view: ViewState, targets: PictureTargets) -> CompositeInputs:
        first, second = shown_slots(view)
        overlay = difference = None
        if view.overlay.kind == "divergence":
            overlay = self._divergence.overlay(view.overlay, first.source, second.source)
        if view.compare == "difference":
            difference = DifferenceParams(view.difference, self.errors.flip_map(targets.pair_key(view)))
        marks = self.errors.marks(view.overlay, view.highlight, targets.visibility)
        params = CompositeParams(layout_of(view), difference, overlay, marks, view.zoom)
        return CompositeInputs(targets.picture(first), targets.picture(second), params)

    def prepare(self, view: ViewState, targets: PictureTargets) -> bool:
        """Compile a program that another way to compare `view` would need; return whether there was one."""
        sources = [slot.source for slot in shown_slots(view)]
        for compare, kind in COMPARISONS:
            other = replace(view, compare=compare, difference=Difference(kind), overlay=Overlay())
            inputs = self._inputs(other, targets)
            if view.overlay.kind == "divergence":
                overlay = self._divergence.overlay(view.overlay, *sources)
                inputs = replace(inputs, params=replace(inputs.params, overlay=overlay))
            if self._composite.prepare(inputs):
                return True
        return False

    def release(self) -> None:
        """Free everything."""
        for part in (self._composite, self._divergence, self.errors):
            part.release()
