"""Drawing of slots: their planes of maps (images, or a decode path), the shading of a view, and means of samples."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from ntc.codec.maps import PLANE_OF_MAP, MapName, Plane
from viewer.render.gpu_packs import GpuPack, GpuPacks, naming_memory_errors
from viewer.render.image_sources import ImageSources
from viewer.render.light_drawer import LightDrawer
from viewer.render.pass_scheduler import Output, PassTarget
from viewer.render.passes.blend_samples import BlendInputs, BlendMean, BlendSamplesPass
from viewer.render.passes.shade import ShadeInputs, ShadePass
from viewer.render.passes.visible_latents import VisibleLatents
from viewer.render.picture_targets import Picture, PictureTargets, PlaneKey
from viewer.render.render_context import RenderContext
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.visibility_buffer import VisibilityInputs, VisibilityTarget
from viewer.render.scene_drawer import SceneDrawer
from viewer.scene.model import Scene
from viewer.state.view_state import REFERENCE, Slot, is_image_source

PREPARED_SIZE = (16, 16)
"""Width and height of the picture that `prepare` draws, in pixels."""


def _described(source: str) -> str:
    if source == REFERENCE:
        return "the reference"
    return source if is_image_source(source) else f"pack {source}"


class SlotDrawer:
    """Drawing of slots. It gives the passes of a slot to the scheduler, which runs the outdated ones."""

    def __init__(self, context: RenderContext, packs: GpuPacks, images: ImageSources, light: LightDrawer) -> None:
        self._context, self._scheduler = context.graphics, context.scheduler
        self._packs, self._images, self._light = packs, images, light
        self._shade = ShadePass(context.graphics, context.programs)
        self.prepared: set[Slot] = set()
        """Slots whose programs have been compiled."""

    def keys(self, slot: Slot, targets: PictureTargets) -> dict[Plane, PlaneKey]:
        """Return the planes that the picture of `slot` in the last view is made from.

        Planes that a pack or a format lacks come from the original images.
        """
        keys = {}
        for plane in targets.materials.planes:
            key = PlaneKey(replace(slot, maps="all"), plane)
            is_shown = slot.maps == "all" or PLANE_OF_MAP[slot.maps] == plane
            keys[plane] = key if is_shown and self._holds(key) else PlaneKey(Slot(), plane)
        return keys

    def _holds(self, key: PlaneKey) -> bool:
        if is_image_source(key.slot.source):
            return self._images.holds(key.slot.source, key.plane)
        return self._packs.holds(key.slot.source, key.plane)

    def source_version(self, slot: Slot) -> int:
        """Return the version of the pack that a slot shows, 0 for images; it changes whenever the picture may change."""
        return 0 if is_image_source(slot.source) else self._packs.version(slot)

    def draw(self, slot: Slot, targets: PictureTargets) -> Picture:
        """Draw the slot in the last view, as far as this frame's budget allows.

        Raises GpuMemoryError that names the pack, ShaderError.
        """
        targets.drawn.pop(slot, None)
        keys = self.keys(slot, targets)
        outputs = self._draw_planes(keys.values(), targets)
        if targets.materials.view == "base":
            target, output = targets.planes[keys["base"]], outputs[keys["base"]]
        else:
            target, output = self._shaded(slot, targets, keys, list(outputs.values()))
        picture = targets.drawn[slot] = Picture(target, output, self.source_version(slot))
        return picture

    def _shaded(
        self, slot: Slot, targets: PictureTargets, keys: Mapping[Plane, PlaneKey], reads: list[Output]
    ) -> tuple[ColorTarget, Output]:
        """Shade a view other than `base`. Maps that `slot` leaves out come from the original images."""
        view, shown = targets.materials.view, {plane: targets.planes[key] for plane, key in keys.items()}
        light, other, taken = None, None, frozenset[MapName]()
        if slot.maps != "all":
            other, taken = shown, frozenset({slot.maps})
            originals = {plane: PlaneKey(Slot(), plane) for plane in keys}
            reads += [self.draw_plane(key, targets) for key in originals.values()]
            shown = {plane: targets.planes[key] for plane, key in originals.items()}
        if slot not in targets.shaded:
            targets.shaded[slot] = ColorTarget(self._context, targets.visibility.size)
        target = targets.shaded[slot]
        with self._scheduler.timer.owned_by(slot):
            if view == "lit":
                light = self._light.prepare_or_sky(targets.materials.lighting)
                reads += light.outputs
            inputs = ShadeInputs(targets.view, shown, view, light, other, taken)
            return target, self._scheduler.advance(self._shade, inputs, target, reads)

    def draw_plane(self, key: PlaneKey, targets: PictureTargets) -> Output:
        """Draw one plane of the last view, as far as the budget allows. Raises GpuMemoryError that names the pack, ShaderError."""
        return self._draw_planes((key,), targets)[key]

    def _draw_planes(self, keys: Collection[PlaneKey], targets: PictureTargets) -> dict[PlaneKey, Output]:
        outputs: dict[PlaneKey, Output] = {}
        for slot in dict.fromkeys(key.slot for key in keys):
            slot_keys = [key for key in keys if key.slot == slot]
            is_image = is_image_source(slot.source)
            # Outside `naming_memory_errors`, because on_gpu names the pack itself.
            pack = None if is_image else self._packs.on_gpu(slot)
            for key in slot_keys:
                if key not in targets.planes:
                    targets.planes[key] = ColorTarget(self._context, targets.visibility.size, is_image)
            with naming_memory_errors(_described(slot.source)):
                if pack is None:
                    outputs |= {key: self._draw_images(key, targets) for key in slot_keys}
                elif pack.decodes_planes(slot.path):
                    outputs |= self._decode_pixels(slot_keys, pack, targets)
                else:
                    for key in slot_keys:
                        outputs |= self._decode(key, pack, targets)
        return outputs

    def _draw_images(self, key: PlaneKey, targets: PictureTargets) -> Output:
        images, inputs = self._images.of(key.slot.source, key.plane), targets.inputs_of(key)
        uploads = images.uploads
        uploaded = self._scheduler.advance(uploads, inputs.visible_materials, uploads, (uploads.places,))
        return self._scheduler.advance(images, inputs, targets.planes[key], (uploaded,), key)

    def _decode(self, key: PlaneKey, pack: GpuPack, targets: PictureTargets) -> dict[PlaneKey, Output]:
        scheduler, target, inputs = self._scheduler, targets.planes[key], targets.inputs_of(key)
        version = Output(pack.version)
        if key.slot.path == "cached":
            cached = pack.cached(key.plane)
            self.prepared.add(key.slot)
            return {key: scheduler.advance(cached, inputs, target, (version,), key)}
        if key.slot.path == "on-load":
            images = pack.on_load(key.plane)
            self.prepared.add(key.slot)
            textures = images.uploads
            loaded = scheduler.advance(textures, inputs.visible_materials, textures, (version,))
            return {key: scheduler.advance(images, inputs, target, (loaded,), key)}
        return self._decode_pixels((key,), pack, targets)

    def _decode_pixels(
        self, keys: Sequence[PlaneKey], pack: GpuPack, targets: PictureTargets
    ) -> dict[PlaneKey, Output]:
        """Decode planes of one slot by a path that decodes every pixel: one plane, or several if one pass decodes them all."""
        slot, version, parts = keys[0].slot, Output(pack.version), []
        decode = pack.decoder(slot.path, slot.filter, None if pack.decodes_planes(slot.path) else keys[0].plane)
        self.prepared.add(slot)
        for key in keys:
            inputs, latents = targets.inputs_of(key), pack.latents(key.plane)
            needed = targets.latents.setdefault(latents, VisibleLatents())
            read = (version, self._scheduler.advance(latents, inputs, needed, (version,)))
            parts.append(PassTarget(inputs, targets.planes[key], read, key))
        return dict(zip(keys, self._scheduler.advance_all(decode, parts), strict=True))

    def prepare(self, slot: Slot, targets: PictureTargets, drawer: SceneDrawer) -> bool:
        """Compile the programs of `slot` by drawing a few pixels of the last view; return False if that was done before."""
        if slot in self.prepared or slot.source not in self._packs or slot.path == "auto":
            return False
        self.prepared.add(slot)
        few = PictureTargets(VisibilityTarget(self._context, PREPARED_SIZE, targets.visibility.content))
        try:
            few.show(drawer.redraw(few.visibility), targets.materials)
            keys = self.keys(slot, targets).values()
            self._draw_planes([key for key in keys if not is_image_source(key.slot.source)], few)
        finally:
            self._scheduler.forget()
            few.release()
        return True

    def release(self) -> None:
        """Free the shading pass; planes and pictures belong to their PictureTargets."""
        self._shade.release()


def dithered_materials(scene: Scene) -> frozenset[int]:
    """Return the materials whose coverage differs from sample to sample: alphaMode BLEND, neither clear nor opaque everywhere."""
    has_colors = scene.geometry.colors is not None
    dithered = []
    for number, material in enumerate(scene.materials):
        has_alpha = material.texture_id >= 0 and scene.textures[material.texture_id].has_alpha
        if material.alpha_mode == "blend" and (has_alpha or has_colors or 0.0 < material.factor[3] < 1.0):
            dithered.append(number)
    return frozenset(dithered)


class BlendDrawer:
    """Drawing of the shown pictures of slots: one sample, or the mean of several if BLEND surfaces may be visible.

    Further samples have a separate visibility buffer and planes, so ids, divergence and planes are always those of the first sample.
    """

    def __init__(self, context: RenderContext, drawer: SceneDrawer, slots: SlotDrawer) -> None:
        self._context, self._scheduler = context.graphics, context.scheduler
        self._drawer, self._slots = drawer, slots
        self._materials = dithered_materials(context.scene)
        self._pass = BlendSamplesPass(context.graphics, context.programs, self._draw_sample)
        self._further: PictureTargets | None = None
        """Targets of further samples."""

    def is_needed(self, view: VisibilityInputs) -> bool:
        """Return whether a picture of this view needs more than one sample."""
        return not self._materials.isdisjoint(view.visible_materials) and view != self._pass.given_up

    def show(self, slot: Slot, targets: PictureTargets) -> Picture:
        """Draw the picture to show for a slot. Raises GpuMemoryError that names the pack, ShaderError."""
        first = picture = self._slots.draw(slot, targets)
        if not self.is_needed(targets.view):
            targets.release_means()
        elif first.output.is_complete:
            mean = targets.means.setdefault(slot, BlendMean(targets.visibility.size))
            inputs = BlendInputs(slot, first.target, targets.view, targets.materials)
            timing = self._scheduler.timer.counted_as
            output = self._scheduler.advance(self._pass, inputs, mean, (first.output,), timing=timing)
            target = first.target if mean.samples == 1 or mean.target is None else mean.target
            picture = Picture(target, output, first.source_version)
        targets.shown[slot] = picture
        return picture

    def _draw_sample(self, inputs: BlendInputs, number: int) -> ColorTarget | None:
        """Draw sample `number`; return None if it stays incomplete. Raises GpuMemoryError, ShaderError."""
        shown, further, camera = inputs.view.visibility, self._further, inputs.view.camera
        assert camera is not None
        if further is None or (further.visibility.size, further.visibility.content) != (shown.size, shown.content):
            self.release()
            further = PictureTargets(VisibilityTarget(self._context, shown.size, shown.content))
            self._further = further
        drawn = self._drawer.draw(camera, further.visibility, number)
        further.show(replace(drawn, anisotropy=inputs.view.anisotropy), inputs.materials)
        with self._scheduler.drawing(whole=True):
            sampled = self._slots.draw(inputs.slot, further)
        # Incomplete means that the tile cache is too small. Both pictures would evict each other's tiles without end.
        return sampled.target if sampled.output.is_complete else None

    def release(self) -> None:
        """Free the targets of further samples; the means belong to their PictureTargets."""
        if self._further is not None:
            self._further.release()
            self._further = None
        self._pass.release()
