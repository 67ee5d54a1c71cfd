"""Picture and user interface in one framebuffer, for the window and for tests without a window."""

import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

import moderngl
from imgui_bundle import imgui

from ntc.errors import InputError
from viewer.app.effects import Effects
from viewer.app.frame_facts import FactsReader
from viewer.app.work_under_way import training_work, work_for_picture
from viewer.commands import bindings, run_or_notify, why_not
from viewer.commands.command import Context
from viewer.commands.effects import Measure, RaisePanel, ResetLayout
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ShaderError
from viewer.inspect.comparison import LiveFigures
from viewer.inspect.live_comparison import LiveComparison
from viewer.inspect.slot_jobs import FormatEncoding, PrecisionSearch
from viewer.locations import cache_folder
from viewer.render.frames import FrameTimes
from viewer.render.path_choice import unsupported_paths
from viewer.render.resources.decoding_shaders import fastest_first, unsupported_precisions
from viewer.render.viewport import Viewport
from viewer.state.event_handlers import (
    apply_event,
    expire_pointing,
    expire_toasts,
    notify,
    sample_camera,
    set_flicker_phase,
    set_measurements,
    set_panel_titles,
    set_unsupported,
    start_frame,
)
from viewer.state.session import SlotMeasurement
from viewer.state.view_state import Side
from viewer.ui.facts import FIRST_PICTURE, UiData, UiFrame, Work
from viewer.ui.user_interface import SETTLING_FRAMES, UserInterface
from viewer.viewpoints.first_view import FirstView

BACKGROUND = (0.05, 0.055, 0.06, 1.0)
RECORDING_SECONDS = 0.25
"""Time between two cameras of a recorded path, in seconds."""
LONGEST_STEP = 0.1
"""Longest motion of the camera in one frame, in seconds: a slow frame must not make it jump."""
SECONDS_BETWEEN_FIGURES = 0.25
"""Least time between two frames for the figures of a training, in seconds."""
POLL_SECONDS = 0.05
"""Time between two looks for news of another process, in seconds."""


class Frontend:
    """Drawing of a session. All calls belong to the thread of the OpenGL context, with an ImGui context current."""

    def __init__(
        self, graphics: GraphicsContext, context: Context, effects: Effects, prepares_ahead: bool = False
    ) -> None:
        """Make a frontend. `effects` are those of `context`'s commands. With `prepares_ahead`, encoding is prepared as soon as a scene
        without a pack is drawn.
        """
        session = context.session
        self._graphics, self._context, self._effects, self.session = graphics, context, effects, session
        emit = partial(apply_event, session)
        for problem in bindings(session.settings.keys).problems:
            notify(session, problem, "error")
        self.interface = UserInterface()
        set_panel_titles(session, self.interface.panel_titles)
        set_unsupported(session, {**unsupported_precisions(graphics), **unsupported_paths(graphics)})
        self._times = FrameTimes(graphics.waits)
        self.picture = Viewport(graphics, session, self._times, self.interface.background, emit)
        self.reader = FactsReader(graphics, session, self.picture, self._times)
        self._first_view = FirstView(self.interface.background, emit)
        self._precision = PrecisionSearch(self.interface.background, fastest_first(graphics), emit)
        self._measuring: Iterator[Mapping[Side, SlotMeasurement]] | None = None
        """Measurement under way, a step in each frame."""
        self._recorded_at = -math.inf
        self._formats = FormatEncoding(cache_folder("blocks"), emit)
        self._prepares_ahead = prepares_ahead
        self.live = LiveComparison()
        self._news = False
        """True where jobs have had a result since the last frame."""
        self._built_at = -math.inf
        """Monotonic time of the last frame in seconds."""
        self._training_shown: tuple[object, ...] = ()
        """Facts of a training in the last frame."""
        self._is_announced = False
        """True where a frame has announced the first picture."""
        self._because: tuple[str, ...] = ()
        """Reasons of the last frame."""

    def facts(self) -> UiData:
        """Return the facts of the last frame for the panels."""
        encoding, pending = self._formats.progress, self.picture.pending
        first = (Work(FIRST_PICTURE),) if self.picture.last is None else ()
        beside = work_for_picture(self.session, encoding, self.live.is_computing, pending)
        measuring = (Work("measuring A and B"),) if self._measuring is not None else ()
        work = (
            *first,
            *measuring,
            *self._effects.opening.work,
            *training_work(self._context.training),
            *self._effects.exporting.work,
            *beside,
        )
        # Figures of an incomplete picture would be wrong.
        live = LiveFigures(problem=pending[0].line) if pending else self.live.figures
        shares = {name: report.share for name, report in encoding.items()}
        facts = self.reader.read(live, self._is_training, shares)
        return replace(facts, work=work, drawn_because=self._because)

    def build(self, size: tuple[int, int]) -> imgui.ImDrawData:
        """Draw the picture in the room that panels leave, and build the UI, between new_frame and render.

        `size` (width, height) in pixels is the window's.
        """
        session, room = self.session, self._picture_size(size)
        self._because = self.reasons(size)
        self._effects.opening.advance()
        self._effects.exporting.advance()
        self._times.begin()
        self._news, self._built_at = False, time.monotonic()
        self._tick_training()
        self._training_shown = self._training_facts()
        emit = partial(run_or_notify, self._context)
        self.interface.handle_input(session, emit)
        self._precision.step(session)
        self._formats.step(session)
        start_frame(session, min(imgui.get_io().delta_time, LONGEST_STEP), room or size)
        self._update_flicker()
        if room is not None and (self._graphics.waits or self._is_announced):
            self._draw_picture(room)
        # The first picture takes seconds: a frame says so before.
        self._is_announced = room is not None
        self._prepare_ahead()
        self._record_camera()
        # After the picture: the time of a message starts when it is on screen.
        expire_toasts(session, time.monotonic())
        expire_pointing(session, time.monotonic())
        last = self.picture.last
        picture = imgui.ImTextureRef(last.image.glo) if last is not None else None
        reason = partial(why_not, self._context)
        facts = self.facts()
        # Before the panels are drawn: the next frame shows what they ask for.
        self._effects.opening.note_shown()
        for panel in self._effects.take(RaisePanel):
            self.interface.raise_panel(panel.title)
        if self._effects.take(ResetLayout):
            self.interface.reset_layout()
        frame = UiFrame(session, self._context.training, facts, emit, self.interface.rects, reason)
        self.interface.draw(frame, picture)
        for problem in self.reader.take_problems():
            notify(session, problem, "error")
        imgui.render()
        return imgui.get_draw_data()

    def paint(self, framebuffer: moderngl.Framebuffer, draw_data: imgui.ImDrawData) -> None:
        """Draw the result of `build` onto a framebuffer. Raises ContextLostError; requested pictures wait for the next frame."""
        framebuffer.use()
        framebuffer.clear(*BACKGROUND)
        imgui.backends.opengl3_render_draw_data(draw_data)
        # ImGui changes the OpenGL state and does not restore it.
        self._graphics.gl.enable_only(moderngl.NOTHING)
        if self._graphics.waits:
            self._times.end()
        self._graphics.reset.check()
        self._effects.write_pictures(self._graphics, framebuffer, self.picture)

    def presented(self) -> None:
        """Note that the window system has the frame."""
        if not self._graphics.waits:
            self._times.end()

    def reasons(self, size: tuple[int, int]) -> tuple[str, ...]:
        """Return why the window draws another frame now, or will when some work ends, in plain lines; empty while it rests.

        `size` (width, height) in pixels is the window's. A training is not a reason: its news draw frames.
        """
        return tuple(dict.fromkeys((*self._due(size), *self._awaited())))

    def needs_frame(self, size: tuple[int, int]) -> bool:
        """Return True where a frame must be drawn now."""
        return self.frames_needed(size) > 0

    def frames_needed(self, size: tuple[int, int]) -> int:
        """Return how many frames must be drawn: as many as the layout needs, one for news of background work, or 0."""
        self._follow_training()
        self._record_camera()
        if any(self._due(size)):
            return SETTLING_FRAMES
        news = self._training_shown != self._training_facts() or any(self._awaited())
        return int(news and time.monotonic() - self._built_at >= SECONDS_BETWEEN_FIGURES)

    def _due(self, size: tuple[int, int]) -> Iterator[str]:
        """Yield why the next frame differs from the last."""
        session, now, room = self.session, time.monotonic(), self._picture_size(size)
        encoded, computed = self._formats.take_news(), self.interface.background.take_news()
        # A frame clears this, not the first caller.
        self._news = self._news or encoded or computed
        if self._news:
            yield "background work has a result"
        # ImGui handles one press or release of a key or button per frame, even if several came at once.
        if not imgui.get_current_context().input_events_queue.empty():
            yield "keys or buttons were pressed"
        if room is None or self.interface.is_settling(session):
            yield "panels are being arranged"
        if any(toast.until is not None and toast.until <= now for toast in session.window.toasts):
            yield "a message ends"
        pointed, tooltip = session.inspection.pointed_out, self.interface.rects.tooltips.seconds_until_due
        if pointed is not None and pointed.until is not None and pointed.until <= now:
            yield "textures are no longer highlighted"
        if tooltip is not None and tooltip <= 0.0:
            yield "a tooltip appears"
        if self._compares and self.live.has_work(self._figures_are_wanted(), now):
            yield "A is compared with B"
        if self._measuring is not None:
            yield "the picture is measured"
        yield from self._effects.reasons
        self._update_flicker()
        if room is not None and not self.picture.is_undrawable(room):
            yield from self._picture_is_due(room)

    def _picture_is_due(self, room: tuple[int, int]) -> Iterator[str]:
        """Yield why the next picture, of this size, differs from the last."""
        session = self.session
        if session.is_moving:
            yield "the camera moves" if session.navigation.motion is not None else "an animation plays"
        if self._first_view.is_due(session):
            yield "a first view is searched"
        if self.reader.is_pending:
            yield "values under the mouse are read"
        yield from self.picture.due(room)

    def _awaited(self) -> Iterator[str]:
        """Yield the work whose end changes the window."""
        session, last_view = self.session, self.picture.last_view
        work = work_for_picture(session, self._formats.progress, self.live.is_computing, pending=())
        yield from (part.title for part in (*self._effects.opening.work, *self._effects.exporting.work, *work))
        yield from (f"encoding {block_format}" for block_format in session.awaited_formats.values())
        if session.seeks_first_view and self.picture.is_open:
            yield "a first view is searched"
        if self._compares and last_view is not None and self.live.is_pending(self._figures_are_wanted()):
            yield "A is compared with B"
        if self.interface.background.is_busy:
            yield "background work continues"

    @property
    def seconds_until_change(self) -> float:
        """Seconds until the window changes by itself; infinite where it does not."""
        tooltip, training = self.interface.rects.tooltips.seconds_until_due, self._context.training
        explains = math.inf if tooltip is None else max(tooltip, 0.0)
        if self.live.is_computing or training.active is not None or training.saving or training.rates.is_busy:
            return min(POLL_SECONDS, explains)
        if not self.session.window.flickers:
            return explains
        turns = time.monotonic() * 2.0 * self.session.settings.flicker_hz
        return min(explains, (math.floor(turns) + 1.0 - turns) / (2.0 * self.session.settings.flicker_hz))

    def release(self) -> None:
        """Free everything on the GPU, and end background work."""
        self.interface.background.close()
        self.live.close()
        self._formats.close()
        self.reader.release()
        self.picture.release()

    def _picture_size(self, window: tuple[int, int]) -> tuple[int, int] | None:
        """Return the size (width, height) in pixels of the picture in a window; None before panels have their places."""
        area, display = self.interface.picture_area, imgui.get_io().display_size
        return area.pixels((display.x, display.y), window) if area is not None else None

    def _draw_picture(self, size: tuple[int, int]) -> None:
        session = self.session
        try:
            self.picture.draw(size, self._effects.need_whole_picture)
            self._look_for_first_view(size)
            if self._effects.take(Measure):
                self._measuring = self.reader.measuring()
            self._measure_further()
            self._compare(size)
        except (InputError, ShaderError, moderngl.Error, MemoryError) as error:
            self._graphics.reset.check_after(error)
            if not self.picture.note_failure(size):
                raise
            line = " ".join(str(error).split()) or "out of memory"
            notify(session, line, "error", str(error))
            self._effects.take(Measure)

    def _measure_further(self) -> None:
        """Do the next step of a measurement."""
        if self._measuring is None:
            return
        measured = next(self._measuring, None)
        if measured is None:
            self._measuring = None
        else:
            set_measurements(self.session, measured)

    def _look_for_first_view(self, size: tuple[int, int]) -> None:
        """Continue the search for a first view in a scene without cameras, as soon as all of the scene is on screen."""
        if self.picture.is_open and not self.picture.is_undrawable(size):
            self._first_view.step(self.session)

    def _prepare_ahead(self) -> None:
        """Prepare encoding as soon as a scene without a pack is drawn."""
        session = self.session
        wanted = self._prepares_ahead and session.settings.prepare_encoding and self.picture.last is not None
        if wanted and session.scene.textures and not session.packs and not self._context.training.log.runs:
            self._context.training.prepare_ahead(session.scene)

    def _compare(self, size: tuple[int, int]) -> None:
        """Compare A with B while the picture rests."""
        renderer, view, now = self.picture.renderer, self.picture.last_view, time.monotonic()
        if renderer is None or view is None:
            return
        self.live.note(renderer, view, self.session.packs, size, now)
        if not self._compares or self.picture.pending or self.picture.is_coarse():
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
        """Take news from a training, without drawing a frame."""
        if self._context.training.is_due:
            self._tick_training()

    def _training_facts(self) -> tuple[object, ...]:
        """Return values that are equal while panels show the same of a training and its messages."""
        training = self._context.training
        run, log = training.active, training.log
        under_way: tuple[object, ...] = ()
        if run is not None:
            # Before the first report only the passing seconds show that the training works.
            passed = int(time.monotonic() - run.began) if run.progress is None else 0
            under_way = (run.state, run.progress, run.notes, passed)
        decided = (log.runs, log.chosen, training.saving, training.plan, training.rates.version)
        return (*under_way, self.session.window.log.count, *decided)

    def _figures_are_wanted(self) -> bool:
        """Return True where something shows the comparison of A and B."""
        session, view = self.session, self.session.view
        in_picture = view.overlay.kind in ("error-texture", "error-decoder") or (
            view.compare == "difference" and view.difference.kind == "flip"
        )
        return session.window.show_panels or in_picture

    @property
    def _is_training(self) -> bool:
        """True while a training changes the picture every second and needs the processors."""
        return self._context.training.state not in ("idle", "paused")

    @property
    def _compares(self) -> bool:
        """True where A is compared with B while the picture rests."""
        return self.session.settings.live_figures and not self._is_training

    def _update_flicker(self) -> None:
        if self.session.window.flickers:
            turns = time.monotonic() * 2.0 * self.session.settings.flicker_hz
            set_flicker_phase(self.session, int(turns) % 2 == 1)
