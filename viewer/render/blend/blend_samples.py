"""Pictures without dither where BLEND surfaces are seen: the mean of samples against several patterns of thresholds."""

from collections.abc import Collection
from dataclasses import replace

from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.render.pass_scheduler import PassScheduler
from viewer.render.passes.accumulate import AccumulatePass
from viewer.render.picture_targets import BlendMean, PictureTargets
from viewer.render.plane_path import SAMPLES
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.visibility_buffer import VisibilityInputs, VisibilityTarget
from viewer.render.scene_drawer import SceneDrawer
from viewer.render.slot_drawer import SlotDrawer
from viewer.scene.model import Scene
from viewer.state.view_state import Slot

BLEND_SAMPLES = "blend_samples"
"""All passes of further samples, in times of frames."""


def dithered_materials(scene: Scene) -> frozenset[int]:
    """Materials whose surfaces cover other pixels in each sample: those with alphaMode BLEND that may be neither clear nor opaque."""
    has_colors = scene.geometry.colors is not None
    found = []
    for number, material in enumerate(scene.materials):
        has_alpha = material.texture_id >= 0 and scene.textures[material.texture_id].has_alpha
        if material.alpha_mode == "blend" and (has_alpha or has_colors or 0.0 < material.factor[3] < 1.0):
            found.append(number)
    return frozenset(found)


class BlendSamples:
    """Adds a sample to the pictures of slots with each frame of a view that rests, until there are SAMPLES.

    The first sample is the slot's own picture. Further ones have a visibility buffer and planes of their own, which are freed
    when no sample is missing; so ids, divergence and planes are always those of the first.
    """

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
        self._scheduler = scheduler
        self._materials = dithered_materials(scene)
        self._accumulate: AccumulatePass | None = None
        self._further: PictureTargets | None = None
        """Of the sample that is being added."""
        self._given_up: VisibilityInputs | None = None
        """The view whose samples could not be drawn: it stays with the first, in all slots alike."""

    def is_sampled(self, targets: PictureTargets) -> bool:
        """Whether the last view takes more than one sample."""
        inputs = targets.inputs
        if inputs is None or self._materials.isdisjoint(inputs.visible_materials):
            return False
        return inputs != self._given_up

    def is_complete(self, slot: Slot, targets: PictureTargets) -> bool:
        """Whether drawing what is shown of the slot again would not change it."""
        if not self._slots.is_complete(slot, targets):
            return False
        return not self.is_sampled(targets) or self._samples(slot, targets) >= SAMPLES

    def counts(self, slots: Collection[Slot], targets: PictureTargets) -> dict[Slot, int]:
        """Samples in what is shown of `slots`; empty where the view takes no more than one."""
        return {slot: self._samples(slot, targets) for slot in slots} if self.is_sampled(targets) else {}

    @staticmethod
    def _samples(slot: Slot, targets: PictureTargets) -> int:
        mean = targets.mean(slot)
        return mean.samples if mean is not None else 1

    def update(self, slots: Collection[Slot], targets: PictureTargets, whole: bool) -> None:
        """Add the next sample to those of `slots` whose own picture was complete before, or with `whole` all that are missing.

        Where memory is short, all slots stay with their first sample while the view is the same. Raises ShaderError.
        """
        if not self.is_sampled(targets):
            self.release()
            targets.release_means()
            return
        ready = [slot for slot in slots if self._slots.is_complete(slot, targets)]
        begun = [slot for slot in ready if targets.mean(slot) is None]
        for slot in begun:
            self._begin(slot, targets)
        # A view that moves is shown one sample.
        missing = ready if whole else [slot for slot in ready if slot not in begun]
        try:
            with self._scheduler.timer.counted_as(BLEND_SAMPLES):
                is_drawn = self._add_to(missing, targets, whole)
        except GpuMemoryError:
            is_drawn = False
        if not is_drawn:
            self._given_up = targets.inputs
            self.release()
            targets.release_means()
        elif all(self._samples(slot, targets) >= SAMPLES for slot in slots):
            self.release()

    @staticmethod
    def _begin(slot: Slot, targets: PictureTargets) -> None:
        own, before = targets.own_number(slot), targets.means.get(slot)
        targets.means[slot] = BlendMean(own, own, target=before.target if before is not None else None)

    def _add_to(self, slots: Collection[Slot], targets: PictureTargets, whole: bool) -> bool:
        """Add to those of `slots` that have the fewest samples, or with `whole` to all; False where a sample cannot be drawn."""
        for number in range(1, SAMPLES):
            due = [slot for slot in slots if self._samples(slot, targets) == number]
            if not all(self._add(slot, number, targets) for slot in due):
                return False
            if due and not whole:
                break
        return True

    def _add(self, slot: Slot, number: int, targets: PictureTargets) -> bool:
        """Add sample `number` to the slot's mean; False where it cannot be drawn whole. Raises GpuMemoryError, ShaderError."""
        further = self._draw_visibility(number, targets)
        self._slots.update(slot, further, whole=True)
        if not self._slots.is_complete(slot, further):
            # A tile cache that is too small: the own picture would be drawn again, and so on without end.
            return False
        mean = targets.means[slot]
        if mean.target is None:
            mean.target = ColorTarget(self._context, targets.visibility.size)
        accumulate = self._accumulate = self._accumulate or AccumulatePass(self._context, self._programs)
        sample = accumulate.sample(mean.target.size)
        with self._scheduler.timer.measure(accumulate.name):
            if number == 1:
                mean.target.copy_from(targets.own_picture(slot))
            sample.copy_from(further.own_picture(slot))
            accumulate.run(number, mean.target)
        targets.means[slot] = replace(mean, samples=number + 1, number=self._slots.next_number())
        return True

    def _draw_visibility(self, number: int, targets: PictureTargets) -> PictureTargets:
        """Targets whose visibility buffer is that of sample `number`."""
        inputs, shown, further = targets.inputs, targets.visibility, self._further
        if inputs is None or inputs.camera is None:
            raise RuntimeError("draw the visibility buffer first")
        if further is None or (further.visibility.size, further.visibility.content) != (shown.size, shown.content):
            self.release()
            further = PictureTargets(VisibilityTarget(self._context, shown.size, shown.content), targets.composite)
            self._further = further
        drawn = self._drawer.draw(inputs.camera, further.visibility, number)
        further.inputs, further.materials = replace(drawn, anisotropy=inputs.anisotropy), targets.materials
        return further

    def release(self) -> None:
        """Free what further samples are drawn into; the means belong to their targets."""
        if self._further is not None:
            self._further.release_inputs()
        if self._accumulate is not None:
            self._accumulate.release()
        self._further = self._accumulate = None
