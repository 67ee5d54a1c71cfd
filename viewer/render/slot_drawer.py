"""Draws the albedos of slots: as images, or by a decode path of a pack."""

from collections.abc import Mapping

from viewer.gl.context import GraphicsContext
from viewer.render.gpu_packs import GpuPacks, naming_memory_errors
from viewer.render.image_sources import ImageSources
from viewer.render.pass_scheduler import PassScheduler
from viewer.render.picture_targets import DrawnAlbedo, PictureTargets
from viewer.render.resources.albedo_target import AlbedoTarget
from viewer.render.resources.visibility_buffer import VisibilityTarget
from viewer.render.scene_drawer import SceneDrawer
from viewer.state.view_state import REFERENCE, Slot, is_image_source

PREPARED_SIZE = (16, 16)
"""Pixels that `prepare` draws."""


def _described(source: str) -> str:
    if source == REFERENCE:
        return "the reference"
    return source if is_image_source(source) else f"pack {source}"


class SlotDrawer:
    """Albedos are drawn where the picture's targets lack them, and again while their decode path has more to show."""

    def __init__(
        self, context: GraphicsContext, scheduler: PassScheduler, packs: GpuPacks, images: ImageSources
    ) -> None:
        self._context, self._scheduler, self._packs, self._images = context, scheduler, packs, images
        self._draws = 0
        self.prepared: set[Slot] = set()
        """Slots whose programs have been used."""

    def _version(self, slot: Slot) -> int:
        return 0 if is_image_source(slot.source) else self._packs.version(slot)

    def is_drawn(self, slot: Slot, targets: PictureTargets) -> bool:
        """Whether the slot's albedo is that of the last view, though tiles may be missing."""
        drawn = targets.drawn.get(slot)
        return drawn is not None and drawn.inputs == targets.inputs_of(slot) and drawn.version == self._version(slot)

    def is_complete(self, slot: Slot, targets: PictureTargets) -> bool:
        """Whether drawing the slot's albedo again would not change it."""
        if not self.is_drawn(slot, targets):
            return False
        return is_image_source(slot.source) or not self._packs.on_gpu(slot).path(slot.path, slot.filter).is_waiting

    def update(self, slot: Slot, targets: PictureTargets, whole: bool) -> None:
        """Draw the slot's albedo, or a part of it, unless it is complete. Raises GpuMemoryError that names the pack, ShaderError."""
        if self.is_complete(slot, targets):
            self._scheduler.skipped["passes"] += 1
            return
        is_image, timer, inputs = is_image_source(slot.source), self._scheduler.timer, targets.inputs_of(slot)
        drawn = targets.drawn.get(slot)
        same_view = drawn is not None and drawn.inputs == inputs and not whole
        path = None if is_image else self._packs.on_gpu(slot).path(slot.path, slot.filter)
        if path is not None and same_view and path.decode_ahead():
            self._scheduler.skipped["passes"] += 1
            return
        if slot not in targets.albedo:
            targets.albedo[slot] = AlbedoTarget(self._context, targets.visibility.size, half=is_image)
        target = targets.albedo[slot]
        # While it is drawn anew its content is void.
        targets.drawn.pop(slot, None)
        with naming_memory_errors(_described(slot.source)):
            if path is None:
                images = self._images[slot.source]
                with timer.measure("upload"):
                    images.upload(inputs.visible_materials)
                with timer.measure(images.name):
                    images.run(inputs, target)
                spent = timer.last_ms
            else:
                spent = path.draw(inputs, target, whole, same_view)
                self.prepared.add(slot)
        if path is not None and path.is_partial:
            # The composite of the picture before is shown until all rows are drawn.
            if drawn is not None:
                targets.drawn[slot] = drawn
            return
        targets.slot_ms[slot] = spent
        self._draws += 1
        targets.drawn[slot] = DrawnAlbedo(inputs, self._version(slot), self._draws)

    def samples(self, slots: Mapping[Slot, Slot]) -> dict[Slot, int]:
        """Samples in the pictures of those of `slots` that are drawn with the stochastic filter, by the keys of what draws them."""
        sampled = {
            slot: own for slot, own in slots.items() if not is_image_source(own.source) and own.filter != "exact"
        }
        return {slot: self._packs.on_gpu(own).path(own.path, own.filter).samples for slot, own in sampled.items()}

    def prepare(self, slot: Slot, targets: PictureTargets, drawer: SceneDrawer) -> bool:
        """Compile what `slot` needs, by drawing a few pixels of the last view with it; False if that was done before."""
        if slot in self.prepared or slot.source not in self._packs or slot.path == "auto":
            return False
        self.prepared.add(slot)
        with self._context.memory.transaction():
            visibility = VisibilityTarget(self._context, PREPARED_SIZE, targets.visibility.content)
            target = AlbedoTarget(self._context, PREPARED_SIZE)
        try:
            self._packs.on_gpu(slot).path(slot.path, slot.filter).draw(drawer.redraw(visibility), target, whole=False)
        finally:
            self._scheduler.timer.take()
            visibility.release()
            target.release()
        return True
