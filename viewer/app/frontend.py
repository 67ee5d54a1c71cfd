"""Picture and user interface in one framebuffer: the same for the window and for tests without one."""

import math
import time
from dataclasses import replace
from functools import partial

import moderngl
from imgui_bundle import imgui

from ntc.errors import InputError
from viewer.app.frame_facts import FactsReader
from viewer.app.slow_commands import SlowCommands
from viewer.app.work_under_way import WorkUnderWay
from viewer.capture.picture_writer import PictureWriter
from viewer.commands import bindings, why_not
from viewer.commands.command import Context
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ShaderError
from viewer.inspect.format_encoding import FormatEncoding
from viewer.inspect.live_comparison import LiveComparison
from viewer.inspect.precision_search import PrecisionSearch
from viewer.locations import blocks_cache
from viewer.render.frame_times import FrameTimes
from viewer.render.path_choice import unsupported_paths
from viewer.render.resources.precision import unsupported_precisions
from viewer.render.viewport import Viewport
from viewer.state.event_handlers import (
    apply_event,
    expire_pointing,
    expire_toasts,
    finish_measurement,
    notify,
    sample_camera,
    set_flicker_phase,
    set_panel_titles,
    set_unsupported,
    start_frame,
)
from viewer.ui.facts import FrameFacts, UiFrame
from viewer.ui.user_interface import SETTLING_FRAMES, UserInterface
from viewer.viewpoints.first_view import FirstView

BACKGROUND = (0.05, 0.055, 0.06, 1.0)
RECORDING_SECONDS = 0.25
"""A recorded path has a camera so often."""
LONGEST_STEP = 0.1
"""Seconds that a camera moves by itself in one frame: a slow one must not make it jump."""
SECONDS_BETWEEN_FIGURES = 0.25
"""The figures of a training are drawn no more often while nothing else changes."""
POLL_SECONDS = 0.05
"""What is under way in another process is asked for news so often."""


class Frontend:
    """Draws a session. All calls belong to the thread of the OpenGL context, with an ImGui context current."""

    def __init__(self, graphics: GraphicsContext, context: Context, prepares_ahead: bool = False) -> None:
        """`prepares_ahead`: whether the encoding of a scene without a pack is prepared once it is drawn."""
        session = context.session
        self._graphics, self._context, self.session = graphics, context, session
        emit = partial(apply_event, session)
        for problem in bindings(session.settings.keys).problems:
            notify(session, problem, "error")
        self.interface = UserInterface()
        set_panel_titles(session, self.interface.panel_titles)
        set_unsupported(session, {**unsupported_precisions(graphics), **unsupported_paths(graphics)})
        self._times = FrameTimes(graphics.waits)
        self.picture = Viewport(graphics, session, self._times, self.interface.background, emit)
        self.reader = FactsReader(graphics, session, self.picture, self._times)
        self._writer = PictureWriter(graphics, session, self.picture)
        self._first_view = FirstView(self.interface.background, emit)
        self._precision = PrecisionSearch(
            self.interface.background, partial(self.picture.variants.precisions, graphics), emit
        )
        self._recorded_at = -math.inf
        self._formats = FormatEncoding(blocks_cache(), emit)
        self._prepares_ahead = prepares_ahead
        self.live = LiveComparison()
        self._work = WorkUnderWay()
        self.slow = SlowCommands(context)
        self._news = False
        """Whether jobs have found something since the last frame."""
        self._built_at = -math.inf
        """Monotonic seconds."""
        self._training_shown: tuple[object, ...] = ()
        """Of the last frame."""

    def facts(self) -> FrameFacts:
        """What the panels show of the last frame."""
        encoding, last = self._formats.progress, self.picture.last
        to_come = last.to_come if last is not None else ()
        found = self._work.read(self.session, self._context.training, encoding, self.live.is_computing, to_come)
        work = (*self.slow.work, *found)
        return replace(self.reader.read(self.live.figures, self._is_training, encoding), work=work)

    def build(self, size: tuple[int, int]) -> imgui.ImDrawData:
        """Draw the picture as large as panels leave room for it, and build the UI, between new_frame and render.

        `size` (width, height) in pixels is the window's.
        """
        session, room = self.session, self._picture_size(size)
        self.slow.run_announced()
        self._times.begin()
        self._news, self._built_at = False, time.monotonic()
        self._tick_training()
        self._training_shown = self._training_facts()
        self._precision.step(session)
        self._formats.step(session)
        start_frame(session, min(imgui.get_io().delta_time, LONGEST_STEP), room or size)
        self._update_flicker()
        self.picture.times_wanted = self.interface.shows("Timings")
        if room is not None:
            self._draw_picture(room)
        self._prepare_ahead()
        self._record_camera()
        # After the picture: a message is on screen from now on, however long drawing took.
        expire_toasts(session, time.monotonic())
        expire_pointing(session, time.monotonic())
        last = self.picture.last
        picture = imgui.ImTextureRef(last.image.glo) if last is not None else None
        reason = partial(why_not, self._context)
        facts = self.facts()
        # Before the panels are drawn: what they ask for is shown by the next frame only.
        self.slow.note_shown()
        frame = UiFrame(session, self._context.training, facts, self.slow.emit, self.interface.rects, reason)
        self.interface.draw(frame, picture)
        for problem in self.reader.take_problems():
            notify(session, problem, "error")
        imgui.render()
        return imgui.get_draw_data()

    def paint(self, framebuffer: moderngl.Framebuffer, draw_data: imgui.ImDrawData) -> None:
        """Put what `build` made onto a framebuffer. Raises ContextLostError; pictures that were asked for still are then."""
        framebuffer.use()
        framebuffer.clear(*BACKGROUND)
        imgui.backends.opengl3_render_draw_data(draw_data)
        # ImGui leaves its own state behind.
        self._graphics.gl.enable_only(moderngl.NOTHING)
        if self._graphics.waits:
            self._times.end()
        self._graphics.reset.check()
        self._writer.write_requested(framebuffer)

    def presented(self) -> None:
        """The frame has been handed to the window system."""
        if not self._graphics.waits:
            self._times.end()

    def needs_frame(self, size: tuple[int, int]) -> bool:
        """Whether the picture or a panel is out of date, a message is about to end, or a request is open."""
        return self.frames_needed(size) > 0

    def frames_needed(self, size: tuple[int, int]) -> int:
        """How many frames show what has changed: one for the figures of a training, else as many as the layout needs; 0 for none."""
        self._follow_training()
        self._record_camera()
        if self._is_out_of_date(size):
            return SETTLING_FRAMES
        shown = self._training_shown
        news = shown != self._training_facts()
        return int(news and (time.monotonic() - self._built_at >= SECONDS_BETWEEN_FIGURES))

    def _is_out_of_date(self, size: tuple[int, int]) -> bool:
        session = self.session
        waiting = session.requests.camera_path is not None
        pointed = session.inspection.pointed_out
        ends = [toast.until for toast in session.window.toasts] + ([] if pointed is None else [pointed.until])
        ending = any(end is not None and end <= time.monotonic() for end in ends)
        comparing = self._compares and self.live.has_work(self._figures_are_wanted(), time.monotonic())
        self._update_flicker()
        tooltip = self.interface.rects.tooltips.seconds_until_due
        explains = tooltip is not None and tooltip <= 0.0
        return waiting or ending or comparing or explains or self._frame_is_due(size)

    def is_settled(self, size: tuple[int, int]) -> bool:
        """Whether the next frames would show the same picture: it is whole, and nothing moves it. A comparison may be under way."""
        seeks = self.session.requests.first_view and self.picture.is_open
        moves = self.slow.are_waiting or self._frame_is_due(size) or self.picture.is_coarse()
        return not (moves or self._is_searching or seeks)

    @property
    def _is_searching(self) -> bool:
        """Whether a slot waits for its precision, or for the textures that it is to show."""
        return bool(self.session.requests.precision or self.session.requests.formats)

    @property
    def seconds_until_change(self) -> float:
        """Seconds until the window changes by itself; infinite where it does not."""
        tooltip, training = self.interface.rects.tooltips.seconds_until_due, self._context.training
        explains = math.inf if tooltip is None else max(tooltip, 0.0)
        if self.live.is_computing or training.active is not None or training.saving:
            return min(POLL_SECONDS, explains)
        if not self.session.window.flickers:
            return explains
        turns = time.monotonic() * 2.0 * self.session.settings.flicker_hz
        return min(explains, (math.floor(turns) + 1.0 - turns) / (2.0 * self.session.settings.flicker_hz))

    def release(self) -> None:
        """Free everything on the GPU, and end what runs beside it."""
        self._writer.end_film()
        self.interface.background.close()
        self.slow.close()
        self.live.close()
        self._formats.close()
        self.reader.release()
        self.picture.release()

    def _picture_size(self, window: tuple[int, int]) -> tuple[int, int] | None:
        """(width, height) in pixels of what panels leave of a window of so many; None before panels have found their places."""
        area, display = self.interface.picture_area, imgui.get_io().display_size
        return area.pixels((display.x, display.y), window) if area is not None else None

    def _draw_picture(self, size: tuple[int, int]) -> None:
        session = self.session
        try:
            self.picture.draw(size)
            self._look_for_first_view(size)
            if session.requests.measure:
                finish_measurement(session, self.reader.measurements())
            self._compare(size)
        except (InputError, ShaderError, moderngl.Error, MemoryError) as error:
            self._graphics.reset.check_after(error)
            if not self.picture.note_failure(size):
                raise
            line = " ".join(str(error).split()) or "out of memory"
            notify(session, line, "error", str(error))
            if session.requests.measure:
                finish_measurement(session, None)

    def _look_for_first_view(self, size: tuple[int, int]) -> None:
        """In a scene without cameras, go on looking for a place to begin with, once all of it is on screen."""
        renderer, session = self.picture.renderer, self.session
        if renderer is not None and self.picture.is_open and not self.picture.is_undrawable(size):
            self._first_view.step(session, renderer.texture_ids_from)

    def _prepare_ahead(self) -> None:
        """Once a scene without a pack is drawn, prepare the encoding that it is offered."""
        session = self.session
        wanted = self._prepares_ahead and session.settings.prepare_encoding and self.picture.last is not None
        if wanted and session.scene.textures and not session.packs and not self._context.training.log.runs:
            self._context.training.prepare_ahead(session.scene)

    def _compare(self, size: tuple[int, int]) -> None:
        """Do what there is to do while the picture rests."""
        renderer, view, now = self.picture.renderer, self.picture.last_view, time.monotonic()
        if renderer is None or view is None:
            return
        self.live.note(renderer, view, self.session.packs, size, now)
        if not self._compares or self.picture.to_come or self.picture.is_coarse():
            return
        if self.live.step(view, self._figures_are_wanted(), now):
            self.picture.compose_again(view)

    def _record_camera(self) -> None:
        now = time.monotonic()
        if now - self._recorded_at >= RECORDING_SECONDS:
            self._recorded_at = now
            sample_camera(self.session)

    def _tick_training(self) -> None:
        shown = frozenset(slot.source for slot in self.session.view.slots.values())
        self._context.training.tick(self.session.scene, shown, self.session.packs)

    def _follow_training(self) -> None:
        """Take what has come from a training. That draws nothing: it may be nothing that is seen."""
        if self._context.training.is_due:
            self._tick_training()

    def _training_facts(self) -> tuple[object, ...]:
        """What panels show of a training and its messages, as values that are equal while they show the same."""
        training = self._context.training
        run, log = training.active, training.log
        under_way: tuple[object, ...] = ()
        if run is not None:
            # Before the first report, the seconds that have passed are the only sign of life.
            passed = int(time.monotonic() - run.began) if run.progress is None else 0
            under_way = (run.state, run.progress, run.notes, passed)
        return (*under_way, self.session.window.log.count, log.runs, log.undecided, training.saving)

    def _figures_are_wanted(self) -> bool:
        """Whether anything shows what a comparison of A and B would find."""
        session, view = self.session, self.session.view
        in_picture = view.overlay.kind in ("error-texture", "error-decoder") or (
            view.compare == "difference" and view.difference.kind == "flip"
        )
        return session.window.show_panels or in_picture

    @property
    def _is_training(self) -> bool:
        """Whether a training changes the picture every second and needs the processors."""
        return self._context.training.state not in ("idle", "paused")

    @property
    def _compares(self) -> bool:
        """Whether A is compared with B while the picture rests."""
        return self.session.settings.live_figures and not self._is_training

    def _update_flicker(self) -> None:
        if self.session.window.flickers:
            turns = time.monotonic() * 2.0 * self.session.settings.flicker_hz
            set_flicker_phase(self.session, int(turns) % 2 == 1)

    def _frame_is_due(self, size: tuple[int, int]) -> bool:
        """Whether the next frame shows something else, because of a request, an opened file, or a result of a background job."""
        session, room = self.session, self._picture_size(size)
        encoded, computed = self._formats.take_news(), self.interface.background.take_news()
        # Kept until a frame shows it, whoever asks first.
        self._news = self._news or encoded or computed
        # ImGui takes one press or release of a key or button in a frame, however many came at once.
        queued = not imgui.get_current_context().input_events_queue.empty()
        found = self._news or queued or self.slow.is_due or self.interface.is_settling(session)
        if room is None:
            return True
        requested = session.requests.measure or bool(session.requests.pictures) or session.is_moving
        requested = requested or self._first_view.is_due(session) or self.reader.is_pending
        return found or self.picture.is_due(room) or (requested and not self.picture.is_undrawable(room))
