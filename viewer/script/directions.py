"""Directions: the lines of a script that are not commands. All are parsed before the script starts."""

import difflib
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from imgui_bundle import imgui

from ntc.errors import InputError
from viewer.commands.command import typed_path
from viewer.commands.effects import Effect, TakeFilm, TakePicture
from viewer.commands.keys import Chord, parse_chord
from viewer.script.host import PROPERTIES, ScriptHost, Turn, expect
from viewer.ui.picture_input import imgui_key
from viewer.ui.user_interface import SETTLING_FRAMES

LAYOUT_FRAMES = 16
"""Number of frames within which panels come to the front."""
LABELS_SHOWN = 3
MODIFIER_KEYS = {"Ctrl": imgui.Key.mod_ctrl, "Shift": imgui.Key.mod_shift, "Alt": imgui.Key.mod_alt}


def rest() -> Iterator[Turn]:
    """Yield the frames that the layout needs after an event."""
    for _ in range(SETTLING_FRAMES):
        yield "frame"


def opened(host: ScriptHost) -> Iterator[Turn]:
    """Yield the next frame, and then wait until all files are open."""
    yield "frame"
    while host.is_opening:
        yield "rest"


def hold(chord: Chord, down: bool) -> Iterator[Turn]:
    """Press a key with its modifiers where `down`; otherwise release them."""
    io = imgui.get_io()
    for is_held, modifier in zip((chord.ctrl, chord.shift, chord.alt), MODIFIER_KEYS.values(), strict=True):
        if is_held:
            io.add_key_event(modifier, down)
    io.add_key_event(imgui_key(chord.key), down)
    yield "frame"


def hold_modifier(name: str, down: bool) -> Iterator[Turn]:
    """Press one of MODIFIER_KEYS for the mouse where `down`; otherwise release it."""
    imgui.get_io().add_key_event(MODIFIER_KEYS[name], down)
    yield "frame"


def press(chord: Chord) -> Iterator[Turn]:
    """Press a key with its modifiers and release them."""
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


def click(label: str, host: ScriptHost) -> Iterator[Turn]:
    """Click on the widget `label` when its panel has come to the front, at most LAYOUT_FRAMES later. Raises InputError without it."""
    items = host.widgets
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
    """Turn the wheel; positive notches turn it away from the user."""
    imgui.get_io().add_mouse_wheel_event(0.0, notches)
    yield from rest()


def type_text(text: str) -> Iterator[Turn]:
    """Type into the active field."""
    imgui.get_io().add_input_characters_utf8(text)
    yield from rest()


Play = Callable[[ScriptHost], Iterator[Turn]]
"""Function that plays a line. It yields once for each frame that it needs, and while it waits. Raises InputError."""

MOST_FRAMES = 100_000
LONGEST_WAIT = 3600.0
SETTLING_SECONDS = 300.0
"""Longest wait for a complete picture, in seconds."""
RESIZING_SECONDS = 5.0
"""Longest wait for the requested size of the window, in seconds."""
SMALLEST_SIDE, LARGEST_SIDE = 64, 8192
BUTTONS = {"left": 0, "right": 1, "middle": 2}


@dataclass(frozen=True)
class Direction:
    """Kind of stage direction."""

    usage: str
    help: str
    fewest: int
    """Least number of arguments."""
    most: int
    read: Callable[[Sequence[str]], Play]
    """Function that returns the `Play` of the arguments. Raises InputError."""


def _number(text: str, low: float, high: float) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not low <= number <= high:
        raise InputError(f"{text!r}: must be a number from {low:g} to {high:g}")
    return number


def _whole(text: str, low: int, high: int) -> int:
    if not text.isascii() or not text.isdigit() or not low <= int(text[:10]) <= high:
        raise InputError(f"{text!r}: must be a whole number from {low} to {high}")
    return int(text)


def _place(text: str) -> tuple[float, bool]:
    """Return the place of a text such as `120` or `50%`: (number, whether it is a share of the side)."""
    is_share = text.endswith("%")
    number = _number(text.removesuffix("%"), -LARGEST_SIDE, LARGEST_SIDE)
    return (number / 100.0, True) if is_share else (number, False)


def _pixels(place: tuple[tuple[float, bool], ...], host: ScriptHost) -> tuple[float, float]:
    x, y = (number * side if is_share else number for (number, is_share), side in zip(place, host.size, strict=True))
    return x, y


def _wait(arguments: Sequence[str]) -> Play:
    what = arguments[0]
    if what == "settled" and len(arguments) == 1:
        return _settle
    if what == "frames" and len(arguments) == 2:
        count = _whole(arguments[1], 1, MOST_FRAMES)
        return lambda _stage: _frames(count)
    if what == "seconds" and len(arguments) == 2:
        seconds = _number(arguments[1], 0.0, LONGEST_WAIT)
        return lambda _stage: _wait_seconds(seconds)
    if what == "trained" and len(arguments) == 1:
        return _trained
    raise InputError("wait: must be `wait frames N`, `wait seconds S`, `wait settled` or `wait trained`")


def _frames(count: int) -> Iterator[Turn]:
    for _ in range(count):
        yield "frame"


def _wait_seconds(seconds: float) -> Iterator[Turn]:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        yield "rest"


def _trained(host: ScriptHost) -> Iterator[Turn]:
    training = host.context.training
    if training.active is None and not training.saving and not training.log.runs:
        raise InputError("wait trained: no training has begun; training.encode begins a run")
    end = time.monotonic() + LONGEST_WAIT
    yield from rest()
    while training.active is not None or training.saving:
        if training.state == "paused":
            raise InputError("wait trained: the run is paused; training.resume continues it")
        if time.monotonic() > end:
            raise InputError(f"wait trained: the run had not ended after {LONGEST_WAIT:g} s; training.cancel ends it")
        yield "rest"
    yield from rest()


def _settle(host: ScriptHost) -> Iterator[Turn]:
    end = time.monotonic() + SETTLING_SECONDS
    yield from rest()
    while not host.is_settled:
        if host.session.is_moving:
            raise InputError(
                "wait settled: the camera moves by itself, or an animation plays; camera.stop or animation.play ends that"
            )
        if time.monotonic() > end:
            raise InputError(f"wait settled: the picture was not complete after {SETTLING_SECONDS:g} s")
        yield "rest"
    yield from rest()


def _size(arguments: Sequence[str]) -> Play:
    width, _, height = arguments[0].lower().partition("x")
    size = _whole(width, SMALLEST_SIDE, LARGEST_SIDE), _whole(height, SMALLEST_SIDE, LARGEST_SIDE)

    def play(host: ScriptHost) -> Iterator[Turn]:
        host.resize(size)
        end = time.monotonic() + RESIZING_SECONDS
        yield "frame"
        while host.size != size:
            if time.monotonic() > end:
                raise InputError("size: the window system gave {}x{}".format(*host.size))
            yield "frame"
        yield from rest()

    return play


def _perform(effect: Effect, host: ScriptHost) -> Iterator[Turn]:
    host.context.perform(effect)
    yield "frame"


def _screenshot(arguments: Sequence[str]) -> Play:
    file = Path(arguments[0])
    if file.suffix.lower() != ".png":
        raise InputError(f"{arguments[0]!r}: must end with .png")
    return lambda host: _perform(TakePicture(file=file, quiet=True), host)


def _film(arguments: Sequence[str]) -> Play:
    file = None if arguments == ("end",) else Path(arguments[0])
    if file is not None and file.suffix.lower() != ".webp":
        raise InputError(f"{arguments[0]!r}: must end with .webp, or be `end`")
    return lambda host: _perform(TakeFilm(file), host)


def _drop(arguments: Sequence[str]) -> Play:
    paths = [typed_path(text) for text in arguments]

    def play(host: ScriptHost) -> Iterator[Turn]:
        host.open_files(paths)
        yield from opened(host)

    return play


def _key(arguments: Sequence[str]) -> Play:
    chord = parse_chord(arguments[0])
    return lambda _stage: press(chord)


def _held(arguments: Sequence[str], down: bool) -> Play:
    modifier = arguments[0].capitalize()
    if modifier in MODIFIER_KEYS:
        return lambda _stage: hold_modifier(modifier, down)
    chord = parse_chord(arguments[0])
    return lambda _stage: hold(chord, down)


def _click(arguments: Sequence[str]) -> Play:
    label = " ".join(arguments)
    return lambda host: click(label, host)


def _move(arguments: Sequence[str]) -> Play:
    place = tuple(_place(text) for text in arguments)
    return lambda host: move(*_pixels(place, host))


def _drag(arguments: Sequence[str]) -> Play:
    start, end = (tuple(_place(text) for text in arguments[first : first + 2]) for first in (0, 2))
    name = arguments[4] if len(arguments) == 5 else "left"
    if name not in BUTTONS:
        raise InputError(f"{name!r}: must be one of {', '.join(BUTTONS)}")
    return lambda host: drag(_pixels(start, host), _pixels(end, host), BUTTONS[name])


def _wheel(arguments: Sequence[str]) -> Play:
    notches = _number(arguments[0], -100.0, 100.0)
    return lambda _stage: wheel(notches)


def _type(arguments: Sequence[str]) -> Play:
    text = " ".join(arguments)
    return lambda _stage: type_text(text)


def _expect(arguments: Sequence[str]) -> Play:
    name, value = arguments[0], " ".join(arguments[1:])
    if name not in PROPERTIES:
        raise InputError(f"{name!r}: must be one of {', '.join(PROPERTIES)}")

    def play(host: ScriptHost) -> Iterator[Turn]:
        expect(name, value, host)
        return iter(())

    return play


MANY = 1000
DIRECTIONS = {
    "wait": Direction(
        "wait frames N | seconds S | settled | trained",
        "draw N frames; or wait S seconds, until the picture is complete, or until the run has ended and its pack is written",
        1,
        2,
        _wait,
    ),
    "size": Direction("size WIDTHxHEIGHT", "give the window's content this size in pixels", 1, 1, _size),
    "screenshot": Direction("screenshot FILE", "save the window as a PNG, without a message", 1, 1, _screenshot),
    "film": Direction(
        "film FILE | end",
        "write the window from here to `film end` as an animated WebP, up to 10 pictures per second",
        1,
        1,
        _film,
    ),
    "drop": Direction("drop FILE ...", "drop files on the window", 1, MANY, _drop),
    "key": Direction("key KEY", "press and release a key, e.g. `Ctrl+P`", 1, 1, _key),
    "hold": Direction(
        "hold KEY", "press a key, or a modifier for the mouse, e.g. `Ctrl`", 1, 1, partial(_held, down=True)
    ),
    "release": Direction("release KEY", "release a key", 1, 1, partial(_held, down=False)),
    "click": Direction("click LABEL", "click on the widget of this label", 1, MANY, _click),
    "move": Direction("move X Y", "move the mouse; pixels, or per cent of the window as `50%`", 2, 2, _move),
    "drag": Direction("drag X0 Y0 X1 Y1 [BUTTON]", "drag with the left, right or middle button", 4, 5, _drag),
    "wheel": Direction("wheel N", "turn the mouse wheel", 1, 1, _wheel),
    "type": Direction("type TEXT", "type into the active field", 1, MANY, _type),
    "expect": Direction(
        "expect PROPERTY VALUE", "stop with an error unless the property has this value", 2, MANY, _expect
    ),
}
"""Directions by their first word. It has no dot, whereas the id of every command has one."""


def direction_table_markdown() -> str:
    """Return the table of stage directions for docs/reference/commands.md."""
    rows = [f"| `{d.usage.replace('|', chr(92) + '|')}` | {d.help} |" for d in DIRECTIONS.values()]
    return "\n".join(["| direction | what it does |", "|---|---|", *rows])
