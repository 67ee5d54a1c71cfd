"""Draws the pictures of slots: planes of maps, as images or by a decode path of a pack, and what a view makes of them."""

from collections.abc import Mapping
from dataclasses import replace

from ntc.codec.maps import PLANE_OF_MAP, Plane
from viewer.gl.context import GraphicsContext
from viewer.render.gpu_packs import GpuPacks, naming_memory_errors
from viewer.render.image_sources import ImageSources
from viewer.render.pass_scheduler import PassScheduler
from viewer.render.picture_shading import Mixture, PictureShading
from viewer.render.picture_targets import DrawnPicture, DrawnPlane, PictureKey, PictureTargets, PlaneKey
from viewer.render.plane_path import PlanePath
from viewer.render.resources.color_target import ColorTarget
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
    """Planes are drawn where the picture's targets lack them, and again while their decode path has more to show."""

    def __init__(
        self,
        context: GraphicsContext,
        scheduler: PassScheduler,
        packs: GpuPacks,
        images: ImageSources,
        shading: PictureShading,
        waits: bool = True,
    ) -> None:
        self._context, self._scheduler, self._packs, self._images = context, scheduler, packs, images
        self._shading, self._waits = shading, waits
        self._draws = 0
        self.prepared: set[Slot] = set()
        """Slots whose programs have been used."""

    def keys(self, slot: Slot, targets: PictureTargets) -> dict[Plane, PlaneKey]:
        """The planes of what `slot` decodes that its picture of the last view is made from.

        Maps that a pack or a format lacks are those of the original images.
        """
        found = {}
        for plane in targets.materials.planes:
            key = PlaneKey(replace(slot, maps="all"), plane)
            wanted = slot.maps == "all" or PLANE_OF_MAP[slot.maps] == plane
            found[plane] = key if wanted and self._holds(key) else PlaneKey(Slot(), plane)
        return found

    def _all_keys(self, slot: Slot, targets: PictureTargets) -> tuple[PlaneKey, ...]:
        """The same, and those of the original images that a single map of the slot is mixed with."""
        keys = self.keys(slot, targets)
        is_mixed = slot.maps != "all" and targets.materials.view != "base"
        mixed = [PlaneKey(Slot(), plane) for plane in keys] if is_mixed else []
        return tuple(dict.fromkeys((*keys.values(), *mixed)))

    def _holds(self, key: PlaneKey) -> bool:
        if is_image_source(key.slot.source):
            return self._images.holds(key.slot.source, key.plane)
        return self._packs.holds(key.slot.source, key.plane)

    def _path(self, key: PlaneKey) -> PlanePath | None:
        """None for images."""
        slot = key.slot
        if is_image_source(slot.source):
            return None
        return self._packs.on_gpu(slot).path(slot.path, slot.filter, key.plane)

    def _version(self, key: PlaneKey) -> int:
        source = key.slot.source
        return self._images.of(source, key.plane).version if is_image_source(source) else self._packs.version(key.slot)

    def _is_plane_drawn(self, key: PlaneKey, targets: PictureTargets) -> bool:
        drawn = targets.drawn.get(key)
        return drawn is not None and (drawn.inputs, drawn.version) == (targets.inputs_of(key), self._version(key))

    def _is_plane_complete(self, key: PlaneKey, targets: PictureTargets) -> bool:
        if not self._is_plane_drawn(key, targets):
            return False
        path = self._path(key)
        if path is None:
            return not self._images.of(key.slot.source, key.plane).is_waiting
        return not path.is_waiting

    def _picture_key(self, slot: Slot, targets: PictureTargets) -> PictureKey | None:
        """None before all planes are there."""
        keys = self._all_keys(slot, targets)
        if targets.inputs is None or not all(key in targets.drawn for key in keys):
            return None
        return PictureKey(targets.materials, tuple((key, targets.drawn[key].number) for key in keys), targets.inputs)

    def _is_picture_drawn(self, slot: Slot, targets: PictureTargets) -> bool:
        if targets.materials.view == "base":
            return True
        drawn = targets.drawn_pictures.get(slot)
        return drawn is not None and drawn.key == self._picture_key(slot, targets)

    def is_drawn(self, slot: Slot, targets: PictureTargets) -> bool:
        """Whether the slot's picture is that of the last view, though tiles may be missing."""
        planes = self._all_keys(slot, targets)
        return all(self._is_plane_drawn(key, targets) for key in planes) and self._is_picture_drawn(slot, targets)

    def is_complete(self, slot: Slot, targets: PictureTargets) -> bool:
        """Whether drawing the slot's picture again would not change it."""
        planes = self._all_keys(slot, targets)
        return all(self._is_plane_complete(key, targets) for key in planes) and self._is_picture_drawn(slot, targets)

    def update(self, slot: Slot, targets: PictureTargets, whole: bool) -> None:
        """Draw the slot's picture, or a part of it, unless it is complete. Raises GpuMemoryError that names the pack, ShaderError."""
        for key in self._all_keys(slot, targets):
            self._update_plane(key, targets, whole)
        if self._is_picture_drawn(slot, targets):
            return
        picture_key = self._picture_key(slot, targets)
        if picture_key is None:
            return
        if slot not in targets.pictures:
            targets.pictures[slot] = ColorTarget(self._context, targets.visibility.size)
        targets.drawn_pictures.pop(slot, None)
        planes = {plane: targets.planes[key] for plane, key in self.keys(slot, targets).items()}
        mixture = None
        if slot.maps != "all":
            mixture = Mixture(slot.maps, planes)
            planes = {plane: targets.planes[PlaneKey(Slot(), plane)] for plane in planes}
        picture = targets.pictures[slot]
        with self._scheduler.timer.owned_by(slot):
            self._shading.draw(picture_key.inputs, planes, targets.materials, picture, mixture)
        targets.drawn_pictures[slot] = DrawnPicture(picture_key, self.next_number())

    def _update_plane(self, key: PlaneKey, targets: PictureTargets, whole: bool) -> None:
        if self._is_plane_complete(key, targets):
            self._scheduler.skipped["passes"] += 1
            return
        slot, timer, inputs = key.slot, self._scheduler.timer, targets.inputs_of(key)
        drawn = targets.drawn.get(key)
        same_view = drawn is not None and drawn.inputs == inputs and not whole
        path = self._path(key)
        if path is not None and same_view and path.decode_ahead(inputs):
            self._scheduler.skipped["passes"] += 1
            return
        if key not in targets.planes:
            targets.planes[key] = ColorTarget(self._context, targets.visibility.size, half=path is None)
        target = targets.planes[key]
        # While it is drawn anew its content is void.
        targets.drawn.pop(key, None)
        with naming_memory_errors(_described(slot.source)):
            if path is None:
                images = self._images.of(slot.source, key.plane)
                with timer.measure("upload"):
                    images.upload(inputs.visible_materials, whole or self._waits)
                if same_view and drawn is not None and drawn.version == images.version:
                    # What is still to come has not come yet.
                    targets.drawn[key] = drawn
                    self._scheduler.skipped["passes"] += 1
                    return
                with timer.owned_by(key), timer.measure(images.name):
                    images.run(inputs, target)
            else:
                with timer.owned_by(key):
                    path.draw(inputs, target, whole, same_view)
                self.prepared.add(slot)
        if path is not None and path.is_partial:
            # The composite of the picture before is shown until all rows are drawn.
            if drawn is not None:
                targets.drawn[key] = drawn
            return
        targets.drawn[key] = DrawnPlane(inputs, self._version(key), self.next_number())

    def next_number(self) -> int:
        """A number for what is drawn next: positive, and no other drawing's."""
        self._draws += 1
        return self._draws

    def samples(self, slots: Mapping[Slot, Slot]) -> dict[Slot, int]:
        """Samples in the pictures of those of `slots` that are drawn with the stochastic filter, by the keys of what draws them."""
        sampled = {
            slot: own for slot, own in slots.items() if not is_image_source(own.source) and own.filter != "exact"
        }
        return {slot: self._packs.on_gpu(own).samples(own.path, own.filter) for slot, own in sampled.items()}

    def prepare(self, slot: Slot, targets: PictureTargets, drawer: SceneDrawer) -> bool:
        """Compile what `slot` needs, by drawing a few pixels of the last view with it; False if that was done before."""
        if slot in self.prepared or slot.source not in self._packs or slot.path == "auto":
            return False
        self.prepared.add(slot)
        with self._context.memory.transaction():
            visibility = VisibilityTarget(self._context, PREPARED_SIZE, targets.visibility.content)
            target = ColorTarget(self._context, PREPARED_SIZE)
        try:
            inputs = drawer.redraw(visibility)
            for key in self._all_keys(slot, targets):
                path = self._path(key)
                if path is not None:
                    path.draw(inputs.of_plane(key.plane), target, whole=False)
        finally:
            self._scheduler.timer.forget()
            visibility.release()
            target.release()
        return True
