"""Renderer of a scene: the passes of a frame in their order. Passes whose inputs have not changed are skipped."""

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ntc.codec.gpu import VariantName
from ntc.codec.maps import PLANES, Plane
from ntc.codec.model import Pack
from ntc.pack.match import PackMatch
from viewer.gl.context import GraphicsContext
from viewer.gl.context_loss import checks_context
from viewer.gl.read_back import PicturePart
from viewer.gl.timer import PassTimer
from viewer.render.compositor import Compositor
from viewer.render.frames import DrawnPair, FrameResult, PackMemory, PairKey, UploadCounts
from viewer.render.gpu_packs import GpuPacks
from viewer.render.image_sources import ImageSources
from viewer.render.light_drawer import LightDrawer
from viewer.render.pass_scheduler import Output, PassScheduler, Pending, largest_of_each
from viewer.render.passes.composite import CompositeTarget
from viewer.render.passes.load_textures import LoadCounts
from viewer.render.path_choice import PathChooser
from viewer.render.picture_targets import PictureTargets, shown_materials, surface_content
from viewer.render.render_context import RenderContext
from viewer.render.resources.divergence_maps import Stage
from viewer.render.resources.latent_store import LatentBudget
from viewer.render.resources.pack_buffers import scene_programs
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.render.resources.tile_cache.budget import TileBudget, TileCacheConfig
from viewer.render.resources.visibility_buffer import VisibilityTarget
from viewer.render.scene_drawer import SceneDrawer
from viewer.render.slot_drawer import BlendDrawer, SlotDrawer
from viewer.scene.model import Camera, Scene
from viewer.state.compare_layout import shown_slots
from viewer.state.view_state import REFERENCE, Slot, ViewState

UPDATE_BYTES = 8 << 20
"""Default upload budget of a frame for newer versions of packs, in bytes (`Renderer.update_pack`)."""


DRAWINGS_TIMED = 3
"""Largest number of drawings that `drawing_ms` takes the median of."""
LONGEST_TIMING_MS = 500.0
"""Time in ms after which `drawing_ms` draws no more."""


class Renderer:
    """Renderer of one scene with any number of packs. All calls belong to the thread of its OpenGL context."""

    def __init__(
        self,
        context: GraphicsContext,
        scene: Scene,
        divergence_stage: Stage = "compute",
        tile_cache: TileCacheConfig | None = None,
        latents: LatentBudget | None = None,
        emulate_half: bool = False,
        update_bytes: int = UPDATE_BYTES,
        variant: VariantName | None = None,
    ) -> None:
        """Upload the scene. `update_bytes`: upload budget of a frame for newer versions of packs. For the rest see RenderContext.

        If the context waits for the GPU, a frame knows its times and the mips and tiles that it needs within the frame; else they are
        taken from a frame or two before. Raises GpuMemoryError.
        """
        if not context.features.compute:
            divergence_stage = "fragment"
        self._context, self._update_bytes = context, update_bytes
        self.scene, self.reset = scene, context.reset
        self.name = context.info.renderer
        """The driver's name of the GPU, or of the software renderer."""
        self._programs = scene_programs(context)
        self._blocked = context.memory.blocking.count
        self._timer = PassTimer(context)
        self._scheduler = PassScheduler(self._timer)
        self.tile_budget = TileBudget(tile_cache)
        """Budget that receives measured frame times (`note_frame`)."""
        with context.memory.transaction():
            self._scene_buffers = SceneBuffers(context, scene)
            shared = RenderContext(
                context,
                self._programs,
                scene,
                self._scene_buffers,
                self._scheduler,
                self.tile_budget,
                latents or LatentBudget(),
                emulate_half,
                variant,
            )
            self.images = ImageSources(shared)
            self._compositor = Compositor(shared, divergence_stage)
        self.errors = self._compositor.errors
        """Results of the comparison of A and B, for overlays and the FLIP map."""
        self._drawer = SceneDrawer(shared)
        self._packs = GpuPacks(shared)
        self.light = LightDrawer(shared, self._drawer)
        """Light of the scene; its `problem` is a message if the environment cannot be used."""
        self._slots = SlotDrawer(shared, self._packs, self.images, self.light)
        self._blend = BlendDrawer(shared, self._drawer, self._slots)
        self.paths = PathChooser(shared, self._drawer, self._packs, self._slots)
        self._targets: PictureTargets | None = None
        self._composite: CompositeTarget | None = None
        """Composite of the size of `_targets`."""
        self._picture: CompositeTarget | None = None
        """Image of the last frame that was finished."""
        self._view: ViewState | None = None
        """Last view; None if it could not be drawn."""

    @property
    def matches(self) -> Mapping[str, PackMatch]:
        """Match of each open pack with the scene, by the pack's name."""
        return self._packs.matches

    def set_packs(self, packs: Mapping[str, Pack]) -> None:
        """Replace the open packs. Absent packs are freed; differences of replaced packs are uploaded at once."""
        self._packs.set_packs(packs)
        self._slots.prepared = {slot for slot in self._slots.prepared if slot.source in packs}

    def update_pack(self, name: str, pack: Pack) -> None:
        """Open a pack, or replace the open one of that name by another version.

        The next frames upload the groups that differ, a few MB in each, and draw the older version until the newer one is complete. A
        pack of other textures or of another codec is uploaded whole when it is drawn.
        """
        self._packs.update_pack(name, pack)

    def memory(self, slot: Slot) -> PackMemory | None:
        """Return the GPU memory of the slot's pack with the slot's path; None for images, and before the slot's first frame."""
        on_gpu = self._packs.uploaded(slot)
        if on_gpu is None:
            return None
        used = self.paths.known(slot)
        return on_gpu.memory(used.path, used.filter)

    def loads(self, slot: Slot) -> LoadCounts | None:
        """Return the counts of textures that path `on-load` has compressed for a slot; None for other paths. Waits for the GPU."""
        on_gpu = self._packs.uploaded(slot) if slot.path == "on-load" else None
        if on_gpu is None:
            return None
        on_gpu.measure_loads()
        return on_gpu.loads

    def decoders(self, source: str) -> tuple[int, ...]:
        """Return the decoder of every texture of the scene under the grouping of `source`; -1 where nothing is decoded."""
        return self._packs.counted(source).decoders

    @checks_context
    def render(self, view: ViewState, whole: bool = False) -> FrameResult:
        """Draw `view`. Passes whose inputs have not changed are skipped and counted.

        With `whole` nothing is left for later frames, however long it takes: latents, tiles, images, samples, and newer packs.
        Raises GpuMemoryError if the GPU has too little memory: then the last frame's image stays valid, and the unfinished frame's
        allocations are freed.
        """
        try:
            with self._scheduler.drawing(whole):
                return self._render(view, whole)
        except BaseException:
            self._view = None
            self._discard_frame()
            raise

    def _render(self, view: ViewState, whole: bool) -> FrameResult:
        upload = self._packs.advance_updates(None if whole else self._update_bytes)
        asked = (view.slot_a, view.slot_b)
        view = replace(view, slot_a=self.paths.chosen(view.slot_a, view), slot_b=self.paths.chosen(view.slot_b, view))
        self._view = view
        self._drawer.set_pose(view.pose)
        targets, composite = self._targets_for(view)
        self._draw_visibility(view, targets)
        slots = tuple(dict.fromkeys(shown_slots(view)))
        for slot in slots:
            self._blend.show(slot, targets)
        if not any(targets.samples_left(slot) > 0 for slot in slots):
            self._blend.release()
        targets.release_unused(view)
        groupings = {slot.source: self._packs.counted(slot.source) for slot in slots}
        counted = self._compositor.count_divergence(view, groupings, targets)
        output = self._compositor.draw(view, targets, composite, counted)
        if self._picture is not None and self._picture is not composite:
            self._picture.release()
        self._picture = composite
        return self._result(asked, view, (targets, composite), upload, output)

    def _discard_frame(self) -> None:
        """Discard the results of a frame that could not be finished."""
        self._scheduler.forget()
        targets = self._targets
        if targets is not None:
            self._scheduler.invalidate(targets.visibility)
        if self._composite is not self._picture:
            # The frame had a new size. Free its targets, so the next frame has their memory.
            self._release_targets()

    def _result(
        self,
        asked: tuple[Slot, Slot],
        view: ViewState,
        drawn: tuple[PictureTargets, CompositeTarget],
        upload: UploadCounts,
        output: Output,
    ) -> FrameResult:
        targets, composite = drawn
        counts, skipped = self._drawer.draw_counts(), self._scheduler.skipped
        skipped["images_not_uploaded"] = self.images.images_not_uploaded
        skipped["planes_not_drawn"] = len(PLANES) - len(targets.materials.planes)
        skipped["clusters_culled"] = counts.clusters_culled
        skipped["triangles_culled"] = counts.triangles_culled
        shown = shown_slots(view)
        tiles, short_latents = self._packs.tile_counts(shown, skipped)
        loads = self._packs.load_counts(shown, skipped)
        skipped["tiles_kept"] = sum(counts.reused for counts in tiles.values())
        if upload.unchanged:
            skipped["pack_bytes_kept"] = upload.unchanged
        chosen = dict(zip(asked, (view.slot_a, view.slot_b), strict=True))
        is_blended = self._blend.is_needed(targets.view)
        times = self.take_times()
        before, self._blocked = self._blocked, self._context.memory.blocking.count
        pending = (*output.pending, *([Pending("packs", 1)] if upload.is_pending else []))
        return FrameResult(
            image=composite.texture,
            timings_ms=times,
            slot_ms=self.slot_ms(asked),
            timer=self._timer.kind,
            skipped=self._scheduler.take_skipped(),
            divergence=self._compositor.statistics(view, {slot.source for slot in shown}),
            drawn={"triangles": counts.triangles, "commands": counts.commands},
            tiles=tiles,
            paths={slot: drawn_slot.path for slot, drawn_slot in chosen.items()},
            samples=targets.samples(chosen),
            blend_samples={
                slot: targets.blend_samples(drawn_slot)
                for slot, drawn_slot in chosen.items()
                if is_blended and drawn_slot in shown
            },
            loads=loads,
            short_latents=short_latents,
            upload=upload,
            blocking_calls=self._blocked - before,
            pending=largest_of_each(pending),
        )

    def _targets_for(self, view: ViewState) -> tuple[PictureTargets, CompositeTarget]:
        content, targets, composite = surface_content(view, self._scene_buffers), self._targets, self._composite
        if targets is not None and composite is not None:
            if (targets.visibility.size, targets.visibility.content) == (view.size, content):
                return targets, composite
            self._release_targets()
        with self._context.memory.transaction():
            targets = PictureTargets(VisibilityTarget(self._context, view.size, content))
            composite = CompositeTarget(self._context, view.size)
        self._targets, self._composite = targets, composite
        return targets, composite

    def _draw_visibility(self, view: ViewState, targets: PictureTargets) -> None:
        inputs = self._drawer.draw(view.camera, targets.visibility)
        targets.show(replace(inputs, anisotropy=view.anisotropy), shown_materials(view, inputs))

    def _release_targets(self) -> None:
        """Free all targets of the size of the picture except the image of the last frame."""
        targets, composite = self._targets, self._composite
        self._targets = self._composite = None
        self._blend.release()
        if targets is not None:
            targets.release()
        if composite is not None and composite is not self._picture:
            composite.release()

    def take_times(self) -> dict[str, float]:
        """Return the times of passes, in ms, that have arrived from the GPU since the last call."""
        times = self._timer.take()
        if self._targets is not None:
            self._targets.note_ms(self._timer.take_owned())
        return times

    def slot_ms(self, slots: Sequence[Slot]) -> dict[Slot, float]:
        """Return the time in ms of the last drawing of each of `slots`, if `take_times` has received it."""
        drawn = self._targets.slot_ms() if self._targets is not None else {}
        known = {slot: self.paths.known(slot) for slot in slots}
        return drawn | {slot: drawn[drawn_slot] for slot, drawn_slot in known.items() if drawn_slot in drawn}

    @property
    def _drawn(self) -> tuple[PictureTargets, ViewState]:
        """Targets of the last view, and the view. Raises RuntimeError before the first."""
        if self._targets is None or self._view is None:
            raise RuntimeError("render a view first")
        return self._targets, self._view

    @checks_context
    def drawing_ms(self, slot: Slot) -> float:
        """Draw `slot` in the last view several times, on separate targets; return the median time in ms.

        Draw the slot once before this call, because drivers compile a program when it first draws. With the stochastic filter, a
        drawing is one sample. Raises GpuMemoryError.
        """
        shown, view = self._drawn
        slot, content = self.paths.chosen(slot, view), shown.visibility.content
        with self._context.memory.transaction():
            targets = PictureTargets(VisibilityTarget(self._context, view.size, content))
        drawn: list[float] = []
        try:
            self._draw_visibility(view, targets)
            while len(drawn) < DRAWINGS_TIMED and sum(drawn) < LONGEST_TIMING_MS:
                for target in (*targets.planes.values(), *targets.shaded.values()):
                    self._scheduler.invalidate(target)
                self._scheduler.forget()
                with self._timer.waiting(), self._scheduler.drawing(whole=slot.filter == "exact"):
                    self._slots.draw(slot, targets)
                drawn.append(sum(self._timer.take_owned().values()))
        finally:
            self._scheduler.forget()
            targets.release()
        return statistics.median(drawn)

    def _forget_frame(self, targets: PictureTargets) -> None:
        """Store the times of work outside a frame for its slot, and leave them out of the next frame's times."""
        targets.note_ms(self._timer.take_owned())
        self._scheduler.forget()

    def prepare(self, slot: Slot) -> bool:
        """Compile the programs of `slot` by drawing a few pixels of the last view; return False if that was done before.

        Drivers compile shaders when they are first used. After this call, the first switch to `slot` is as fast as later ones.
        """
        if self._targets is None or self._view is None:
            return False
        return self._slots.prepare(self.paths.known(slot), self._targets, self._drawer)

    def prepare_slots(self) -> bool:
        """Draw a slot of the last view that is not shown yet, so a switch to it is immediate; return whether one was left to draw."""
        targets, view = self._targets, self._view
        if targets is None or view is None:
            return False
        for slot in (view.slot_a, view.slot_b):
            before = self._scheduler.ran
            picture = self._blend.show(slot, targets)
            self._forget_frame(targets)
            if self._scheduler.ran != before or not picture.output.is_complete:
                return True
        return False

    def prepare_comparison(self) -> bool:
        """Compile a program for another comparison mode of the last view; return whether one was left to compile.

        Both slots must have been drawn. A few pixels are drawn, because drivers may delay compiling to the first drawing.
        """
        targets, view = self._targets, self._view
        if targets is None or view is None or not {view.slot_a, view.slot_b} <= targets.shown.keys():
            return False
        return self._compositor.prepare(view, targets)

    def drawn_pair(self) -> DrawnPair | None:
        """Return the pictures of both slots of the last view; None while one of them is incomplete."""
        targets, view = self._targets, self._view
        if targets is None or view is None:
            return None
        a, b = (targets.shown.get(slot) for slot in (view.slot_a, view.slot_b))
        if a is None or b is None or not (a.output.is_complete and b.output.is_complete):
            return None
        return DrawnPair(targets.pair_key(view), a.target, b.target, targets.visibility)

    def pair_key(self) -> PairKey | None:
        """Return the key that `drawn_pair` has once both slots are complete; None before the first picture."""
        return None if self._targets is None or self._view is None else self._targets.pair_key(self._view)

    @checks_context
    def picture(self, slot: Slot) -> NDArray[np.float32]:
        """Return the picture of `slot` in the last view, drawn now if necessary: [H, W, 3] float32 linear, row 0 on top."""
        targets, view = self._drawn
        slot = self.paths.chosen(slot, view)
        with self._scheduler.drawing(whole=True):
            self._draw_visibility(view, targets)
            picture = self._blend.show(slot, targets)
        self._forget_frame(targets)
        return picture.target.read()

    def decoded_planes(self, slot: Slot) -> tuple[Plane, ...]:
        """Return the planes of the last view that are decoded from the slot's pack; none before the first view."""
        targets, view = self._targets, self._view
        if targets is None or view is None:
            return ()
        keys = self._slots.keys(self.paths.chosen(slot, view), targets)
        return tuple(plane for plane, key in keys.items() if key.slot.source != REFERENCE)

    @checks_context
    def planes(self, slot: Slot) -> dict[Plane, NDArray[np.float32]]:
        """Return the planes of `slot` in the last view: [H, W, 4] float32 each, row 0 on top (docs/explanation/lighting.md)."""
        self.picture(slot)
        targets, view = self._drawn
        keys = self._slots.keys(self.paths.chosen(slot, view), targets)
        return {plane: targets.planes[key].read_all() for plane, key in keys.items()}

    @checks_context
    def picture_in(self, slot: Slot, pixels: tuple[int, int, int, int]) -> NDArray[np.float32] | None:
        """Return the pixels of `picture_part`: [h, w, 3] float32 linear."""
        part = self.picture_part(slot, pixels)
        return None if part is None else np.ascontiguousarray(part.read()[..., :3], np.float32)

    def picture_part(self, slot: Slot, pixels: tuple[int, int, int, int]) -> PicturePart | None:
        """Return a rectangle of the picture of `slot` in the last view, with alpha; None if it has not been drawn.

        `pixels`: left, top, right, bottom from the upper left corner.
        """
        targets, view = self._targets, self._view
        if targets is None or view is None:
            return None
        slot = self.paths.chosen(slot, view)
        picture = targets.shown.get(slot)
        if picture is None or picture.source_version != self._slots.source_version(slot):
            return None
        return picture.target.part(pixels)

    @checks_context
    def texture_ids_from(self, camera: Camera, size: tuple[int, int]) -> NDArray[np.int32]:
        """Return the texture ids that `camera` sees at `size`: [H, W] int32, row 0 on top. The last view does not change."""
        content = surface_content(ViewState(camera=camera, size=size), self._scene_buffers)
        return self._drawer.texture_ids(camera, size, content)

    @property
    def visibility(self) -> VisibilityTarget:
        """The visibility buffer of the last view."""
        if self._targets is None:
            raise RuntimeError("render a view first")
        return self._targets.visibility

    @checks_context
    def texture_ids(self) -> NDArray[np.int32]:
        """Return the texture id of each pixel of the last view: [H, W] int32, row 0 on top, -1 for none."""
        return self.visibility.texture_ids()

    @checks_context
    def covered(self) -> NDArray[np.bool_]:
        """Return where a surface is visible: [H, W] bool, row 0 on top."""
        return self.visibility.materials() >= 0

    def release(self) -> None:
        """Free everything on the GPU."""
        self._release_targets()
        if self._picture is not None:
            self._picture.release()
            self._picture = None
        for part in (self._packs, self._compositor, self.images, self.light, self._slots):
            part.release()
        self._drawer.release()
        self._scene_buffers.release()
        self._programs.release()
