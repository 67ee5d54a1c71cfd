"""Program that opens a real window, which nobody touches. It follows a plan (tests/support/rest/plan.py), and each time that the
window rests it writes down what is on the screen and what the window shows.

    python -m tests.support.rest.window_at_rest PLAN.json FOLDER
"""

import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

# Before glfw, as in the program.
import imgui_bundle  # noqa: F401  # isort: skip
import glfw
import numpy as np
from numpy.typing import NDArray
from PIL import ImageGrab

from ntc.pack.file import write_pack
from tests.support.rest.interface_mask import covered_by_interface
from tests.support.rest.plan import Plan, SlowReading, Stage, plan_of, small_budgets
from tests.support.rest.records import Figures, Idle, Rest, write_rest
from viewer import cli
from viewer.app.window_app import WindowApp
from viewer.commands import run_line
from viewer.render.frames import read_picture
from viewer.ui.facts import UiData

FRAME_SECONDS = 0.04
"""Time between two frames at least, as on a screen: what works beside them has the processors."""
REST_SECONDS = 0.5
"""A window rests when it has drawn nothing for so long, and waits for events."""


class RestingWindow:
    """Watches the loop of a window through the two calls that it makes of glfw: one shows a frame, the other waits for events."""

    def __init__(self, app: WindowApp, plan: Plan, folder: Path) -> None:
        self._app, self._plan, self._folder = app, plan, folder
        self._stages = [Stage("start"), *plan.stages]
        self._number = 0
        """Number of the stage that is to come to rest."""
        self._began = time.monotonic()
        self._frames = 0
        """Shown since the stage began."""
        self._shown_at = self._began
        """Monotonic seconds of the last frame."""
        self._waits_since: float | None = None
        """Monotonic seconds of the first wait for events after the last frame."""
        self._watched_since: tuple[float, float] | None = None
        """Monotonic seconds, and seconds of the processor, from which on a window at rest is watched."""
        self._frames_at_rest = 0
        self._figures: list[Figures] = []
        self._facts: UiData | None = None
        """Of the last frame."""
        self._show: Callable[[Any], None] = glfw.swap_buffers
        self._wait: Callable[[float], None] = glfw.wait_events_timeout

    def watch(self) -> None:
        """Begin to record."""
        glfw.swap_buffers = self._shown  # type: ignore[assignment]
        glfw.wait_events_timeout = self._waited  # type: ignore[assignment]
        read = self._app.frontend.facts

        def recorded_facts() -> UiData:
            self._facts = read()
            return self._facts

        self._app.frontend.facts = recorded_facts  # type: ignore[method-assign]

    def _shown(self, handle: Any) -> None:
        self._frames += 1
        self._frames_at_rest += self._watched_since is not None
        self._waits_since = None
        if self._plan.records_figures:
            self._record_figures()
        self._show(handle)
        time.sleep(max(0.0, self._shown_at + FRAME_SECONDS - time.monotonic()))
        self._shown_at = time.monotonic()
        self._lose_patience()

    def _waited(self, seconds: float) -> None:
        self._wait(seconds)
        now = time.monotonic()
        self._waits_since = now if self._waits_since is None else self._waits_since
        if self._watched_since is not None:
            if now - self._watched_since[0] >= self._plan.idle_seconds:
                self._end_watching(now, *self._watched_since)
        elif now - self._waits_since >= REST_SECONDS and not self._app.frontend.facts().work:
            self._at_rest()
        else:
            self._lose_patience()

    def _lose_patience(self) -> None:
        if self._watched_since is None and time.monotonic() - self._began > self._plan.patience:
            name, work = self._stages[self._number].name, self._app.frontend.facts().work
            messages = [entry.text for entry in self._app.session.window.log]
            raise RuntimeError(f"{name}: no rest after {self._frames} frames; under way: {work}; messages: {messages}")

    def _record_figures(self) -> None:
        """Record the figures that panels show for a frame before it is shown, and the picture where they call them current."""
        last = self._app.frontend.picture.last
        if self._facts is None or last is None:
            return
        live = self._facts.live
        psnr = live.comparison.psnr_db if live.comparison is not None else None
        picture = read_picture(last.image) if live.is_current else None
        self._figures.append(Figures(self._frames, live.is_current, psnr, picture))

    def _at_rest(self) -> None:
        stage = self._stages[self._number]
        seconds = time.monotonic() - self._began - REST_SECONDS
        write_rest(self._folder, self._number, self._rest(stage.name, seconds))
        self._number += 1
        if self._number < len(self._stages):
            self._go_on(self._stages[self._number])
        elif self._plan.idle_seconds > 0.0:
            self._watched_since = time.monotonic(), time.process_time()
        else:
            self._app.run("file.quit")

    def _go_on(self, stage: Stage) -> None:
        self._frames, self._waits_since, self._figures = 0, None, []
        self._began = time.monotonic()
        if stage.drops:
            self._app._dropped(None, list(stage.drops))
        for line in stage.commands:
            run_line(self._app.context, line)

    def _rest(self, name: str, seconds: float) -> Rest:
        app = self._app
        session, last = app.session, app.frontend.picture.last
        if last is None:
            raise RuntimeError(f"{name}: the window rests without a picture")
        size = last.image.size
        area = app.frontend.interface.picture_area
        if area is None:
            raise RuntimeError(f"{name}: the window rests without a place for its picture")
        packs = {}
        for number, (pack_name, pack) in enumerate(session.packs.items()):
            packs[pack_name] = self._folder / f"{self._number}-{number}.ntc"
            write_pack(packs[pack_name], pack)
        return Rest(
            name=name,
            scene=session.scene.path,
            packs=packs,
            view=replace(session.shown_view, size=size),
            image=read_picture(last.image),
            screen=self._screen(),
            interface=covered_by_interface(last.image.glo, app.size),
            corner=(round(area.left), round(area.top)),
            paths=dict(last.paths),
            frames=self._frames,
            seconds=seconds,
            figures=tuple(self._figures),
            messages=tuple(entry.text for entry in session.window.log),
        )

    def _screen(self) -> NDArray[np.uint8]:
        """[H, W, 3], row 0 on top: what the window system shows of the window."""
        handle = self._app._handle
        (left, top), (width, height) = glfw.get_window_pos(handle), glfw.get_window_size(handle)
        picture = ImageGrab.grab((left, top, left + width, top + height), xdisplay=os.environ["DISPLAY"])
        return np.asarray(picture.convert("RGB"))

    def _end_watching(self, now: float, since: float, processor: float) -> None:
        idle = Idle(now - since, self._frames_at_rest, time.process_time() - processor)
        write_rest(self._folder, self._number, idle)
        self._app.run("file.quit")


def main() -> int:
    """Arguments: the plan, and the folder that takes what is written down."""
    plan, folder = plan_of(Path(sys.argv[1]).read_bytes()), Path(sys.argv[2])
    show = WindowApp.show

    def watched(app: WindowApp, frames: int | None = None) -> None:
        reading = SlowReading(plan)
        reading.install()
        RestingWindow(app, plan, folder).watch()
        show(app, frames)

    WindowApp.show = watched  # type: ignore[method-assign, assignment]
    with small_budgets(plan.budgets):
        return cli.main(["view", *plan.arguments, "--out", str(folder / "pictures")])


if __name__ == "__main__":
    sys.exit(main())
