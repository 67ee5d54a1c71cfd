"""Draws the pictures of slots: planes of maps, as images or by a decode path of a pack, and what a view makes of them."""

from dataclasses import replace

from ntc.codec.maps import PLANE_OF_MAP, Plane
from viewer.gl.context import GraphicsContext
from viewer.render.gpu_pack import GpuPack
from viewer.render.gpu_packs import GpuPacks, naming_memory_errors
from viewer.render.image_sources import ImageSources
from viewer.render.pass_scheduler import Output, PassScheduler
from viewer.render.passes.decode_pass import DecodePass
from viewer.render.passes.visible_latents import VisibleLatents
from viewer.render.picture_shading import Mixture, PictureShading
from viewer.render.picture_targets import Picture, PictureTargets, PlaneKey
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.visibility_buffer import VisibilityTarget
from viewer.render.scene_drawer import SceneDrawer
from viewer.render.tile_cache.cached_path import CachedPath
from viewer.state.view_state import REFERENCE, Slot, is_image_source

PREPARED_SIZE = (16, 16)
"""Pixels that `prepare` draws."""


def _described(source: str) -> str:
    if source == REFERENCE:
        return "the reference"
    return source if is_image_source(source) else f"pack {source}"


class SlotDrawer:
    """Hands the passes of a slot to the scheduler, which runs those that have something to do."""

    def __init__(
        self,
        context: GraphicsContext,
        scheduler: PassScheduler,
        packs: GpuPacks,
        images: ImageSources,
        shading: PictureShading,
    ) -> None:
        self._context, self._scheduler = context, scheduler
        self._packs, self._images, self._shading = packs, images, shading
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

    def _holds(self, key: PlaneKey) -> bool:
        if is_image_source(key.slot.source):
            return self._images.holds(key.slot.source, key.plane)
        return self._packs.holds(key.slot.source, key.plane)

    def source_version(self, slot: Slot) -> int:
        """Number of what a slot shows: differs whenever its picture may."""
        return 0 if is_image_source(slot.source) else self._packs.version(slot)

    def draw(self, slot: Slot, targets: PictureTargets) -> Picture:
        """The slot's picture of the last view, drawn as far as this frame takes it.

        Raises GpuMemoryError that names the pack, ShaderError.
        """
        targets.drawn.pop(slot, None)
        keys = self.keys(slot, targets)
        outputs = {plane: self.draw_plane(key, targets) for plane, key in keys.items()}
        if targets.materials.view == "base":
            target, output = targets.planes[keys["base"]], outputs["base"]
        else:
            target, output = self._shade(slot, targets, keys, list(outputs.values()))
        picture = targets.drawn[slot] = Picture(target, output, self.source_version(slot))
        return picture

    def _shade(
        self, slot: Slot, targets: PictureTargets, keys: dict[Plane, PlaneKey], reads: list[Output]
    ) -> tuple[ColorTarget, Output]:
        mixture, shown = None, {plane: targets.planes[key] for plane, key in keys.items()}
        if slot.maps != "all":
            mixture = Mixture(slot.maps, shown)
            originals = {plane: PlaneKey(Slot(), plane) for plane in keys}
            reads += [self.draw_plane(key, targets) for key in originals.values()]
            shown = {plane: targets.planes[key] for plane, key in originals.items()}
        if slot not in targets.shaded:
            targets.shaded[slot] = ColorTarget(self._context, targets.visibility.size)
        target = targets.shaded[slot]
        with self._scheduler.timer.owned_by(slot):
            return target, self._shading.draw(targets.view, shown, targets.materials, target, mixture, reads)

    def draw_plane(self, key: PlaneKey, targets: PictureTargets) -> Output:
        """One plane of the last view, drawn as far as this frame takes it. Raises GpuMemoryError that names the pack, ShaderError."""
        slot = key.slot
        if key not in targets.planes:
            targets.planes[key] = ColorTarget(self._context, targets.visibility.size, is_image_source(slot.source))
        # Names the pack itself.
        pack = None if is_image_source(slot.source) else self._packs.on_gpu(slot)
        with naming_memory_errors(_described(slot.source)):
            return self._draw_images(key, targets) if pack is None else self._decode(key, pack, targets)

    def _draw_images(self, key: PlaneKey, targets: PictureTargets) -> Output:
        images, inputs = self._images.of(key.slot.source, key.plane), targets.inputs_of(key)
        uploads = images.uploads
        uploaded = self._scheduler.advance(uploads, inputs.visible_materials, uploads, (uploads.places,))
        with self._scheduler.timer.owned_by(key):
            return self._scheduler.run(images, inputs, targets.planes[key], (uploaded,))

    def _decode(self, key: PlaneKey, pack: GpuPack, targets: PictureTargets) -> Output:
        slot, scheduler, target, inputs = key.slot, self._scheduler, targets.planes[key], targets.inputs_of(key)
        version, decode = Output(pack.version), pack.decoder(slot.path, slot.filter, key.plane)
        self.prepared.add(slot)
        if isinstance(decode, CachedPath):
            with scheduler.timer.owned_by(key):
                return scheduler.advance(decode, inputs, target, (version,))
        latents = pack.latents(key.plane)
        needed = targets.latents.setdefault(latents, VisibleLatents())
        read = (version, scheduler.advance(latents, inputs, needed, (version,)))
        with scheduler.timer.owned_by(key):
            if isinstance(decode, DecodePass):
                return scheduler.run(decode, inputs, target, read)
            return scheduler.advance(decode, inputs, target, read)

    def prepare(self, slot: Slot, targets: PictureTargets, drawer: SceneDrawer) -> bool:
        """Compile what `slot` needs, by drawing a few pixels of the last view with it; False if that was done before."""
        if slot in self.prepared or slot.source not in self._packs or slot.path == "auto":
            return False
        self.prepared.add(slot)
        few = PictureTargets(VisibilityTarget(self._context, PREPARED_SIZE, targets.visibility.content))
        try:
            few.show(drawer.redraw(few.visibility), targets.materials)
            for key in self.keys(slot, targets).values():
                if not is_image_source(key.slot.source):
                    self.draw_plane(key, few)
        finally:
            self._scheduler.forget()
            few.release()
        return True
