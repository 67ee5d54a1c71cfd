"""Picture and user interface in one framebuffer: the same for the window and for tests without one."""

import math
import statistics
import time
from collections import defaultdict, deque
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import get_args

import moderngl
import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.files import write_text
from ntc.pack import Pack
from viewer.actions import SetSlot
from viewer.block_content import BlockContent, BlockPlace, block_content
from viewer.commands import bindings, run_command
from viewer.explore.frame_history import FrameHistory
from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.named_images import NamedImages
from viewer.gl.program import ShaderError
from viewer.gl.thumbnails import Thumbnails
from viewer.live_comparison import LiveComparison
from viewer.measurement import SeenPicture, SlotMeasurement, measure_slot
from viewer.message_log import details_of
from viewer.passes.precision import supported_precisions
from viewer.picture_request import PictureRequest
from viewer.pixel_content import PixelContent
from viewer.pixel_reading import PixelReader
from viewer.precision_search import PrecisionSearch
from viewer.renderer import FrameResult, Renderer
from viewer.scene.cameras_file import cameras_json
from viewer.scene.images import write_png
from viewer.scene.model import Camera, Scene
from viewer.session import Session
from viewer.tile_cache import TileCacheConfig
from viewer.ui.clipboard import WindowClipboard
from viewer.ui.facts import FrameFacts
from viewer.ui.user_interface import UserInterface
from viewer.view_state import BLOCKS, REFERENCE, DecodePath, Slot, ViewState

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
LONGEST_STEP = 0.1
"""Seconds that a camera moves by itself in one frame: a slow one must not make it jump."""
COMPARISON_POLL_SECONDS = 0.05
"""A comparison that is under way is asked for its result so often."""
MOVING_SECONDS = 0.3
"""A camera moves until it has rested for so long."""


class Frontend:
    """Draws a session. All calls belong to the thread of the OpenGL context, with an ImGui context current."""

    def __init__(self, context: GraphicsContext, session: Session, pictures: Path) -> None:
        self._context, self.session = context, session
        self.pictures = pictures
        session.use_commands(run_command)
        session.pictures_folder = pictures
        session.clipboard = WindowClipboard()
        for problem in bindings(session.settings.keys).problems:
            session.say(problem, "error")
        self.interface = UserInterface()
        session.panel_titles = self.interface.panel_titles
        self._precision = PrecisionSearch(self.interface.background, supported_precisions(context))
        self._history = FrameHistory()
        self._images = NamedImages(context)
        self._started = 0.0
        self._timed: Mapping[str, float] | None = None
        """Times of the passes of the frame that is being drawn."""
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
        self._live = LiveComparison()
        self._pixels = PixelReader()
        self._told_of_memory: frozenset[str] = frozenset()
        self._is_drawn = False
        """Whether the renderer has drawn anything yet."""
        self._undrawable: tuple[Scene, Mapping[str, Pack], ViewState] | None = None
        """What the GPU had no memory for last: not tried again before something changes."""
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
                with self._context.memory.whole():
                    textures = self.session.scene.textures
                    thumbnails = Thumbnails(self._context, lambda texture_id: textures[texture_id].pixels)
                    made = Renderer(self._context, self.session.scene, tile_cache=self._tile_cache())
            except InputError as error:
                self._context.reset.check_after(error)
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
            self._history.clear()
            self.interface.background.forget()
            if self._thumbnails is not None:
                self._thumbnails.release()
            self._thumbnails = thumbnails
            self._last, self._is_drawn = None, False
        if self._packs is not self.session.packs:
            # A pack may have been read anew under its old name: an equal view then shows something else.
            self._renderer.set_packs(self.session.packs)
            self._packs = self.session.packs
            self._last_view = None
            self._block_key = None
        return self._renderer

    def _picture_size(self, window: tuple[int, int]) -> tuple[int, int] | None:
        """(width, height) in pixels of what panels leave of a window of so many; None before panels have found their places."""
        area, display = self.interface.picture_area, imgui.get_io().display_size
        return area.pixels((display.x, display.y), window) if area is not None else None

    def _view(self, size: tuple[int, int]) -> ViewState:
        share = self.session.resolution * (COARSE_SHARE if self._is_coarse() else 1.0)
        scaled = (max(1, round(size[0] * share)), max(1, round(size[1] * share)))
        return replace(self.session.shown_view, size=scaled)

    def _is_coarse(self) -> bool:
        session = self.session
        if session.measure_requested or session.picture_requests or not session.settings.coarse_while_moving:
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

    def _leave_half_arithmetic(self) -> None:
        """Keep the weights as halves, but compute in fp32: what every driver can."""
        for side, slot in (("a", self.session.view.slot_a), ("b", self.session.view.slot_b)):
            if slot.precision not in ("fp32", "fp16"):
                self.session.apply(SetSlot("a" if side == "a" else "b", replace(slot, precision="fp16")))

    def _update_flicker(self) -> None:
        session = self.session
        turns = time.monotonic() * 2.0 * session.settings.flicker_hz
        session.flicker_phase = session.flickers and int(turns) % 2 == 1

    @property
    def seconds_until_change(self) -> float:
        """Seconds until the picture changes by itself; infinite where it does not."""
        if self._live.is_computing:
            return COMPARISON_POLL_SECONDS
        if not self.session.flickers:
            return math.inf
        turns = time.monotonic() * 2.0 * self.session.settings.flicker_hz
        return (math.floor(turns) + 1.0 - turns) / (2.0 * self.session.settings.flicker_hz)

    def _figures_are_wanted(self) -> bool:
        """Whether anything shows what a comparison of A and B would find."""
        session, view = self.session, self.session.view
        in_picture = view.overlay.kind in ("error-texture", "error-decoder") or (
            view.compare == "difference" and view.difference.kind == "flip"
        )
        return session.show_panels or in_picture

    @property
    def _compares(self) -> bool:
        """Whether A is compared with B: not while a training changes the picture every second and needs the processors."""
        return self.session.settings.live_figures and self.session.training.state in ("idle", "paused")

    def _compare(self, size: tuple[int, int]) -> None:
        """Do what there is to do while the picture rests."""
        renderer, view, now = self._renderer, self._last_view, time.monotonic()
        if renderer is None or view is None:
            return
        self._live.note(renderer, view, self.session.packs, size, now)
        if not self._compares or self._is_waiting or self._is_coarse():
            return
        if self._live.step(view, self._figures_are_wanted(), now):
            self._last = renderer.render(view)
            self.frames_drawn += 1

    def _draw_picture(self, size: tuple[int, int]) -> None:
        self._note_movement()
        if self._is_undrawable(size):
            return
        renderer = self._current_renderer()
        coarse = self._is_coarse()
        view = self._view(size)
        whole = self.session.measure_requested or bool(self.session.picture_requests)
        if view == self._last_view and not self._is_waiting:
            return
        # Nothing can be asked about a view that could not be drawn.
        self._last_view = None
        try:
            self._last = renderer.render(view, whole)
        except GpuMemoryError as error:
            self._give_up(error, size)
            return
        except InputError as error:
            self._context.reset.check_after(error)
            self.session.say(str(error), "error")
            self._leave_half_arithmetic()
            return
        self._last_view, self._is_drawn, self._undrawable = view, True, None
        self._tell_of_memory(self._last)
        self.session.note_drawable()
        self.frames_drawn += 1
        if coarse:
            # Times of a coarse picture say nothing about the whole one.
            return
        self._timed = self._last.timings_ms
        self._slot_ms = self._last.slot_ms
        self._whole_frame_ms = sum(self._last.timings_ms.values())
        for name, milliseconds in self._last.timings_ms.items():
            self._times[name].append(milliseconds)

    def _wanted(self, size: tuple[int, int]) -> tuple[Scene, Mapping[str, Pack], ViewState]:
        """What is to be drawn."""
        return self.session.scene, self.session.packs, self._view(size)

    def _is_undrawable(self, size: tuple[int, int]) -> bool:
        """Whether the GPU had no memory for just this the last time."""
        if self._undrawable is None:
            return False
        scene, packs, view = self._undrawable
        return scene is self.session.scene and packs is self.session.packs and view == self._view(size)

    def _give_up(self, error: GpuMemoryError, size: tuple[int, int]) -> None:
        """The GPU has no memory for what is to be drawn: go back to what it has drawn before, or show less."""
        session = self.session
        session.say(str(error), "error", details_of(error))
        before = session.scene, session.packs, session.view
        session.put_away_undrawable()
        if (session.scene, session.packs, session.view) != before:
            if not self._is_drawn:
                # All that this scene has taken is needed for the one before.
                self._release_renderer()
            return
        sources = {"a": session.view.slot_a.source, "b": session.view.slot_b.source}
        alone = next((side for side, source in sources.items() if source != REFERENCE), None)
        if not self._is_drawn and alone is not None and session.view.compare not in ("a", "b"):
            session.view = replace(session.view, compare="a" if alone == "a" else "b")
            session.say(f"slot {alone.upper()} is shown alone")
            return
        # The last picture stays, at whatever size.
        self._undrawable = self._wanted(size)

    def _tell_of_memory(self, frame: FrameResult) -> None:
        """Say what is shown coarser than it should be, once."""
        short: set[str] = set()
        if any(counts.out_of_memory for counts in frame.tiles.values()):
            short.add(
                "the GPU has no memory for more decoded tiles: path cached goes on with those it has; "
                "close packs, or lower tile_cache_megabytes in settings.json"
            )
        if frame.short_latents:
            short.add("the GPU has no memory for all latents: coarser mips are shown in their place; close packs")
        for line in sorted(short - self._told_of_memory):
            self.session.say(line, "error")
        self._told_of_memory = frozenset(short)

    def _tell_of_spare_textures(self) -> None:
        spares = [self._images.spare, *([] if self._thumbnails is None else [self._thumbnails.spare])]
        for problem in (spare.take_problem() for spare in spares):
            if problem is not None:
                self.session.say(problem, "error")

    def _release_renderer(self) -> None:
        if self._thumbnails is not None:
            self._thumbnails.release()
        if self._renderer is not None:
            self._renderer.release()
        self._thumbnails = self._renderer = self._scene = self._packs = None
        self._last = self._last_view = None

    def facts(self) -> FrameFacts:
        """What the panels show of the last frame."""
        last, renderer = self._last, self._renderer
        slots = (self.session.view.slot_a, self.session.view.slot_b)
        parts = {slot: found for slot in slots if renderer and (found := renderer.gpu_parts(slot)) is not None}
        made = len(self._thumbnails) if self._thumbnails is not None else 0
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
            gpu_bytes={slot: sum(of_slot.values()) for slot, of_slot in parts.items()},
            frames_drawn=self.frames_drawn,
            live=self._live.figures,
            pixel=self._pixel(),
            paths=last.paths if last else {},
            tiles=last.tiles if last else {},
            history=self._history,
            gpu_parts=parts,
            latent_bytes=renderer.latent_bytes(slots[0]) if renderer is not None else None,
            matches=renderer.matches if renderer is not None else {},
            image=self._image,
            thumbnails_made=made,
            thumbnails_skipped=len(self.session.scene.textures) - made,
        )

    def _thumbnail(self, texture_id: int) -> imgui.ImTextureRef:
        assert self._thumbnails is not None
        return imgui.ImTextureRef(self._thumbnails[texture_id].glo)

    def _image(self, name: str, pixels: NDArray[np.uint8]) -> imgui.ImTextureRef:
        return imgui.ImTextureRef(self._images.get(name, pixels).glo)

    def _pixel(self) -> PixelContent | None:
        """The pixel to speak of, while its panel is open."""
        session, renderer, view = self.session, self._renderer, self._last_view
        at = session.kept_pixel or session.hovered
        if renderer is None or view is None or at is None or not (session.comparing.pixel and session.show_panels):
            return None
        return self._pixels.read(renderer, view, at)

    def _block(self) -> BlockContent | None:
        """The block to speak of, read back when it or the picture has changed."""
        session, renderer, view = self.session, self._renderer, self._last_view
        at = session.inspected or session.hovered
        if renderer is None or view is None or view.overlay.kind != "divergence" or at is None:
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
        """Draw the picture as large as panels leave room for it, and build the UI, between new_frame and render.

        `size` (width, height) in pixels is the window's.
        """
        session = self.session
        self._started, self._timed = time.perf_counter(), None
        room = self._picture_size(size)
        session.picture_size = room or size
        session.training.tick(session)
        self._precision.step(session)
        session.move_camera(min(imgui.get_io().delta_time, LONGEST_STEP))
        self._update_flicker()
        try:
            if room is not None:
                self._draw_picture(room)
                if session.measure_requested:
                    self._measure()
                self._compare(room)
        except (InputError, ShaderError, moderngl.Error, MemoryError) as error:
            self._context.reset.check_after(error)
            if self._renderer is None and self.frames_drawn == 0:
                # There is no older picture to stay with.
                raise
            if self._renderer is None:
                self._undrawable = self._wanted(session.picture_size)
            self._last_view = None
            session.say(" ".join(str(error).split()) or "there is not enough memory", "error", str(error))
        session.measure_requested = session.measure_requested and room is None
        now = time.monotonic()
        if now - self._recorded_at >= RECORDING_SECONDS:
            self._recorded_at = now
            session.record_camera()
        # After the picture: messages are seen from now on, however long it took.
        session.forget_old_toasts(time.monotonic())
        picture = imgui.ImTextureRef(self._last.image.glo) if self._last is not None else None
        self.interface.draw(session, self.facts(), picture, session.apply)
        self._tell_of_spare_textures()
        imgui.render()
        return imgui.get_draw_data()

    def paint(self, framebuffer: moderngl.Framebuffer, draw_data: imgui.ImDrawData) -> None:
        """Put what `build` made onto a framebuffer. Raises ContextLostError; pictures that were asked for still are then."""
        framebuffer.use()
        framebuffer.clear(*BACKGROUND)
        imgui.backends.opengl3_render_draw_data(draw_data)
        # ImGui leaves its own state behind.
        self._context.gl.enable_only(moderngl.NOTHING)
        if self._timed is not None:
            self._history.add(self._timed, 1000.0 * (time.perf_counter() - self._started))
        self._context.reset.check()
        for request in self.session.picture_requests:
            self._write_picture(request, framebuffer)
            self.session.picture_requests = self.session.picture_requests[1:]
        if self.session.recorded_path is not None:
            self._write_path(self.session.recorded_path)
            self.session.recorded_path = None

    def _write_picture(self, request: PictureRequest, framebuffer: moderngl.Framebuffer) -> None:
        suffix = "" if request.kind == "window" else f"-{request.kind}"
        dated = f"{self.session.scene.name}{suffix}-{time.strftime('%Y%m%d-%H%M%S')}.png"
        path = self.pictures / (request.file or dated)
        try:
            pixels = read_pixels(framebuffer) if request.kind == "window" else self._picture_alone(request)
            self._context.reset.check()
            write_png(path, pixels)
            if not request.quiet:
                self.session.say(f"wrote {path}")
        except (InputError, ShaderError, moderngl.Error, MemoryError) as error:
            self.session.say(" ".join(str(error).split()) or "there is not enough memory for the picture", "error")

    def _picture_alone(self, request: PictureRequest) -> NDArray[np.uint8]:
        """[H, W, 3] uint8 sRGB, row 0 on top: the picture without the interface."""
        if self._renderer is None or self._scene is not self.session.scene or self._packs is not self.session.packs:
            raise InputError("there is no picture to write: what is open has not been drawn")
        view = request.view(self._view(self.session.picture_size))
        # The next frame draws what is shown again: both have one target.
        self._last_view = None
        image = self._renderer.render(view, whole=True).image
        pixels = np.frombuffer(image.read(alignment=1), np.uint8).reshape(image.height, image.width, 4)
        return np.ascontiguousarray(pixels[::-1, :, :3])

    def _write_path(self, cameras: tuple[Camera, ...]) -> None:
        path = self.pictures / f"{self.session.scene.name}-path-{time.strftime('%Y%m%d-%H%M%S')}.json"
        try:
            write_text(path, cameras_json(cameras))
            self.session.say(f"wrote {len(cameras)} cameras to {path}: encode --grouping covisible --views takes it")
        except InputError as error:
            self.session.say(str(error), "error")

    def prepare_next(self) -> bool:
        """Compile the next thing that the user may toggle to: for when there is nothing else to do. False when all is ready."""
        view, renderer = self.session.view, self._renderer
        if renderer is None or renderer.scene is not self.session.scene or self._packs is not self.session.packs:
            return False
        for slot in dict.fromkeys((view.slot_a, view.slot_b)):
            for path in get_args(DecodePath):
                try:
                    if renderer.prepare(replace(slot, path=path)):
                        return True
                except (InputError, ShaderError, moderngl.Error, MemoryError):
                    # It is said when the user asks for it.
                    continue
        return False

    def needs_frame(self, size: tuple[int, int]) -> bool:
        """Whether the picture is out of date, a message is about to end, or a wish is open."""
        session = self.session
        waiting = session.recorded_path is not None or session.training.is_due
        ending = any(toast.until is not None and toast.until <= time.monotonic() for toast in session.toasts)
        comparing = self._compares and self._live.has_work(self._figures_are_wanted(), time.monotonic())
        self._update_flicker()
        return waiting or ending or comparing or self._picture_is_due(size)

    def _picture_is_due(self, size: tuple[int, int]) -> bool:
        """Whether the next frame shows something else, because of a wish, of what was opened, or of what was found meanwhile."""
        session = self.session
        wishes = session.measure_requested or bool(session.picture_requests) or session.motion is not None
        opened = session.scene is not self._scene or session.packs is not self._packs
        found = self.interface.background.take_news() or self.interface.is_settling(session)
        room = self._picture_size(size)
        if room is not None and self._is_undrawable(room):
            return found
        changed = room is None or self._view(room) != self._last_view
        return wishes or opened or found or self._is_waiting or changed

    def is_settled(self, size: tuple[int, int]) -> bool:
        """Whether the next frames would show the same picture: it is whole, and nothing moves it. A comparison may be under way."""
        return not (self._picture_is_due(size) or self._is_coarse() or self.session.precision_wishes)

    @property
    def skipped(self) -> Mapping[str, int]:
        """What the last drawn frame left out."""
        return self._last.skipped if self._last is not None else {}

    def release(self) -> None:
        """Free everything on the GPU, and end what runs beside it."""
        self.interface.background.close()
        self._live.close()
        self._images.release()
        self._release_renderer()


def read_pixels(framebuffer: moderngl.Framebuffer) -> NDArray[np.uint8]:
    """[H, W, 3] uint8 of a framebuffer, row 0 on top."""
    # The window's own framebuffer goes on saying the size that it was opened with: its viewport is what is shown.
    viewport = framebuffer.viewport
    width, height = viewport[2:]
    pixels = np.frombuffer(framebuffer.read(viewport=viewport, components=3, alignment=1), np.uint8)
    return np.ascontiguousarray(pixels.reshape(height, width, 3)[::-1])
