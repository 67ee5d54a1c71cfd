"""The frame: which passes run, in which order, and which of them may be skipped because nothing they read has changed."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ntc.metrics.divergence import DivergenceStatistics
from ntc.pack.match import PackMatch
from ntc.pack.model import Pack
from viewer.gl.context import GraphicsContext
from viewer.gl.context_loss import checks_context
from viewer.gl.program import ProgramFactory, ShaderLibrary
from viewer.gl.timer import PassTimer
from viewer.locations import shaders_folder
from viewer.render.divergence_overlay import DivergenceOverlay
from viewer.render.error_overlay import ErrorOverlay
from viewer.render.frame_result import DrawnPair, FrameResult
from viewer.render.gpu_pack import RenderContext, VisibilityInputs
from viewer.render.gpu_packs import GpuPacks, naming_memory_errors
from viewer.render.passes.composite import CompositeParams, CompositePass, CompositeTarget, DifferenceParams
from viewer.render.passes.reference import ReferencePass
from viewer.render.passes.visibility import VisibilityPass
from viewer.render.path_choice import PathTimes, time_paths
from viewer.render.picture_targets import DrawnAlbedo, PictureTargets
from viewer.render.resources.albedo_target import AlbedoTarget
from viewer.render.resources.culling import Culling, DrawList
from viewer.render.resources.divergence_maps import Stage
from viewer.render.resources.latent_store import LatentBudget
from viewer.render.resources.layout import scene_layout_glsl
from viewer.render.resources.scene_buffers import SceneBuffers, material_records
from viewer.render.resources.visibility_buffer import SurfaceContent, VisibilityTarget
from viewer.render.tile_cache.budget import TileBudget, TileCacheConfig, TileCounts
from viewer.scene.model import Camera, Scene
from viewer.state.camera import view_projection
from viewer.state.compare_layout import layout_of, shown_slots
from viewer.state.view_state import (
    REFERENCE,
    CompareMode,
    Difference,
    DifferenceKind,
    Overlay,
    Precision,
    Slot,
    ViewState,
)

COMPARISONS: tuple[tuple[CompareMode, DifferenceKind], ...] = (
    ("a", "raw"),
    ("b", "raw"),
    ("wipe", "raw"),
    ("difference", "raw"),
    ("difference", "relative"),
    ("difference", "flip"),
)
"""One way to compare for each program that the composite has."""


PREPARED_SIZE = (16, 16)
"""Pixels that `Renderer.prepare` draws."""


class Renderer:
    """Draws views of one scene with any number of packs. All calls belong to the thread of its OpenGL context."""

    def __init__(
        self,
        context: GraphicsContext,
        scene: Scene,
        divergence_stage: Stage = "compute",
        tile_cache: TileCacheConfig | None = None,
        latents: LatentBudget | None = None,
        emulate_half: bool = False,
    ) -> None:
        self._context, self._scene = context, scene
        self.reset = context.reset
        library = ShaderLibrary(shaders_folder(), {"generated/layout.glsl": scene_layout_glsl()})
        self._programs = ProgramFactory(context.gl, library)
        self._culling = Culling(scene)
        materials = material_records(scene)
        self._reference = ReferencePass(context, self._programs, scene, materials)
        with context.memory.transaction():
            self._scene_buffers = SceneBuffers(context, scene, materials)
            self._composite = CompositePass(context, self._programs)
        self._visibility = VisibilityPass(context, self._programs, self._scene_buffers)
        self._timer = PassTimer(context)
        tile_cache = tile_cache or TileCacheConfig()
        self.tile_budget = TileBudget(tile_cache)
        """To be told how long frames take, by who knows."""
        drawing = RenderContext(
            context,
            scene,
            self._scene_buffers,
            self._timer,
            tile_cache,
            self.tile_budget,
            latents or LatentBudget(),
            emulate_half,
        )
        self._divergence = DivergenceOverlay(context, self._programs, self._timer, divergence_stage)
        self._errors = ErrorOverlay(context, len(scene.textures))
        self._packs = GpuPacks(drawing, self._programs, scene)
        self._draws = 0
        self._prepared: set[Slot] = set()
        self._path_times: dict[tuple[str, Precision], PathTimes] = {}
        self._targets: PictureTargets | None = None
        self._left: CompositeTarget | None = None
        """The picture before, while one of another size is drawn."""
        self._depth = 0
        """Of calls of `render` in one another: measuring paths draws small pictures."""
        self._draw_list: DrawList | None = None
        self._matrix = np.eye(4)
        self._view: ViewState | None = None

    @property
    def name(self) -> str:
        """The driver's name of what draws."""
        return self._context.info.renderer

    @property
    def scene(self) -> Scene:
        """What is drawn."""
        return self._scene

    @property
    def matches(self) -> Mapping[str, PackMatch]:
        """How each open pack fits the scene, by the pack's name."""
        return self._packs.matches

    def set_packs(self, packs: Mapping[str, Pack]) -> None:
        """The packs that slots may name. Those that are gone or replaced are freed."""
        self._packs.set_packs(packs)
        self._prepared = {slot for slot in self._prepared if slot.source in packs}

    def gpu_bytes(self, slot: Slot) -> int | None:
        """Bytes of the slot's latents, decoders and tables on the GPU; None for the reference and before its first frame."""
        on_gpu = self._packs.uploaded(slot)
        return on_gpu.bytes_on_gpu if on_gpu is not None else None

    def gpu_parts(self, slot: Slot) -> Mapping[str, int] | None:
        """`gpu_bytes`, by what it is for."""
        on_gpu = self._packs.uploaded(slot)
        return on_gpu.bytes_by_part if on_gpu is not None else None

    def latent_bytes(self, slot: Slot) -> NDArray[np.int64] | None:
        """[textures of the scene] int64: latents of each on the GPU; None for the reference and before its first frame."""
        on_gpu = self._packs.uploaded(slot)
        return on_gpu.latent_bytes if on_gpu is not None and on_gpu.is_made else None

    def decoders(self, source: str) -> tuple[int, ...]:
        """Decoder of every texture of the scene under the grouping of `source`; -1 where nothing is decoded."""
        return self._packs.counted(source).decoders

    @checks_context
    def render(self, view: ViewState, whole: bool = False) -> FrameResult:
        """Draw `view`; passes whose inputs are as before are skipped and counted.

        With `whole` path `cached` decodes all that is missing, whatever time the renderer's TileCacheConfig gives it.
        Raises GpuMemoryError where something does not fit: then no view is drawn, the last frame's image stays as it is, and what
        was made for nothing has been freed.
        """
        self._depth += 1
        try:
            frame = self._render(view, whole)
        except BaseException:
            self._view = None
            if self._depth == 1:
                self._undo()
            raise
        finally:
            self._depth -= 1
        if self._depth == 0 and self._left is not None:
            self._left.release()
            self._left = None
        return frame

    def _undo(self) -> None:
        """After a frame that could not be drawn: what it has drawn so far counts for nothing."""
        self._timer.take()
        targets = self._targets
        if targets is None:
            return
        if self._left is None:
            targets.visibility_key = None
            return
        # It was to have another size. The next frame begins anew, with all the memory that this one has taken.
        targets.release()
        self._targets = None

    def _render(self, view: ViewState, whole: bool) -> FrameResult:
        skipped: dict[str, int] = defaultdict(int)
        asked = (view.slot_a, view.slot_b)
        view = replace(view, slot_a=self._chosen(view.slot_a, view), slot_b=self._chosen(view.slot_b, view))
        self._view = view
        targets = self._targets_for(view)
        draw_list = self._update_visibility(view, targets, skipped)
        slots = shown_slots(view)
        for slot in dict.fromkeys(slots):
            self._update_albedo(view, slot, targets, draw_list, skipped, whole)
        self._forget_unused(view, targets)
        divergence = self._update_divergence(view, slots, targets, skipped)
        self._update_composite(view, targets, skipped)
        timings = self._timer.take()
        skipped["images_not_uploaded"] = self._reference.images_not_uploaded
        skipped["clusters_culled"] = draw_list.culled_clusters
        skipped["triangles_culled"] = draw_list.culled_triangles
        tiles = {slot: counts for slot in slots if (counts := self._tiles(slot)) is not None}
        short_latents = False
        for slot in dict.fromkeys(slot for slot in slots if slot.source != REFERENCE):
            latents = self._packs.on_gpu(slot).latents
            coarse = slot in tiles and tiles[slot].coarse_latents
            short_latents |= latents.out_of_memory and (coarse or latents.levels_without_room > 0)
            skipped["latent_bytes_not_uploaded"] += latents.bytes_left_out
            skipped["latent_textures_not_uploaded"] += latents.textures_left_out
        skipped["tiles_kept"] = sum(counts.kept for counts in tiles.values())
        slot_ms = dict(targets.slot_ms)
        for slot, chosen in zip(asked, (view.slot_a, view.slot_b), strict=True):
            if chosen in slot_ms:
                slot_ms[slot] = slot_ms[chosen]
        drawn = {"triangles": draw_list.drawn_triangles, "commands": len(draw_list.commands)}
        return FrameResult(
            targets.composite.texture,
            timings,
            slot_ms,
            self._timer.kind,
            dict(skipped),
            divergence,
            drawn,
            tiles,
            {slot: chosen.path for slot, chosen in zip(asked, (view.slot_a, view.slot_b), strict=True)},
            short_latents,
        )

    def path_times(self, slot: Slot) -> PathTimes | None:
        """What `auto` found for this pack and precision; None before a view with that path has been drawn."""
        return self._path_times.get((slot.source, slot.precision))

    def _chosen(self, slot: Slot, view: ViewState) -> Slot:
        """`slot` with a path in place of `auto`, and without fields that are of no effect: equal pictures have equal slots."""
        if slot.source == REFERENCE:
            return Slot(REFERENCE)
        if slot.path != "auto":
            return slot
        key = (slot.source, slot.precision)
        if key not in self._path_times:

            def slot_ms(small: ViewState) -> float:
                return self.render(small, whole=True).slot_ms[small.slot_a]

            times = time_paths(slot_ms, replace(view, overlay=Overlay()), slot)
            if not times.milliseconds:
                # None can be drawn: one of them says why.
                return replace(slot, path="deferred")
            self._path_times[key] = times
        return replace(slot, path=self._path_times[key].fastest)

    def _tiles(self, slot: Slot) -> TileCounts | None:
        on_gpu = self._packs.uploaded(slot)
        return on_gpu.tiles if on_gpu is not None and slot.path == "cached" else None

    def _targets_for(self, view: ViewState) -> PictureTargets:
        filters = any(slot.source == REFERENCE or slot.path == "cached" for slot in (view.slot_a, view.slot_b))
        content = SurfaceContent(self._scene_buffers.has_colors, gradients=view.anisotropy > 1 and filters)
        targets = self._targets
        if targets is None or (targets.visibility.size, targets.visibility.content) != (view.size, content):
            self._leave_targets()
            with self._context.memory.transaction():
                visibility = VisibilityTarget(self._context, view.size, content)
                targets = self._targets = PictureTargets(visibility, CompositeTarget(self._context, view.size))
        return targets

    def _leave_targets(self) -> None:
        """Free what has the size of the last picture, but not that picture: it stays until there is another."""
        targets, self._targets = self._targets, None
        if targets is None:
            return
        if self._left is None and self._depth > 0:
            self._left = targets.composite
            targets.release_all_but_picture()
        else:
            targets.release()

    def _update_visibility(self, view: ViewState, targets: PictureTargets, skipped: dict[str, int]) -> DrawList:
        key = view.camera
        if self._draw_list is not None and targets.visibility_key == key:
            skipped["passes"] += 1
            return self._draw_list
        # Until all of it is drawn nothing is.
        targets.visibility_key = None
        with self._timer.measure_cpu("cull"):
            self._matrix = view_projection(view.camera, view.size, self._scene.bounds)
            draw_list = self._draw_list = self._culling.draw_list(view.camera, self._matrix)
            self._scene_buffers.upload(draw_list)
        with self._timer.measure("visibility"):
            self._visibility.run(targets.visibility, self._matrix)
        targets.visibility_key = key
        return draw_list

    def prepare(self, slot: Slot) -> bool:
        """Compile what `slot` needs, by drawing a few pixels of the last view with it; False if that was done before.

        Drivers compile shaders when they are first used. Done while nothing else is to do, a first toggle costs what any other does.
        """
        if self._targets is None or self._draw_list is None or slot.source == REFERENCE or slot.path == "auto":
            return False
        if slot in self._prepared or slot.source not in self._packs:
            return False
        self._prepared.add(slot)
        with self._context.memory.transaction():
            visibility = VisibilityTarget(self._context, PREPARED_SIZE, self._targets.visibility.content)
            target = AlbedoTarget(self._context, PREPARED_SIZE)
        try:
            self._visibility.run(visibility, self._matrix)
            seen = VisibilityInputs(visibility, self._draw_list, self._matrix, 1, ("prepared", slot))
            self._packs.on_gpu(slot).decode(slot.path, seen, target, whole=False)
        finally:
            self._timer.take()
            visibility.release()
            target.release()
        return True

    def _update_albedo(
        self,
        view: ViewState,
        slot: Slot,
        targets: PictureTargets,
        draw_list: DrawList,
        skipped: dict[str, int],
        whole: bool,
    ) -> None:
        if self._is_drawn(view, slot, targets):
            skipped["passes"] += 1
            return
        is_reference = slot.source == REFERENCE
        anisotropy = view.anisotropy if is_reference or slot.path == "cached" else 1
        on_gpu = None if is_reference else self._packs.on_gpu(slot)
        seen_key = (view.camera, anisotropy)
        drawn = targets.drawn.get(slot)
        still = drawn is not None and drawn.seen == seen_key and not whole
        if on_gpu is not None and still and on_gpu.decode_ahead(slot.path):
            skipped["passes"] += 1
            return
        if slot not in targets.albedo:
            targets.albedo[slot] = AlbedoTarget(self._context, view.size, half=is_reference)
        target = targets.albedo[slot]
        # While it is drawn anew it is nothing.
        targets.drawn.pop(slot, None)
        if on_gpu is None:
            visible = np.nonzero(draw_list.materials)[0].tolist()
            with self._timer.measure("upload"), naming_memory_errors("the reference"):
                self._reference.upload(visible)
            with self._timer.measure("reference"), naming_memory_errors("the reference"):
                self._reference.run(targets.visibility, self._scene_buffers, target, visible, anisotropy)
            targets.slot_ms[slot] = self._timer.last_ms
        else:
            seen = VisibilityInputs(
                targets.visibility, draw_list, self._matrix, anisotropy, (view.camera, view.size, anisotropy)
            )
            # A composite of the picture before is shown until all rows are drawn.
            with naming_memory_errors(f"pack {slot.source}"):
                spent = on_gpu.decode(slot.path, seen, target, whole, in_bands=still)
            self._prepared.add(slot)
            if on_gpu.is_half_drawn:
                if drawn is not None:
                    targets.drawn[slot] = drawn
                return
            targets.slot_ms[slot] = spent
        self._draws += 1
        targets.drawn[slot] = DrawnAlbedo(self._albedo_key(view, slot), seen_key, self._draws)

    def _albedo_key(self, view: ViewState, slot: Slot) -> object:
        """Albedos of equal keys are equal, unless tiles of them are still to come."""
        version = 0 if slot.source == REFERENCE else self._packs.version(slot.source)
        anisotropy = view.anisotropy if slot.source == REFERENCE or slot.path == "cached" else 1
        return view.camera, version, anisotropy

    def _is_drawn(self, view: ViewState, slot: Slot, targets: PictureTargets) -> bool:
        """Whether the slot's albedo is what the view asks for."""
        drawn = targets.drawn.get(slot)
        if drawn is None or drawn.key != self._albedo_key(view, slot):
            return False
        return slot.source == REFERENCE or not self._packs.on_gpu(slot).is_waiting(slot.path)

    def _forget_unused(self, view: ViewState, targets: PictureTargets) -> None:
        """Keep the pictures of slots A and B and of the reference; free those of slots that nobody looks at."""
        for slot in [s for s in targets.albedo if s not in (view.slot_a, view.slot_b) and s.source != REFERENCE]:
            targets.albedo.pop(slot).release()
            targets.drawn.pop(slot, None)
            targets.slot_ms.pop(slot, None)

    def _update_divergence(
        self, view: ViewState, slots: tuple[Slot, ...], targets: PictureTargets, skipped: dict[str, int]
    ) -> dict[str, DivergenceStatistics]:
        """Count the decoders per block of what is shown, where the overlay asks for it."""
        if view.overlay.kind != "divergence":
            skipped["divergence_passes"] += 1
            return {}
        groupings = {slot.source: self._packs.counted(slot.source) for slot in slots}
        if not self._divergence.update(targets.visibility, view.camera, groupings, view.overlay.block):
            skipped["passes"] += 1
        statistics = self._divergence.statistics
        return {source: statistics[source] for source in groupings if source != REFERENCE}

    def _look(self, view: ViewState, targets: PictureTargets) -> CompositeParams:
        """How the albedos of the shown slots come together."""
        overlay = None
        if view.overlay.kind == "divergence":
            overlay = self._divergence.overlay(view.overlay, *(slot.source for slot in shown_slots(view)))
        difference = None
        if view.compare == "difference":
            difference = DifferenceParams(view.difference, self._errors.flip_map(self._pair_key(view, targets)))
        marks = self._errors.marks(view.overlay, view.highlight, targets.visibility)
        return CompositeParams(layout_of(view), difference, overlay, marks, view.zoom)

    def _pair_key(self, view: ViewState, targets: PictureTargets) -> object:
        """Stands for what A and B are at each pixel."""
        return tuple((slot, targets.drawn.get(slot)) for slot in (view.slot_a, view.slot_b))

    def _update_composite(self, view: ViewState, targets: PictureTargets, skipped: dict[str, int]) -> None:
        first, second = shown_slots(view)
        key = (
            first,
            second,
            layout_of(view),
            targets.drawn.get(first),
            targets.drawn.get(second),
            (view.overlay, self._divergence.key) if view.overlay.kind == "divergence" else None,
            (view.difference, self._errors.flip_map(self._pair_key(view, targets)))
            if view.compare == "difference"
            else None,
            self._errors.marks_key(view.overlay, view.highlight),
            view.zoom,
        )
        if targets.composite_key == key:
            skipped["passes"] += 1
            return
        look = self._look(view, targets)
        with self._timer.measure("composite"):
            self._composite.run(targets.albedo[first], targets.albedo[second], look, targets.composite)
        targets.composite_key = key

    def prepare_slots(self) -> bool:
        """Draw a slot of the last view that is not shown, so that it can be shown at once; whether there was one to draw."""
        targets, view, draw_list = self._targets, self._view, self._draw_list
        if targets is None or view is None or draw_list is None:
            return False
        for slot in (view.slot_a, view.slot_b):
            if not self._is_drawn(view, slot, targets):
                self._update_albedo(view, slot, targets, draw_list, defaultdict(int), whole=False)
                self._timer.take()
                return True
        return False

    def prepare_comparison(self) -> bool:
        """Compile a program that another way to compare the last view would need; whether there was one.

        Both slots must have been drawn. A driver may put off its work to the first drawing: so a few pixels are drawn.
        """
        targets, view = self._targets, self._view
        if targets is None or view is None or not all(slot in targets.albedo for slot in (view.slot_a, view.slot_b)):
            return False
        for compare, kind in COMPARISONS:
            other = replace(view, compare=compare, difference=Difference(kind))
            look = self._look(replace(other, overlay=Overlay()), targets)
            if view.overlay.kind == "divergence":
                look = replace(look, overlay=self._divergence.overlay(view.overlay, *self._counted_sources(view)))
            first, second = (targets.albedo[slot] for slot in shown_slots(other))
            if self._composite.prepare(first, second, look):
                return True
        return False

    def _counted_sources(self, view: ViewState) -> tuple[str, str]:
        first, second = shown_slots(view)
        return first.source, second.source

    def drawn_pair(self) -> DrawnPair | None:
        """Both slots of the last view as they are on the GPU; None while one is not drawn whole."""
        targets, view = self._targets, self._view
        if targets is None or view is None:
            return None
        if not all(self._is_drawn(view, slot, targets) for slot in (view.slot_a, view.slot_b)):
            return None
        a, b = (targets.albedo[slot] for slot in (view.slot_a, view.slot_b))
        return DrawnPair(self._pair_key(view, targets), a, b, targets.visibility)

    def pair_key(self) -> object:
        """That `drawn_pair` would have; None before the first picture."""
        return None if self._targets is None or self._view is None else self._pair_key(self._view, self._targets)

    @property
    def errors(self) -> ErrorOverlay:
        """What a comparison of A and B has found, for overlays and the FLIP map."""
        return self._errors

    @checks_context
    def albedo(self, slot: Slot) -> NDArray[np.float32]:
        """[H, W, 3] float32 linear, row 0 on top: what `slot` shows of the last view; drawn now if it was not."""
        if self._targets is None or self._view is None or self._draw_list is None:
            raise RuntimeError("render a view first")
        slot = self._chosen(slot, self._view)
        self._update_albedo(self._view, slot, self._targets, self._draw_list, defaultdict(int), whole=True)
        self._timer.take()
        return self._targets.albedo[slot].read()

    @checks_context
    def albedo_in(self, slot: Slot, pixels: tuple[int, int, int, int]) -> NDArray[np.float32] | None:
        """[h, w, 3] float32 linear: a part of what `slot` shows of the last view; None if that has not been drawn.

        `pixels` are left, top, right, bottom from the upper left corner. Nothing but the part is read back.
        """
        targets, view = self._targets, self._view
        if targets is None or view is None:
            return None
        slot = self._chosen(slot, view)
        if slot not in targets.drawn or targets.drawn[slot].key != self._albedo_key(view, slot):
            return None
        return targets.albedo[slot].read_in(*pixels)

    @checks_context
    def texture_ids_from(self, camera: Camera, size: tuple[int, int]) -> NDArray[np.int32]:
        """[H, W] int32, row 0 on top: texture ids that `camera` sees at `size`; draws the visibility buffer and nothing else."""
        view = ViewState(camera=camera, size=size)
        self._view = None
        self._update_visibility(view, self._targets_for(view), defaultdict(int))
        self._view = view
        self._timer.take()
        return self.texture_ids()

    @property
    def visibility(self) -> VisibilityTarget:
        """The visibility buffer of the last view."""
        if self._targets is None:
            raise RuntimeError("render a view first")
        return self._targets.visibility

    @checks_context
    def texture_ids(self) -> NDArray[np.int32]:
        """[H, W] int32, row 0 on top: texture id of each pixel of the last view, -1 for none."""
        return self.visibility.texture_ids()

    @checks_context
    def texture_ids_in(self, pixels: tuple[int, int, int, int]) -> NDArray[np.int32]:
        """[h, w] int32: texture ids of a part of the last view (left, top, right, bottom), -1 for none.

        Pixels count from the upper left corner. Nothing but the part is read back.
        """
        return self.visibility.texture_ids_in(*pixels)

    @checks_context
    def covered(self) -> NDArray[np.bool_]:
        """[H, W], row 0 on top: whether a surface is seen."""
        return self.visibility.materials() >= 0

    def release(self) -> None:
        """Free everything on the GPU."""
        if self._targets is not None:
            self._targets.release()
            self._targets = None
        if self._left is not None:
            self._left.release()
            self._left = None
        self._packs.release()
        self._composite.release()
        self._divergence.release()
        self._errors.release()
        self._reference.release()
        self._scene_buffers.release()
        self._programs.release()
