"""Mouse and keys of a script: generators that yield for each frame that must see an event."""

import difflib
from collections.abc import Iterator

from imgui_bundle import imgui

from ntc.errors import InputError
from viewer.commands.keys import Chord
from viewer.script.stage import Stage, Turn
from viewer.ui.keyboard import imgui_key
from viewer.ui.user_interface import SETTLING_FRAMES

LAYOUT_FRAMES = 16
"""Within which panels come to the front."""
LABELS_SHOWN = 3
MODIFIER_KEYS = {"Ctrl": imgui.Key.mod_ctrl, "Shift": imgui.Key.mod_shift, "Alt": imgui.Key.mod_alt}


def rest() -> Iterator[Turn]:
    """The frames that the layout needs after an event."""
    for _ in range(SETTLING_FRAMES):
        yield "frame"


def opened(stage: Stage) -> Iterator[Turn]:
    """The next frame, and those until everything that is to be opened is open."""
    yield "frame"
    while stage.is_opening:
        yield "rest"


def hold(chord: Chord, down: bool) -> Iterator[Turn]:
    """Press a key with its modifiers, or let them go."""
    io = imgui.get_io()
    for is_held, modifier in zip((chord.ctrl, chord.shift, chord.alt), MODIFIER_KEYS.values(), strict=True):
        if is_held:
            io.add_key_event(modifier, down)
    io.add_key_event(imgui_key(chord.key), down)
    yield "frame"


def hold_modifier(name: str, down: bool) -> Iterator[Turn]:
    """Press one of MODIFIER_KEYS, for the mouse, or let it go."""
    imgui.get_io().add_key_event(MODIFIER_KEYS[name], down)
    yield "frame"


def press(chord: Chord) -> Iterator[Turn]:
    """Press a key with its modifiers and let them go."""
    yield from hold(chord, True)
    yield from hold(chord, False)
    yield from rest()


def move(x: float, y: float) -> Iterator[Turn]:
    """Move the mouse to a place in pixels of the window's content."""
    imgui.get_io().add_mouse_pos_event(x, y)
    yield "frame"


def _button(down: bool, button: int) -> Iterator[Turn]:
    imgui.get_io().add_mouse_button_event(button, down)
    yield "frame"


def click(label: str, stage: Stage) -> Iterator[Turn]:
    """Click on the widget called `label`, which may still be on its way to the front. Raises InputError where there is none."""
    items = stage.widgets
    for _ in range(LAYOUT_FRAMES):
        if label in items.labels():
            break
        yield "frame"
    try:
        place = items.centre(label)
    except KeyError:
        near = difflib.get_close_matches(label, items.labels(), LABELS_SHOWN, 0.4)
        hint = f"; there are {', '.join(near)}" if near else ""
        raise InputError(f"click: nothing is called {label!r}{hint}") from None
    yield from move(*place)
    yield from _button(True, 0)
    yield from _button(False, 0)
    yield from rest()


def drag(start: tuple[float, float], end: tuple[float, float], button: int) -> Iterator[Turn]:
    """Drag from one place to another with a mouse button (0 left, 1 right, 2 middle)."""
    yield from move(*start)
    yield from _button(True, button)
    for share in (0.5, 1.0):
        yield from move(start[0] + (end[0] - start[0]) * share, start[1] + (end[1] - start[1]) * share)
    yield from _button(False, button)
    yield from rest()


def wheel(notches: float) -> Iterator[Turn]:
    """Turn the wheel; positive is away from the hand."""
    imgui.get_io().add_mouse_wheel_event(0.0, notches)
    yield from rest()


def type_text(text: str) -> Iterator[Turn]:
    """Type into the active field."""
    imgui.get_io().add_input_characters_utf8(text)
    yield from rest()
