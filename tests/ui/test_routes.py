"""Every command is reached by key, menu, palette and script, with the arguments that were chosen there."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from imgui_bundle import imgui

from tests.ui.conftest import SIZE
from viewer.app.headless import HeadlessApp
from viewer.commands import COMMANDS, bindings
from viewer.commands.chords import Chord
from viewer.commands.command import Command
from viewer.scene.model import Camera, Scene
from viewer.script.inputs import press
from viewer.script.parse import parse_script
from viewer.state.pack_files import open_packs, packs_beside
from viewer.state.session import Session

Seen = list[tuple[str, tuple[str, ...]]]


@pytest.fixture(scope="module")
def shared(scene: Scene, scene_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[HeadlessApp]:
    """One app for all: what reaches a command here is noted and not carried out."""
    made = HeadlessApp(scene, open_packs(packs_beside(scene_path)), SIZE, tmp_path_factory.mktemp("pictures"))
    made.session.keep_bookmarks({"here": Camera("here", (0.0, 0.0, 2.0), (0.0, 0.0, 0.0))})
    made.session.scene = replace(scene, cameras=scene.cameras or tuple(made.session.bookmarks.values()))
    made.settle()
    yield made
    made.close()


@pytest.fixture
def seen(shared: HeadlessApp) -> Iterator[Seen]:
    """What was reached."""
    reached: Seen = []
    shared.session.use_commands(lambda command_id, arguments, _session: reached.append((command_id, arguments)))
    yield reached
    shared.session.palette = None
    shared.session.toasts = ()
    shared.move(SIZE[0] - 1.0, SIZE[1] - 1.0)
    shared.settle()


def chosen(command: Command, session: Session) -> tuple[str, ...]:
    """Something to tell a command: the last choice of each list, and what can be typed."""
    typed = {"text": "a name", "path": "a-file.png", "number": "0.25", "whole": "2"}
    return tuple(p.options(session)[-1] if p.kind == "choice" else typed[p.kind] for p in command.parameters)


def press_chord(app: HeadlessApp, chord: Chord) -> None:
    for _ in press(chord):
        app.frame()


every_command = pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.id)


@every_command
def test_by_script(shared: HeadlessApp, seen: Seen, command: Command) -> None:
    arguments = chosen(command, shared.session)
    quoted = " ".join(f"'{argument}'" for argument in arguments)
    shared.play(parse_script(f"{command.id} {quoted}", "line"))
    assert seen == [(command.id, arguments)]


@every_command
def test_by_palette(shared: HeadlessApp, seen: Seen, command: Command) -> None:
    arguments = chosen(command, shared.session)
    shared.session.palette = ""
    shared.frame(2)
    for text in (command.id, *arguments):
        imgui.get_io().add_input_characters_utf8(text)
        shared.frame(2)
        shared.key(imgui.Key.enter, True)
        shared.key(imgui.Key.enter, False)
        shared.frame()
    assert seen == [(command.id, arguments)]
    assert shared.session.palette is None


@every_command
def test_by_menu(shared: HeadlessApp, seen: Seen, command: Command) -> None:
    arguments = chosen(command, shared.session)
    shared.click(f"menu: {command.menu}")
    if not command.needs_arguments:
        shared.click(f"menu: {command.id}")
        assert seen == [(command.id, ())]
        return
    if any(parameter.kind != "choice" for parameter in command.parameters):
        # The menu hands over to the palette, which asks.
        shared.click(f"menu: {command.id}")
        assert (seen, shared.session.palette) == ([], command.id)
        return
    for count in range(len(arguments) + 1):
        shared.click("menu: " + " ".join((command.id, *arguments[:count])))
    assert seen == [(command.id, arguments)]


@pytest.mark.parametrize(
    ("command", "chord"),
    [(command, chord) for command in COMMANDS for chord in bindings({}).chords.get(command.id, ())],
    ids=lambda value: value.id if isinstance(value, Command) else str(value),
)
def test_by_key(shared: HeadlessApp, seen: Seen, command: Command, chord: Chord) -> None:
    press_chord(shared, chord)
    assert seen == [(command.id, ())]


def test_a_key_with_other_modifiers_does_nothing(shared: HeadlessApp, seen: Seen) -> None:
    press_chord(shared, Chord("F", ctrl=True, alt=True))
    press_chord(shared, Chord("F", shift=True))
    assert seen == []


def test_a_click_beside_the_palette_and_escape_close_it(shared: HeadlessApp, seen: Seen) -> None:
    for close in (lambda: shared.click_at(5.0, SIZE[1] - 5.0), lambda: shared.press(imgui.Key.escape)):
        shared.session.palette = ""
        shared.settle()
        close()
        assert shared.session.palette is None
    assert seen == []


def test_the_palette_is_gone_through_with_arrows_and_the_mouse(shared: HeadlessApp, seen: Seen) -> None:
    shared.session.palette = "compare.mode"
    shared.settle()
    shared.press(imgui.Key.down_arrow)
    shared.press(imgui.Key.enter)
    assert seen == [("compare.mode", ("b",))]
    shared.session.palette = ""
    shared.settle()
    shared.type("frame all")
    shared.click("palette: camera.frame-all")
    assert seen[1:] == [("camera.frame-all", ())]


def test_the_palette_says_what_does_not_fit(shared: HeadlessApp, seen: Seen) -> None:
    shared.session.palette = "overlay.opacity"
    shared.settle()
    for text in ("", "much"):
        shared.type(text)
        shared.press(imgui.Key.enter)
        assert shared.session.palette == "overlay.opacity"
    shared.session.palette = ""
    shared.settle()
    shared.type("zzzz")
    shared.press(imgui.Key.enter)
    assert shared.session.palette == ""
    assert seen == []


def test_the_key_sheet_is_searched_and_closed(shared: HeadlessApp, seen: Seen) -> None:
    shared.session.show_help = True
    shared.settle()
    shared.type("divergence")
    assert "search keys" in shared.frontend.interface.items.labels()
    shared.press(imgui.Key.escape)
    assert not shared.session.show_help
    assert seen == []
