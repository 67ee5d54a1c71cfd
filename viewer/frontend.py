"""Picture and user interface in one framebuffer: the same for the window and for tests without one."""

import math
import statistics
import time
from collections import defaultdict, deque
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.files import write_text
from ntc.pack import Pack
from viewer.block_content import BlockContent, BlockPlace, block_content
from viewer.commands import run_command
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ShaderError
from viewer.gl.thumbnails import Thumbnails
from viewer.measurement import SeenPicture, SlotMeasurement, measure_slot
from viewer.renderer import FrameResult, Renderer
from viewer.scene.cameras_file import cameras_json
from viewer.scene.images import write_png
from viewer.scene.model import Camera, Scene
from viewer.session import Session
from viewer.tile_cache import TileCacheConfig
from viewer.ui.facts import FrameFacts
from viewer.ui.user_interface import UserInterface
from viewer.view_state import BLOCKS, REFERENCE, Slot, ViewState

FRAMES_REMEMBERED = 15
"""Frames over which times are medians."""
BACKGROUND = (0.05, 0.055, 0.06, 1.0)
SETTLING_FRAMES = 3
"""Frames that ImGui needs after an event until its layout rests."""


SLOW_FRAME_MS = 120.0
"""A whole frame that takes longer makes a moving picture coarse."""
COARSE_SHARE = 0.25
TILE_MILLISECONDS = 25.0
"""Of a frame, for decoding tiles that have come into sight."""
RECORDING_SECONDS = 0.25
"""A recorded path has a camera so often."""
MOVING_SECONDS = 0.3
"""A camera moves until it has rested for so long."""


class Frontend:
    """Draws a session. All calls belong to the thread of the OpenGL context, with an ImGui context current."""

    def __init__(self, context: GraphicsContext, session: Session, pictures: Path) -> None:
        self._context, self.session = context, session
        self.pictures = pictures
        session.use_commands(run_command)
        self.interface = UserInterface()
        self._scene: Scene | None = None
        self._renderer: Renderer | None = None
        self._packs: Mapping[str, Pack] | None = None
        self._times: defaultdict[str, deque[float]] = defaultdict(lambda: deque(maxlen=FRAMES_REMEMBERED))
        self._last: FrameResult | None = None
        self._last_view: ViewState | None = None
        self._camera: Camera | None = None
        self._moved_at = -math.inf
        self._recorded_at = -math.inf
        self._thumbnails: Thumbnails | None = None
        self._block_key: object = None
        self._block_content: BlockContent | None = None
        self._whole_frame_ms = 0.0
        self._slot_ms: Mapping[Slot, float] = {}
        self.frames_drawn = 0
        """Frames in which the renderer had something to do."""

    def _tile_cache(self) -> TileCacheConfig:
        return TileCacheConfig(self.session.settings.tile_cache_megabytes << 20, TILE_MILLISECONDS)

    def _current_renderer(self) -> Renderer:
        """The renderer of the session's scene; made anew when the scene has changed, kept when that one cannot be drawn."""
        if self._renderer is None or self._scene is not self.session.scene:
            try:
                made = Renderer(self._context, self.session.scene, tile_cache=self._tile_cache())
            except InputError as error:
                if self._renderer is None or not self.session.put_away_undrawable():
                    raise
                self.session.say(str(error), "error")
                return self._renderer
            if self._renderer is not None:
                self._renderer.release()
            self._renderer, self._scene = made, self.session.scene
            self._packs = None
            self._block_key = None
            self._times.clear()
            if self._thumbnails is not None:
                self._thumbnails.release()
            textures = self._scene.textures
            self._thumbnails = Thumbnails(self._context, lambda texture_id: textures[texture_id].pixels)
        if self._packs is not self.session.packs:
            # A pack may have been read anew under its old name: an equal view then shows something else.
            self._renderer.set_packs(self.session.packs)
            self._packs = self.session.packs
            self._last_view = None
            self._block_key = None
        return self._renderer

    def _view(self, size: tuple[int, int]) -> ViewState:
        share = self.session.resolution * (COARSE_SHARE if self._is_coarse() else 1.0)
        scaled = (max(1, round(size[0] * share)), max(1, round(size[1] * share)))
        return replace(self.session.shown_view, size=scaled)

    def _is_coarse(self) -> bool:
        session = self.session
        if session.measure_requested or session.screenshot_requested or not session.settings.coarse_while_moving:
            return False
        return self._whole_frame_ms > SLOW_FRAME_MS and time.monotonic() - self._moved_at < MOVING_SECONDS

    def _note_movement(self) -> None:
        camera = self.session.view.camera
        # A jump to a camera of the scene is no movement: it is drawn whole at once.
        known = self._camera in (None, camera) or camera in self.session.scene.cameras
        if not known and self._scene is self.session.scene:
            self._moved_at = time.monotonic()
        self._camera = camera

    @property
    def _is_waiting(self) -> bool:
        """Whether tiles of the last picture are still to come."""
        return self._last is not None and self._last.waiting > 0

    def _draw_picture(self, size: tuple[int, int]) -> None:
        self._note_movement()
        renderer = self._current_renderer()
        coarse = self._is_coarse()
        view = self._view(size)
        whole = self.session.measure_requested or self.session.screenshot_requested
        if view == self._last_view and not self._is_waiting:
            return
        self._last = renderer.render(view, whole)
        self._last_view = view
        self.session.note_drawable()
        self.frames_drawn += 1
        if coarse:
            # Times of a coarse picture say nothing about the whole one.
            return
        self._slot_ms = self._last.slot_ms
        self._whole_frame_ms = sum(self._last.timings_ms.values())
        for name, milliseconds in self._last.timings_ms.items():
            self._times[name].append(milliseconds)

    def facts(self) -> FrameFacts:
        """What the panels show of the last frame."""
        last, renderer = self._last, self._renderer
        gpu_bytes: dict[Slot, int] = {}
        if renderer is not None:
            for slot in (self.session.view.slot_a, self.session.view.slot_b):
                size = renderer.gpu_bytes(slot)
                if size is not None:
                    gpu_bytes[slot] = size
        return FrameFacts(
            renderer=self._context.info.renderer,
            timer=last.timer if last else "",
            timings_ms={name: statistics.median(times) for name, times in self._times.items()},
            slot_ms=self._slot_ms,
            skipped=last.skipped if last else {},
            drawn=last.drawn if last else {},
            divergence=last.divergence if last else {},
            block=self._block(),
            thumbnail=self._thumbnail if self._thumbnails is not None else None,
            gpu_bytes=gpu_bytes,
            frames_drawn=self.frames_drawn,
            paths=last.paths if last else {},
            tiles=last.tiles if last else {},
        )

    def _thumbnail(self, texture_id: int) -> imgui.ImTextureRef:
        assert self._thumbnails is not None
        return imgui.ImTextureRef(self._thumbnails[texture_id].glo)

    def _block(self) -> BlockContent | None:
        """The block to speak of, read back when it or the picture has changed."""
        session, renderer, view = self.session, self._renderer, self._last_view
        at = session.inspected or session.hovered
        if renderer is None or view is None or view.overlay.kind == "none" or at is None:
            return None
        place = BlockPlace.at(at, BLOCKS[view.overlay.block], view.size)
        sources = [slot.source for slot in (view.slot_a, view.slot_b) if slot.source != REFERENCE]
        key = (view.camera, place, sources)
        if key != self._block_key:
            decoders = {source: renderer.decoders(source) for source in sources}
            ids = renderer.texture_ids_in(place.pixels)
            self._block_content = block_content(ids, place, renderer.scene, decoders)
            self._block_key = key
        return self._block_content

    def _measure(self) -> None:
        """Carry out a wish to measure both slots on the present view."""
        renderer, view = self._renderer, self._last_view
        if renderer is None or view is None:
            return
        reference = renderer.albedo(Slot(REFERENCE))
        covered, texture_ids = renderer.covered(), renderer.texture_ids()
        results: dict[str, SlotMeasurement] = {}
        for side, slot in (("a", view.slot_a), ("b", view.slot_b)):
            shown = reference if slot.source == REFERENCE else renderer.albedo(slot)
            picture = SeenPicture(shown, reference, covered, texture_ids)
            pack, match = self.session.packs.get(slot.source), renderer.matches.get(slot.source)
            results[side] = measure_slot(slot.source, picture, pack, match, renderer.gpu_bytes(slot))
        self.session.measurements = results
        self.session.measured_view = self.session.view

    def build(self, size: tuple[int, int]) -> imgui.ImDrawData:
        """Draw the picture at `size` (width, height) in pixels and build the UI over it, between new_frame and render."""
        session = self.session
        session.picture_size = size
        session.training.tick(session)
        try:
            self._draw_picture(size)
            if session.measure_requested:
                self._measure()
        except (InputError, ShaderError) as error:
            if self._renderer is None:
                # There is no older picture to stay with.
                raise
            session.say(" ".join(str(error).split()), "error")
        session.measure_requested = False
        now = time.monotonic()
        if now - self._recorded_at >= RECORDING_SECONDS:
            self._recorded_at = now
            session.record_camera()
        # After the picture: messages are seen from now on, however long it took.
        session.forget_old_toasts(time.monotonic())
        picture = imgui.ImTextureRef(self._last.image.glo) if self._last is not None else None
        self.interface.draw(session, self.facts(), picture, session.apply)
        imgui.render()
        return imgui.get_draw_data()

    def paint(self, framebuffer: moderngl.Framebuffer, draw_data: imgui.ImDrawData) -> None:
        """Put what `build` made onto a framebuffer."""
        framebuffer.use()
        framebuffer.clear(*BACKGROUND)
        imgui.backends.opengl3_render_draw_data(draw_data)
        # ImGui leaves its own state behind.
        self._context.gl.enable_only(moderngl.NOTHING)
        if self.session.screenshot_requested:
            self.session.screenshot_requested = False
            self._write_screenshot(read_pixels(framebuffer))
        if self.session.recorded_path is not None:
            self._write_path(self.session.recorded_path)
            self.session.recorded_path = None

    def _write_screenshot(self, pixels: NDArray[np.uint8]) -> None:
        path = self.pictures / f"{self.session.scene.name}-{time.strftime('%Y%m%d-%H%M%S')}.png"
        try:
            write_png(path, pixels)
            self.session.say(f"wrote {path}")
        except InputError as error:
            self.session.say(str(error), "error")

    def _write_path(self, cameras: tuple[Camera, ...]) -> None:
        path = self.pictures / f"{self.session.scene.name}-path-{time.strftime('%Y%m%d-%H%M%S')}.json"
        try:
            write_text(path, cameras_json(cameras))
            self.session.say(f"wrote {len(cameras)} cameras to {path}: encode --grouping covisible --views takes it")
        except InputError as error:
            self.session.say(str(error), "error")

    def needs_frame(self, size: tuple[int, int]) -> bool:
        """Whether the picture is out of date, a message is about to end, or a wish is open."""
        session = self.session
        waiting = session.measure_requested or session.screenshot_requested or session.recorded_path is not None
        ending = any(toast.until is not None and toast.until <= time.monotonic() for toast in session.toasts)
        opened = session.scene is not self._scene or session.packs is not self._packs
        waiting = waiting or session.training.is_due
        return waiting or ending or opened or self._is_waiting or self._view(size) != self._last_view

    @property
    def skipped(self) -> Mapping[str, int]:
        """What the last drawn frame left out."""
        return self._last.skipped if self._last is not None else {}

    def release(self) -> None:
        """Free everything on the GPU."""
        if self._thumbnails is not None:
            self._thumbnails.release()
            self._thumbnails = None
        if self._renderer is not None:
            self._renderer.release()
            self._renderer = None


def read_pixels(framebuffer: moderngl.Framebuffer) -> NDArray[np.uint8]:
    """[H, W, 3] uint8 of a framebuffer, row 0 on top."""
    width, height = framebuffer.size
    pixels = np.frombuffer(framebuffer.read(components=3, alignment=1), np.uint8)
    return np.ascontiguousarray(pixels.reshape(height, width, 3)[::-1])
