"""Commands are reached by key, menu, palette and script, with the arguments that were chosen there."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from imgui_bundle import imgui

from tests.support.driven_app import DrivenApp
from tests.ui.conftest import SIZE
from viewer.app import frontend
from viewer.commands import COMMANDS, bindings, run
from viewer.commands.command import Command, Context, Parameter
from viewer.commands.keys import Chord
from viewer.commands.menus import MENUS, ONLY_TYPED
from viewer.scene.model import AnimationFacts, Camera, Scene
from viewer.script import script as parse
from viewer.script.directions import press
from viewer.script.script import parse_script
from viewer.state.pack_files import open_packs, packs_beside
from viewer.state.session import Session
from viewer.state.settings import ViewerSettings

Seen = list[tuple[str, tuple[Any, ...]]]


@pytest.fixture(scope="module")
def shared(scene: Scene, scene_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[DrivenApp]:
    """One app for all: what reaches a command here is noted and not carried out."""
    made = DrivenApp(
        scene,
        open_packs(packs_beside(scene_path)),
        SIZE,
        tmp_path_factory.mktemp("pictures"),
        ViewerSettings(column_folded=False),
    )
    here = Camera("here", (0.0, 0.0, 2.0), (0.0, 0.0, 0.0))
    made.session.navigation.bookmarks = {made.session.scene_key: {"here": here}}
    cameras = scene.cameras or tuple(made.session.bookmarks.values())
    made.session.scene = replace(scene, cameras=cameras, animations=(AnimationFacts("move", 2.0),))
    made.settle()
    yield made
    made.close()


@pytest.fixture
def seen(shared: DrivenApp, monkeypatch: pytest.MonkeyPatch) -> Iterator[Seen]:
    """What was reached; gestures are carried out all the same."""
    reached: Seen = []

    def note(context: Context, command_id: str, *values: Any) -> None:
        if any(command.id == command_id for command in COMMANDS):
            reached.append((command_id, values))
        else:
            run(context, command_id, *values)

    monkeypatch.setattr(frontend, "run_or_notify", note)
    # What cannot run now is grey.
    monkeypatch.setattr(frontend, "why_not", lambda _context, _command_id: "")
    monkeypatch.setattr(parse, "run", note)
    yield reached
    shared.session.window.palette = None
    shared.session.window.toasts = ()
    shared.move(SIZE[0] - 1.0, SIZE[1] - 1.0)
    shared.settle()


def chosen(command: Command, session: Session) -> tuple[str, ...]:
    """Something to tell a command: the last choice of each list, and what can be typed."""
    typed = {str: "a name", Path: "a-file.png"}

    def text(parameter: Parameter) -> str:
        if parameter.is_choice:
            return [option for option in parameter.options(session) if not parameter.refusal(session, option)][-1]
        least = parameter.arg.minimum
        number = int(least or 2) if parameter.type is int else least or 0.25
        return typed.get(parameter.type, str(number))

    return tuple(text(parameter) for parameter in command.parameters)


def press_chord(app: DrivenApp, chord: Chord) -> None:
    for _ in press(chord):
        app.frame()


def shape(command: Command) -> tuple[object, ...]:
    """What commands are told apart by in palette and menu: kinds of parameters, and which of them must be given."""
    parts = ((part.type, part.is_choice, part.default_text is None) for part in command.parameters)
    return (command.is_switch, command.id in ONLY_TYPED, *parts)


SHAPES = {shape(command): command for command in COMMANDS}
"""A command of each shape."""
each_shape = pytest.mark.parametrize("command", SHAPES.values(), ids=lambda command: command.id)
CHORDS = {
    (chord.ctrl, chord.shift, chord.alt): (command, chord)
    for command in COMMANDS
    for chord in bindings({}).chords.get(command.id, ())
}
"""A command, and a chord of it, for each choice of modifiers."""


@each_shape
def test_by_script(shared: DrivenApp, seen: Seen, command: Command) -> None:
    arguments = chosen(command, shared.session)
    quoted = " ".join(f"'{argument}'" for argument in arguments)
    shared.play(parse_script(f"{command.id} {quoted}", "line"))
    assert seen == [(command.id, command.parse(arguments))]


@each_shape
def test_by_palette(shared: DrivenApp, seen: Seen, command: Command) -> None:
    arguments = chosen(command, shared.session)
    shared.session.window.palette = ""
    shared.frame(2)
    for text in (command.id, *arguments):
        imgui.get_io().add_input_characters_utf8(text)
        shared.frame(2)
        shared.key(imgui.Key.enter, True)
        shared.key(imgui.Key.enter, False)
        shared.frame()
    assert seen == [(command.id, command.parse(arguments))]
    assert shared.session.window.palette is None


def menu_of(command: Command) -> str | None:
    """The menu that a command is in."""
    return next((m for m, sections in MENUS.items() if any(command in part for part in sections)), None)


def test_every_command_is_in_a_menu_or_only_typed() -> None:
    assert {command.id for command in COMMANDS if menu_of(command) is None} == set(ONLY_TYPED)


@each_shape
def test_by_menu(shared: DrivenApp, seen: Seen, command: Command) -> None:
    menu = menu_of(command)
    if menu is None:
        return
    needed = [parameter for parameter in command.parameters if parameter.default_text is None]
    arguments = chosen(command, shared.session)[: len(needed)]
    shared.click(f"menu: {menu}")
    if command.is_switch:
        before = command.is_on(shared.session)
        shared.click(f"menu: {command.id}")
        assert seen == [(command.id, (not before,) if command.parameters else ())]
        return
    if not needed:
        shared.click(f"menu: {command.id}")
        assert seen == [(command.id, ())]
        return
    if not all(parameter.is_choice for parameter in needed):
        # The menu hands over to the palette, which asks.
        shared.click(f"menu: {command.id}")
        assert (seen, shared.session.window.palette) == ([], command.id)
        return
    for count in range(len(arguments) + 1):
        shared.click("menu: " + " ".join((command.id, *arguments[:count])))
    assert seen == [(command.id, command.parse(arguments))]


@pytest.mark.parametrize(("command", "chord"), CHORDS.values(), ids=lambda value: str(getattr(value, "id", value)))
def test_by_key(shared: DrivenApp, seen: Seen, command: Command, chord: Chord) -> None:
    press_chord(shared, chord)
    assert seen == [(command.id, ())]


def test_a_click_beside_the_palette_and_escape_close_it(shared: DrivenApp, seen: Seen) -> None:
    for close in (lambda: shared.click_at(5.0, SIZE[1] - 5.0), lambda: shared.press(imgui.Key.escape)):
        shared.session.window.palette = ""
        shared.settle()
        close()
        assert shared.session.window.palette is None
    assert seen == []


def test_the_palette_is_gone_through_with_arrows_and_the_mouse(shared: DrivenApp, seen: Seen) -> None:
    shared.session.window.palette = "compare.mode"
    shared.settle()
    shared.press(imgui.Key.down_arrow)
    shared.press(imgui.Key.enter)
    assert seen == [("compare.mode", ("b",))]
    shared.session.window.palette = ""
    shared.settle()
    shared.type("frame all")
    shared.click("palette: camera.frame-all")
    assert seen[1:] == [("camera.frame-all", ())]


def test_the_palette_says_what_does_not_fit(shared: DrivenApp, seen: Seen) -> None:
    shared.session.window.palette = "overlay.opacity"
    shared.settle()
    for text in ("", "much"):
        shared.type(text)
        shared.press(imgui.Key.enter)
        assert shared.session.window.palette == "overlay.opacity"
    shared.session.window.palette = ""
    shared.settle()
    shared.type("zzzz")
    shared.press(imgui.Key.enter)
    assert shared.session.window.palette == ""
    assert seen == []
