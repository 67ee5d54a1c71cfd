"""Pictures without dither where BLEND surfaces are seen: the mean of samples against several patterns of thresholds."""

from dataclasses import dataclass, replace

from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.render.pass_scheduler import PassScheduler, Progress, Step, ToCome
from viewer.render.passes.accumulate import SAMPLES, AccumulatePass
from viewer.render.picture_targets import BlendMean, Picture, PictureTargets, ShownMaterials
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.visibility_buffer import VisibilityInputs, VisibilityTarget
from viewer.render.scene_drawer import SceneDrawer
from viewer.render.slot_drawer import SlotDrawer
from viewer.scene.model import Scene
from viewer.state.view_state import Slot


def dithered_materials(scene: Scene) -> frozenset[int]:
    """Materials whose surfaces cover other pixels in each sample: those with alphaMode BLEND that may be neither clear nor opaque."""
    has_colors = scene.geometry.colors is not None
    found = []
    for number, material in enumerate(scene.materials):
        has_alpha = material.texture_id >= 0 and scene.textures[material.texture_id].has_alpha
        if material.alpha_mode == "blend" and (has_alpha or has_colors or 0.0 < material.factor[3] < 1.0):
            found.append(number)
    return frozenset(found)


@dataclass(frozen=True)
class BlendInputs:
    """What the samples of a slot are drawn from. The slot's own picture, which is the first of them, is read by its version."""

    slot: Slot
    own: ColorTarget
    """Of the slot's own picture."""
    view: VisibilityInputs
    materials: ShownMaterials


class BlendSamplesPass:
    """Adds a sample to the mean of a slot with each frame of a view that rests, until there are SAMPLES.

    Further samples have a visibility buffer and planes of their own; so ids, divergence and planes are always those of the first.
    """

    name = "blend_samples"
    """All passes of further samples, in times of frames."""

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        scene: Scene,
        drawer: SceneDrawer,
        slots: SlotDrawer,
        scheduler: PassScheduler,
    ) -> None:
        self._context, self._programs, self._drawer, self._slots = context, programs, drawer, slots
        self._scheduler, self._materials = scheduler, dithered_materials(scene)
        self._accumulate: AccumulatePass | None = None
        self._further: PictureTargets | None = None
        """Of the sample that is being added."""
        self._given_up: VisibilityInputs | None = None
        """The view whose samples could not be drawn: it stays with the first, in all slots alike."""

    def is_needed(self, view: VisibilityInputs) -> bool:
        """Whether a picture of this view takes more than one sample."""
        return not self._materials.isdisjoint(view.visible_materials) and view != self._given_up

    def show(self, slot: Slot, targets: PictureTargets) -> Picture:
        """What is shown of a slot: its picture, or the mean of several where BLEND surfaces may be seen.

        Raises GpuMemoryError that names the pack, ShaderError.
        """
        own = picture = self._slots.draw(slot, targets)
        if not self.is_needed(targets.view):
            targets.release_means()
        elif own.output.is_complete:
            mean = targets.means.setdefault(slot, BlendMean(targets.visibility.size))
            inputs, timing = (
                BlendInputs(slot, own.target, targets.view, targets.materials),
                self._scheduler.timer.counted_as,
            )
            output = self._scheduler.advance(self, inputs, mean, (own.output,), timing=timing)
            target = own.target if mean.samples == 1 or mean.target is None else mean.target
            picture = Picture(target, output, own.source_version)
        targets.shown[slot] = picture
        return picture

    def advance(self, inputs: BlendInputs, target: BlendMean, step: Step) -> Progress:
        """Add the next sample, or where the picture is to be whole all that are missing. A view that moves is shown one sample.

        Where memory is short, all slots stay with their first sample while the view is the same. Raises ShaderError.
        """
        is_new = not step.is_same_view or step.is_stale
        if is_new:
            target.samples = 1
        end = SAMPLES if step.whole else target.samples if is_new else target.samples + 1
        try:
            is_drawn = all(self._add(inputs, target) for _ in range(target.samples, end))
        except GpuMemoryError:
            is_drawn = False
        if not is_drawn:
            self._given_up, target.samples = inputs.view, 1
            return Progress()
        left = SAMPLES - target.samples
        return Progress(to_come=(ToCome("samples", left, SAMPLES),) if left else ())

    def _add(self, inputs: BlendInputs, target: BlendMean) -> bool:
        """Add a sample to the mean; False where it cannot be drawn whole. Raises GpuMemoryError, ShaderError."""
        further = self._draw_visibility(target.samples, inputs)
        with self._scheduler.drawing(whole=True):
            sampled = self._slots.draw(inputs.slot, further)
        if not sampled.output.is_complete:
            # A tile cache that is too small: the own picture would be drawn again, and so on without end.
            return False
        if target.target is None:
            target.target = ColorTarget(self._context, target.size)
        accumulate = self._accumulate = self._accumulate or AccumulatePass(self._context, self._programs)
        sample = accumulate.sample(target.size)
        if target.samples == 1:
            target.target.copy_from(inputs.own)
        sample.copy_from(sampled.target)
        accumulate.run(target.samples, target.target)
        target.samples += 1
        return True

    def _draw_visibility(self, number: int, inputs: BlendInputs) -> PictureTargets:
        """Targets whose visibility buffer is that of sample `number`."""
        shown, further, camera = inputs.view.visibility, self._further, inputs.view.camera
        assert camera is not None
        if further is None or (further.visibility.size, further.visibility.content) != (shown.size, shown.content):
            self.release()
            further = PictureTargets(VisibilityTarget(self._context, shown.size, shown.content))
            self._further = further
        drawn = self._drawer.draw(camera, further.visibility, number)
        further.show(replace(drawn, anisotropy=inputs.view.anisotropy), inputs.materials)
        return further

    def release(self) -> None:
        """Free what further samples are drawn into; the means belong to their targets."""
        if self._further is not None:
            self._further.release()
        if self._accumulate is not None:
            self._accumulate.release()
        self._further = self._accumulate = None
