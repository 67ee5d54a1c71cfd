"""What comes after the pictures of both slots: divergence maps, the comparison, overlays and marks."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from ntc.metrics.divergence import DivergenceStatistics
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.render.divergence_overlay import CountedGrouping, DivergenceOverlay
from viewer.render.error_overlay import ErrorOverlay
from viewer.render.pass_scheduler import Output, PassScheduler
from viewer.render.passes.composite import (
    COMPARISONS,
    CompositeInputs,
    CompositeParams,
    CompositePass,
    CompositeTarget,
    DifferenceParams,
)
from viewer.render.picture_targets import PictureTargets
from viewer.render.resources.divergence_maps import Stage
from viewer.scene.model import Scene
from viewer.state.compare_layout import layout_of, shown_slots
from viewer.state.view_state import Difference, Overlay, ViewState, is_image_source


class Compositor:
    """Puts the pictures of both slots together."""

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        scene: Scene,
        scheduler: PassScheduler,
        divergence_stage: Stage,
    ) -> None:
        self._scheduler = scheduler
        self._composite = CompositePass(context, programs)
        self._divergence = DivergenceOverlay(context, programs, scheduler, divergence_stage)
        self.errors = ErrorOverlay(context, len(scene.textures))
        """Results of the comparison of A and B, for overlays and the FLIP map."""

    def count_divergence(
        self, view: ViewState, groupings: Mapping[str, CountedGrouping], targets: PictureTargets
    ) -> tuple[Output, ...]:
        """Count the decoders per block under the groupings of what is shown, by its source, where the overlay asks for it."""
        if view.overlay.kind != "divergence":
            self._scheduler.skipped["divergence_passes"] += 1
            return ()
        return (self._divergence.update(targets.view, groupings, view.block),)

    def statistics(self, view: ViewState, sources: Iterable[str]) -> dict[str, DivergenceStatistics]:
        """Of the divergence maps of `sources` that are no images, where the overlay asks for them.

        Unless frames wait they may be those of a frame before.
        """
        known = self._divergence.statistics if view.overlay.kind == "divergence" else {}
        return {source: known[source] for source in sources if source in known and not is_image_source(source)}

    def draw(
        self, view: ViewState, targets: PictureTargets, target: CompositeTarget, counted: Sequence[Output]
    ) -> Output:
        """Draw the composite, unless it shows that already; `counted` is the divergence of what is shown."""
        reads = [targets.shown[slot].output for slot in shown_slots(view)]
        return self._scheduler.run(self._composite, self._inputs(view, targets), target, (*reads, *counted))

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
        """Compile a program that another way to compare `view` would need; whether there was one."""
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
