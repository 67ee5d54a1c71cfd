"""The window's content without a window, driven by calls: tests and benchmarks click, type and take pictures."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from tests.support.spoilt_files import finish_opening
from viewer.app.headless import HeadlessApp
from viewer.capture.film import read_pixels
from viewer.ui.user_interface import SETTLING_FRAMES

LONGEST_PAUSE = 0.02
"""Seconds between two frames of an app that waits."""


class DrivenApp(HeadlessApp):
    """A HeadlessApp with the hands of a person."""

    def run(self, command_id: str, *values: object) -> None:
        """Run a command; what it opens is open then. What keeps it from being carried out becomes a message."""
        super().run(command_id, *values)
        finish_opening(self.effects.opening)

    def settle(self) -> None:
        """Draw until the layout rests, and what is opened is open."""
        self.frame(SETTLING_FRAMES)
        while self.is_opening:
            time.sleep(0.005)
            self.frame(SETTLING_FRAMES)
        while self.frontend.interface.is_settling(self.session):
            self.frame()

    def until(self, reached: Callable[[], object], seconds: float = 120.0) -> None:
        """Draw frames until `reached` says yes. Fails with the messages of the window after `seconds`."""
        began = time.monotonic()
        while not reached():
            assert time.monotonic() - began < seconds, [entry.text for entry in self.session.window.log]
            self.frame()
            # What works beside the frames needs the processors, and Python's lock; the longer it takes, the more.
            time.sleep(min(0.005 + 0.1 * (time.monotonic() - began), LONGEST_PAUSE))

    def rest(self) -> None:
        """Draw until the picture is whole and nothing is to come."""
        self.frame()
        self.until(lambda: self.is_settled)

    def move(self, x: float, y: float) -> None:
        """Move the mouse."""
        imgui.get_io().add_mouse_pos_event(x, y)
        self.frame()

    def button(self, down: bool, button: int = 0) -> None:
        """Press or release a mouse button (0 left, 1 right, 2 middle)."""
        imgui.get_io().add_mouse_button_event(button, down)
        self.frame()

    def show_panel(self, title: str) -> None:
        """Bring a panel to the front."""
        self.run("window.panel", title)
        self.settle()

    def double_click(self, label: str) -> None:
        """Click twice on the widget called `label`. Raises KeyError when there is none."""
        self.move(*self.widgets.centre(label))
        for down in (True, False, True, False):
            self.button(down)
        self.settle()

    def click(self, label: str) -> None:
        """Click on the widget called `label`. Raises KeyError when there is none."""
        self.click_at(*self.widgets.centre(label))

    def click_at(self, x: float, y: float) -> None:
        """Click at a place in window pixels."""
        self.move(x, y)
        self.button(True)
        self.button(False)
        self.settle()

    def drag(self, start: tuple[float, float], end: tuple[float, float], button: int = 0) -> None:
        """Drag from one place to another."""
        self.move(*start)
        self.button(True, button)
        for share in (0.5, 1.0):
            self.move(start[0] + (end[0] - start[0]) * share, start[1] + (end[1] - start[1]) * share)
        self.button(False, button)
        self.settle()

    def key(self, key: imgui.Key, down: bool) -> None:
        """Press or release a key."""
        imgui.get_io().add_key_event(key, down)
        self.frame()

    def press(self, key: imgui.Key) -> None:
        """Press and release a key."""
        self.key(key, True)
        self.key(key, False)
        self.settle()

    def type(self, text: str) -> None:
        """Type into the active field."""
        imgui.get_io().add_input_characters_utf8(text)
        self.settle()

    def drop(self, path: Path) -> None:
        """Drop a file on the window."""
        self.open_files([path])
        self.settle()

    def screenshot(self) -> NDArray[np.uint8]:
        """[H, W, 3] uint8: what the window would show."""
        return read_pixels(self.framebuffer)
