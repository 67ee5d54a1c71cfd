"""Picture of a session. It is redrawn when it is out of date, coarser during motion, and stays if GPU memory runs out."""

import math
import time
from collections.abc import Mapping
from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.metrics.block_compression import BlockFormat
from ntc.metrics.compressed_textures import CompressedTextures
from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ShaderError
from viewer.gl.ui_textures import Thumbnails
from viewer.jobs.job import Background
from viewer.render.frames import FrameResult, FrameTimes, read_picture
from viewer.render.pass_scheduler import Pending
from viewer.render.renderer import Renderer
from viewer.render.resources.tile_cache.budget import TileCacheConfig
from viewer.scene.model import Camera, Pose, Scene
from viewer.state.events import EmitEvent, Notification, Reverted, ViewChanged
from viewer.state.message_log import details_of
from viewer.state.session import Session
from viewer.state.view_state import EXACT_PATHS, REFERENCE, PictureAlone, ViewState

SLOW_FRAME_MS = 120.0
"""Time of a full-resolution frame in ms above which moving pictures are coarse."""
COARSENESS = 4
"""Side of a pixel of a coarse picture, in pixels of the picture at rest."""
COARSENESS_OF_MAPS = 2
"""Side of such a pixel with the divergence overlay. COARSENESS would count 4 of the 64 pixels of a block."""
TILE_MILLISECONDS = 25.0
"""Limit of the time that a frame spends on decoding tiles, in ms."""
LEAST_TILES = 3
"""Fewest tiles that a frame decodes. While a training runs, one tile may take several milliseconds."""
MOVING_SECONDS = 0.3
"""Time in seconds after a movement during which the picture counts as moving."""


class Viewport:
    """Renderer of the session's scene, and its last picture. Sizes are (width, height) of the picture in pixels."""

    def __init__(
        self, context: GraphicsContext, session: Session, times: FrameTimes, background: Background, emit: EmitEvent
    ) -> None:
        """`times` and `background` are cleared when another scene is drawn. `emit` receives events about problems."""
        self._context, self._session, self._emit = context, session, emit
        self._times, self._background = times, background
        self._scene: Scene | None = None
        self._packs: Mapping[str, Pack] | None = None
        self._compressed: Mapping[BlockFormat, CompressedTextures] | None = None
        self.renderer: Renderer | None = None
        self.thumbnails: Thumbnails | None = None
        """Thumbnails of the renderer's scene."""
        self.last: FrameResult | None = None
        self.last_view: ViewState | None = None
        """View that `last` shows; None if `last` is out of date."""
        self._camera: Camera | None = None
        self._pose: Pose | None = None
        self._moved_at = -math.inf
        self._problems: frozenset[str] = frozenset()
        self._is_drawn = False
        """True once the renderer has drawn something."""
        self._undrawable: tuple[Scene, Mapping[str, Pack], ViewState] | None = None
        """Scene, packs and view for which the GPU had no memory; they are not tried again."""
        self._drawable: tuple[Scene, Mapping[str, Pack], ViewState] | None = None
        """Scene, packs and view that were drawn last."""
        self._made: tuple[object, ViewState] | None = None
        """Arguments of the last `_view`, and its result."""
        self._whole = False
        """True if the last `draw` asked for a complete picture."""
        self.frames_drawn = 0
        """Number of frames in which the renderer had something to do."""

    @property
    def pending(self) -> tuple[Pending, ...]:
        """Parts that the last picture still lacks."""
        return () if self.last is None else self.last.pending

    @property
    def is_open(self) -> bool:
        """True if the renderer shows the scene, packs and formats that are open in the session."""
        session = self._session
        same = session.scene is self._scene and session.compressed is self._compressed
        return self.renderer is not None and same and session.packs is self._packs

    def due(self, size: tuple[int, int]) -> tuple[str, ...]:
        """Return the known reasons for another frame, one line each; empty if the picture is final."""
        if self.is_undrawable(size):
            return ()
        lines = [item.line for item in self.pending]
        if not lines and (not self.is_open or self._view(size) != self.last_view):
            lines = ["the picture has changed"]
        if self.is_coarse():
            lines.append("the picture is coarse while the camera moves")
        return tuple(lines)

    def is_coarse(self) -> bool:
        """Return whether the next picture has fewer pixels, because the camera moves and frames are slow."""
        if self._whole or not self._session.settings.coarse_while_moving:
            return False
        return self._times.whole_frame_ms > SLOW_FRAME_MS and time.monotonic() - self._moved_at < MOVING_SECONDS

    def is_undrawable(self, size: tuple[int, int]) -> bool:
        """Return whether the GPU had no memory for this same picture before."""
        if self._undrawable is None:
            return False
        scene, packs, view = self._undrawable
        return scene is self._session.scene and packs is self._session.packs and view == self._view(size)

    def draw(self, size: tuple[int, int], whole: bool = False) -> None:
        """Draw the picture if it is out of date. With `whole`, it is complete and at full resolution, even during motion.

        Raises InputError and ShaderError; too little GPU memory is notified instead."""
        self._whole = whole
        self._note_movement()
        if self.is_undrawable(size):
            return
        renderer = self._current_renderer()
        view = self._view(size)
        if view == self.last_view and not self.pending:
            if late := renderer.take_times():
                self._times.note_passes(late)
            return
        renderer.tile_budget.note_frame(self._times.last_ms)
        # Stays None if drawing fails, so nothing is read from the unfinished picture.
        self.last_view = None
        try:
            self.last = renderer.render(view, whole)
        except GpuMemoryError as error:
            self._give_up(error, view)
            return
        except InputError as error:
            self._context.reset.check_after(error)
            self._emit(Notification(str(error), "error"))
            if view.pose is not None:
                # The animation's transforms may overflow at this moment, so show the pose of the file.
                self._emit(ViewChanged(replace(self._session.view, pose=None)))
            self._leave_half_arithmetic()
            return
        renderer.images.keep_only([slot.source for slot in view.slots.values()])
        self.last_view, self._is_drawn, self._undrawable = view, True, None
        self._notify_problems(self.last, renderer.light.problem)
        self._drawable = (self._session.scene, self._session.packs, self._session.view)
        self.frames_drawn += 1
        if view.coarseness == 1:
            self._times.note(self.last)

    def compose_again(self, view: ViewState) -> None:
        """Draw the same view again with newer overlays, such as the FLIP map."""
        if self.renderer is not None:
            self.last = self.renderer.render(view)
            self.frames_drawn += 1

    def alone(self, kind: PictureAlone, size: tuple[int, int]) -> NDArray[np.uint8]:
        """Return the picture without the interface: [H, W, 3] uint8 sRGB, row 0 on top. Raises InputError if there is none yet."""
        if self.renderer is None or not self.is_open:
            raise InputError("no picture to write yet: the scene has not been drawn")
        view = self._view(size).alone(kind)
        # This picture overwrites the shown one, so the next frame draws that again.
        self.last_view = None
        return read_picture(self.renderer.render(view, whole=True).image)

    def note_failure(self, size: tuple[int, int]) -> bool:
        """Record that an error interrupted drawing; return False if there is no older picture to show."""
        if self.renderer is None:
            if self.frames_drawn == 0:
                return False
            self._undrawable = self._session.scene, self._session.packs, self._view(size)
        self.last_view = None
        return True

    def prepare_next(self) -> bool:
        """Compile one decode path that the user may switch to; return False when all are compiled. For idle time."""
        view, renderer = self._session.view, self.renderer
        if renderer is None or not self.is_open:
            return False
        for slot in dict.fromkeys((view.slot_a, view.slot_b)):
            for path in EXACT_PATHS:
                try:
                    if renderer.prepare(replace(slot, path=path)):
                        return True
                except (InputError, ShaderError, moderngl.Error, MemoryError):
                    # The error is shown when the user asks for this path.
                    continue
        return False

    def release(self) -> None:
        """Free everything on the GPU."""
        if self.thumbnails is not None:
            self.thumbnails.release()
        if self.renderer is not None:
            self.renderer.release()
        self.thumbnails = self.renderer = self._scene = self._packs = self._compressed = None
        self.last = self.last_view = None

    def _current_renderer(self) -> Renderer:
        """Return the renderer of the session's scene; the previous renderer if the new scene cannot be drawn."""
        session = self._session
        if self.renderer is None or self._scene is not session.scene:
            tiles = TileCacheConfig(session.settings.tile_cache_megabytes << 20, TILE_MILLISECONDS, LEAST_TILES)
            try:
                with self._context.memory.transaction():
                    textures = session.scene.textures
                    made = Renderer(self._context, session.scene, tile_cache=tiles, variant=session.decoder_variant)
                    thumbnails = Thumbnails(self._context, lambda texture_id: textures[texture_id].pixels)
            except InputError as error:
                self._context.reset.check_after(error)
                if self.renderer is None or self._drawable is None:
                    raise
                self._emit(Reverted(*self._drawable))
                self._emit(Notification(str(error), "error"))
                return self.renderer
            self.release()
            self.renderer, self.thumbnails, self._scene = made, thumbnails, session.scene
            self._is_drawn = False
            self._times.clear()
            self._background.forget()
        if self._packs is not session.packs:
            for name, pack in session.packs.items():
                if name in (self._packs or {}):
                    self.renderer.update_pack(name, pack)
            # A pack may have been reloaded under the same name, so an equal view may show a different picture.
            self.renderer.set_packs(session.packs)
            self._packs = session.packs
            self.last_view = None
        if self._compressed is not session.compressed:
            self.renderer.images.set_compressed(session.compressed)
            self._compressed = session.compressed
        return self.renderer

    def _view(self, size: tuple[int, int]) -> ViewState:
        """Return the session's view at the resolution to draw; the same object while nothing changes."""
        shown, coarseness = self._session.shown_view, 1
        if self.is_coarse():
            coarseness = COARSENESS_OF_MAPS if shown.overlay.kind == "divergence" else COARSENESS
        key = (shown, size, self._session.resolution, coarseness)
        if self._made is None or self._made[0] != key:
            share = self._session.resolution / coarseness
            scaled = (max(1, round(size[0] * share)), max(1, round(size[1] * share)))
            self._made = key, replace(shown, size=scaled, coarseness=coarseness)
        return self._made[1]

    def _note_movement(self) -> None:
        camera = self._session.view.camera
        # A jump to a camera of the scene is no movement, so it is drawn at full resolution.
        known = self._camera in (None, camera) or camera in self._session.scene.cameras
        poses = self._session.playback.is_playing and self._pose != self._session.view.pose
        if (poses or not known) and self._scene is self._session.scene:
            self._moved_at = time.monotonic()
        self._camera, self._pose = camera, self._session.view.pose

    def _leave_half_arithmetic(self) -> None:
        """Change slots with half arithmetic to `fp16`: weights in halves, arithmetic in fp32, which all drivers support."""
        for side, slot in self._session.view.slots.items():
            if slot.precision not in ("fp32", "fp16"):
                self._emit(ViewChanged(self._session.view.with_slot(side, replace(slot, precision="fp16"))))

    def _give_up(self, error: GpuMemoryError, view: ViewState) -> None:
        """Handle too little GPU memory: go back to the last drawable state, or show one slot alone."""
        session = self._session
        self._emit(Notification(str(error), "error", details_of(error)))
        before = session.scene, session.packs, session.view
        if self._drawable is not None:
            self._emit(Reverted(*self._drawable))
        if (session.scene, session.packs, session.view) != before:
            if not self._is_drawn:
                # The previous scene needs the memory of this one.
                self.release()
            return
        alone = next((side for side, slot in session.view.slots.items() if slot.source != REFERENCE), None)
        if not self._is_drawn and alone is not None and session.view.compare not in ("a", "b"):
            self._emit(ViewChanged(replace(session.view, compare=alone)))
            self._emit(Notification(f"slot {alone.upper()} is shown alone: the GPU has no memory for both"))
            return
        # The last picture stays, whatever its size.
        self._undrawable = session.scene, session.packs, view

    def _notify_problems(self, frame: FrameResult, light_problem: str) -> None:
        """Notify once of each problem: tiles or mips that are too coarse, and an environment that cannot be used."""
        problems = {light_problem} - {""}
        if any(counts.out_of_memory for counts in frame.tiles.values()):
            problems.add(
                "the GPU has no memory for more decoded tiles: path cached uses a smaller cache; "
                "close packs, or lower tile_cache_megabytes in settings.json"
            )
        if frame.short_latents:
            problems.add(f"coarser mips are shown: {frame.short_latents}")
        for line in sorted(problems - self._problems):
            self._emit(Notification(line, "error"))
        self._problems = frozenset(problems)
