"""The picture of a session: drawn when it is out of date, coarser while it moves, and kept where the GPU has no memory for more."""

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
"""Longest time of a whole frame in ms before a moving picture becomes coarse."""
COARSENESS = 4
"""Side of a pixel of a coarse picture, in pixels of a picture at rest."""
COARSENESS_OF_MAPS = 2
"""Side of such a pixel under a map of decoders, in pixels: 4 of the 64 pixels of a block would say little of its decoders."""
TILE_MILLISECONDS = 25.0
"""Time in ms that a frame may decode tiles that have come into sight."""
LEAST_TILES = 3
"""Fewest tiles that a frame decodes: on a machine that a training keeps busy a tile takes some milliseconds."""
MOVING_SECONDS = 0.3
"""Time in seconds that a camera must rest before it counts as at rest."""


class Viewport:
    """Renderer of the session's scene, with what it has drawn. Sizes are (width, height) of the picture in pixels."""

    def __init__(
        self, context: GraphicsContext, session: Session, times: FrameTimes, background: Background, emit: EmitEvent
    ) -> None:
        """`times` and `background` are cleared when another scene is drawn. `emit` reports what cannot be drawn."""
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
        """View that `last` shows; None where that is out of date."""
        self._camera: Camera | None = None
        self._pose: Pose | None = None
        self._moved_at = -math.inf
        self._problems: frozenset[str] = frozenset()
        self._is_drawn = False
        """True once the renderer has drawn something."""
        self._undrawable: tuple[Scene, Mapping[str, Pack], ViewState] | None = None
        """Scene, packs and view that the GPU had no memory for last: not tried again before something changes."""
        self._drawable: tuple[Scene, Mapping[str, Pack], ViewState] | None = None
        """Scene, packs and view that were drawn last."""
        self._made: tuple[object, ViewState] | None = None
        """What `_view` was made from last, and its result."""
        self._whole = False
        """True where the last picture was asked for whole."""
        self.frames_drawn = 0
        """Number of frames in which the renderer had something to do."""

    @property
    def pending(self) -> tuple[Pending, ...]:
        """Parts of the last picture that are still to come."""
        return () if self.last is None else self.last.pending

    @property
    def is_open(self) -> bool:
        """True where the renderer has what is open in the session."""
        session = self._session
        same = session.scene is self._scene and session.compressed is self._compressed
        return self.renderer is not None and same and session.packs is self._packs

    def due(self, size: tuple[int, int]) -> tuple[str, ...]:
        """Return why the next picture differs from the last, in lines, as far as is known; empty where it does not."""
        if self.is_undrawable(size):
            return ()
        lines = [item.line for item in self.pending]
        if not lines and (not self.is_open or self._view(size) != self.last_view):
            lines = ["the picture has changed"]
        if self.is_coarse():
            lines.append("the picture is coarse while the camera moves")
        return tuple(lines)

    def is_coarse(self) -> bool:
        """Return whether the next picture has fewer pixels, because the camera moves and a whole one would take long."""
        if self._whole or not self._session.settings.coarse_while_moving:
            return False
        return self._times.whole_frame_ms > SLOW_FRAME_MS and time.monotonic() - self._moved_at < MOVING_SECONDS

    def is_undrawable(self, size: tuple[int, int]) -> bool:
        """Return whether the GPU had no memory for just this the last time."""
        if self._undrawable is None:
            return False
        scene, packs, view = self._undrawable
        return scene is self._session.scene and packs is self._session.packs and view == self._view(size)

    def draw(self, size: tuple[int, int], whole: bool = False) -> None:
        """Draw what is out of date; with `whole` at once, although the camera moves, and nothing is left for later frames.

        Raises InputError and ShaderError; a lack of GPU memory is notified."""
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
        # Nothing can be asked about a view that could not be drawn.
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
                # Transforms may overflow at a moment of an animation.
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
        """Draw the same view with what has been found about it."""
        if self.renderer is not None:
            self.last = self.renderer.render(view)
            self.frames_drawn += 1

    def alone(self, kind: PictureAlone, size: tuple[int, int]) -> NDArray[np.uint8]:
        """Return the picture without the interface: [H, W, 3] uint8 sRGB, row 0 on top. Raises InputError where there is none."""
        if self.renderer is None or not self.is_open:
            raise InputError("no picture to write yet: the scene has not been drawn")
        view = self._view(size).alone(kind)
        # The next frame draws what is shown again: both have one target.
        self.last_view = None
        return read_picture(self.renderer.render(view, whole=True).image)

    def note_failure(self, size: tuple[int, int]) -> bool:
        """Note that an error broke drawing off; return False where there is no older picture to stay with."""
        if self.renderer is None:
            if self.frames_drawn == 0:
                return False
            self._undrawable = self._session.scene, self._session.packs, self._view(size)
        self.last_view = None
        return True

    def prepare_next(self) -> bool:
        """Compile the next thing that the user may switch to, while nothing else is to be done; return False when all is ready."""
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
        """Return the renderer of the session's scene: a new one when the scene has changed, the old one when that cannot be drawn."""
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
            # A pack may have been read anew under its old name: an equal view then shows something else.
            self.renderer.set_packs(session.packs)
            self._packs = session.packs
            self.last_view = None
        if self._compressed is not session.compressed:
            self.renderer.images.set_compressed(session.compressed)
            self._compressed = session.compressed
        return self.renderer

    def _view(self, size: tuple[int, int]) -> ViewState:
        """Return the session's view with the pixels that are drawn; made where that has changed since the last call."""
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
        # A jump to a camera of the scene is no movement: it is drawn whole at once.
        known = self._camera in (None, camera) or camera in self._session.scene.cameras
        poses = self._session.playback.is_playing and self._pose != self._session.view.pose
        if (poses or not known) and self._scene is self._session.scene:
            self._moved_at = time.monotonic()
        self._camera, self._pose = camera, self._session.view.pose

    def _leave_half_arithmetic(self) -> None:
        """Keep the weights as halves, but compute in fp32: what every driver can."""
        for side, slot in self._session.view.slots.items():
            if slot.precision not in ("fp32", "fp16"):
                self._emit(ViewChanged(self._session.view.with_slot(side, replace(slot, precision="fp16"))))

    def _give_up(self, error: GpuMemoryError, view: ViewState) -> None:
        """Go back to what was drawn before, or show less: the GPU has no memory for what is to be drawn."""
        session = self._session
        self._emit(Notification(str(error), "error", details_of(error)))
        before = session.scene, session.packs, session.view
        if self._drawable is not None:
            self._emit(Reverted(*self._drawable))
        if (session.scene, session.packs, session.view) != before:
            if not self._is_drawn:
                # All that this scene has taken is needed for the one before.
                self.release()
            return
        alone = next((side for side, slot in session.view.slots.items() if slot.source != REFERENCE), None)
        if not self._is_drawn and alone is not None and session.view.compare not in ("a", "b"):
            self._emit(ViewChanged(replace(session.view, compare=alone)))
            self._emit(Notification(f"slot {alone.upper()} is shown alone: the GPU has no memory for both"))
            return
        # The last picture stays, at whatever size.
        self._undrawable = session.scene, session.packs, view

    def _notify_problems(self, frame: FrameResult, light_problem: str) -> None:
        """Notify, once, of what is shown coarser than it should be, and of another environment than the one that was asked for."""
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
