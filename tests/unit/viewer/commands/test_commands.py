"""The registry: text becomes calls or one clear line, keys, undo, and that nothing else changes the session."""

import re
from dataclasses import is_dataclass
from pathlib import Path
from typing import get_type_hints

import pytest

import viewer
from ntc.errors import InputError
from tests.support.spoilt_files import finished, open_context, write_scene
from viewer.commands import COMMANDS, bindings, run, run_line, run_or_notify, why_not
from viewer.commands.command import Context
from viewer.commands.keys import RESERVED, Chord, parse_chord
from viewer.locations import assets_folder
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.state.motion import Turntable
from viewer.state.open_files import InitialView, new_session
from viewer.state.session import Session
from viewer.state.settings import ViewerSettings


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene(assets_folder() / "courtyard.glb")


@pytest.fixture
def context(scene: Scene) -> Context:
    """The built-in scene without packs."""
    return Context(new_session(scene, {}, ViewerSettings(), InitialView()))


def test_ids_and_keys_are_unique_and_keys_need_no_arguments() -> None:
    ids = [command.id for command in COMMANDS]
    keys = [command.key for command in COMMANDS if command.key]
    assert len(set(ids)) == len(ids)
    assert len(set(keys)) == len(keys)
    for command in COMMANDS:
        assert "." in command.id
        assert command.id == command.id.lower()
        assert command.title
        assert command.help
        if command.key:
            assert all(parameter.default is not None for parameter in command.parameters)


def test_lines_run_commands(context: Context) -> None:
    run_line(context, "compare.mode wipe  # both")
    run_line(context, "compare.divider 0.25")
    run_line(context, "")
    run_line(context, "# nothing")
    assert (context.session.view.compare, context.session.view.wipe_position) == ("wipe", 0.25)
    run_line(context, "compare.divider")
    assert context.session.view.wipe_position == 0.5
    run_line(context, "slot.path b cached")
    assert context.session.view.slot_b.path == "cached"
    run_line(context, "camera.look 1 2 3 4 5 6")
    assert context.session.view.camera.eye == (1.0, 2.0, 3.0)
    for speed in (45.0, -45.0):
        run_line(context, f"camera.turntable {speed}")
        assert context.session.navigation.motion == Turntable(speed)


@pytest.mark.parametrize(
    ("line", "part"),
    [
        ("compare.mod a", "compare.mode"),
        ("nonsense", "no such command"),
        ("compare.mode", "lacks mode"),
        ("compare.mode c", "must be one of a, b, wipe"),
        ("compare.divider left", "must be a number"),
        ("compare.divider nan", "must be finite"),
        ("compare.divider inf", "must be finite"),
        ("compare.next 1", "at most 0"),
        ("slot.source a missing", "must be one of reference"),
        ("overlay.opacity 2", "0 to 1"),
        ("camera.look 0 0 0 0 0 0", "same place"),
        ("file.open 'unclosed", "no closing quotation"),
    ],
)
def test_what_does_not_fit_is_one_line(context: Context, line: str, part: str) -> None:
    before = context.session.view
    with pytest.raises(InputError, match=part) as caught:
        run_line(context, line)
    assert "\n" not in str(caught.value)
    assert context.session.view == before


def test_a_filter_is_of_one_slot_or_both_and_is_remembered(context: Context) -> None:
    run_line(context, "slot.filter b stochastic")
    assert [slot.filter for slot in context.session.view.slots.values()] == ["exact", "stochastic"]
    assert context.session.present_settings.texel_filter == "exact"
    run_line(context, "filter.texels stochastic")
    assert [slot.filter for slot in context.session.view.slots.values()] == ["stochastic", "stochastic"]
    assert context.session.present_settings.texel_filter == "stochastic"


def test_a_divider_beyond_the_edge_stays_at_the_edge(context: Context) -> None:
    run_line(context, "compare.divider 1.5")
    assert context.session.view.wipe_position == 1.0
    run(context, "compare.divider", -0.2)
    assert context.session.view.wipe_position == 0.0


def test_gestures_have_no_text_form_and_are_in_no_table(context: Context) -> None:
    camera = context.session.view.camera
    run_line(context, "camera.look 1 2 3 4 5 6")
    run(context, "camera.set", camera)
    assert context.session.view.camera == camera
    assert "camera.set" not in {command.id for command in COMMANDS}
    with pytest.raises(InputError, match="no such command"):
        run_line(context, "camera.set here")


def test_what_keeps_a_command_from_running_becomes_a_message(context: Context) -> None:
    run_or_notify(context, "overlay.opacity", 2.0)
    (entry,) = context.session.window.log
    assert (entry.kind, entry.text) == ("error", "overlay.opacity: opacity 2: must be 0 to 1")


def test_a_command_that_cannot_run_now_says_why(context: Context) -> None:
    with pytest.raises(InputError) as refused:
        run_line(context, "training.pause")
    assert str(refused.value) == f"training.pause: {why_not(context, 'training.pause')}"
    assert why_not(context, "training.encode") == ""


@pytest.mark.parametrize(
    ("text", "chord"),
    [
        ("f", Chord("F")),
        ("F12", Chord("F12")),
        ("ctrl+s", Chord("S", ctrl=True)),
        ("Shift+Ctrl+PageUp", Chord("PageUp", ctrl=True, shift=True)),
        ("?", Chord("/", shift=True)),
        ("Alt+-", Chord("-", alt=True)),
    ],
)
def test_chords(text: str, chord: Chord) -> None:
    assert parse_chord(text) == chord
    assert parse_chord(str(chord)) == chord


@pytest.mark.parametrize("text", ["", "+", "Ctrl+", "Hyper+S", "Ctrl+Ctrl+S", "F13", "SS", "Ctrl", "\u0130", "S+Ctrl"])
def test_what_is_no_key_is_one_line(text: str) -> None:
    with pytest.raises(InputError, match="no such key") as caught:
        parse_chord(text)
    assert "\n" not in str(caught.value)


def test_the_commands_own_keys_are_in_order() -> None:
    bound = bindings({})
    assert bound.problems == ()
    chords = [chord for chords in bound.chords.values() for chord in chords]
    assert len(set(chords)) == len(chords)
    assert not {str(chord) for chord in chords} & set(RESERVED)
    assert set(bound.chords) == {command.id for command in COMMANDS if command.key}


def test_a_key_is_changed_taken_away_and_exchanged() -> None:
    bound = bindings({"camera.frame-all": "Ctrl+Shift+F", "compare.measure": ""})
    assert bound.problems == ()
    assert bound.text("camera.frame-all") == "Ctrl+Shift+F"
    assert bound.text("compare.measure") == ""
    bound = bindings({"camera.frame-all": "M", "compare.measure": "F"})
    assert bound.problems == ()
    assert (bound.text("camera.frame-all"), bound.text("compare.measure")) == ("M", "F")
    assert bindings({"camera.go": "Ctrl+G"}).text("camera.go") == "Ctrl+G"


@pytest.mark.parametrize(
    ("keys", "parts"),
    [
        ({"camera.frame-all": "M"}, ("camera.frame-all", "M", "compare.measure")),
        ({"camera.go": "Ctrl+G", "camera.look": "Ctrl+G"}, ("camera.look", "Ctrl+G", "camera.go")),
        ({"camera.frame-all": "Space"}, ("camera.frame-all", "showing the other slot")),
        ({"camera.frame-all": "W"}, ("camera.frame-all", "flying")),
        ({"camera.frame-all": "Nonsense"}, ("camera.frame-all", "no such key")),
        ({"camera.no-such": "Ctrl+G"}, ("camera.no-such", "not a command")),
    ],
)
def test_what_is_refused_keeps_its_own_key(keys: dict[str, str], parts: tuple[str, ...]) -> None:
    bound = bindings(keys)
    (problem,) = bound.problems
    assert all(part in problem for part in parts)
    assert bound.text("camera.frame-all") == "F"
    assert bound.text("compare.measure") == "M"


@pytest.fixture
def written(tmp_path: Path) -> Context:
    return open_context(write_scene(tmp_path))


def test_the_last_change_is_undone_and_done_again(written: Context) -> None:
    session = written.session
    before = session.view, session.settings, session.resolution
    with pytest.raises(InputError, match="there is nothing to undo"):
        run_line(written, "edit.undo")
    run_line(written, "compare.mode side-by-side")
    run_line(written, "window.theme light")
    run_line(written, "view.resolution 0.5")
    run_line(written, "texture.select 1")
    after = session.view, session.settings, session.resolution
    for _ in range(4):
        run_line(written, "edit.undo")
    assert (session.view, session.settings, session.resolution) == before
    assert session.inspection.selected_texture is None
    assert "nothing to undo" in why_not(written, "edit.undo")
    for _ in range(4):
        run_line(written, "edit.redo")
    assert (session.view, session.settings, session.resolution) == after
    assert session.inspection.selected_texture == 1
    run_line(written, "edit.undo")
    run_line(written, "window.theme dark")
    with pytest.raises(InputError, match="there is nothing to redo"):
        run_line(written, "edit.redo")


def test_a_drag_is_one_change(written: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    session, now = written.session, [100.0]
    monkeypatch.setattr("viewer.commands.history.monotonic", lambda: now[0])
    begin = session.view.wipe_position
    for step in range(11):
        now[0] += 0.1
        run(written, "compare.divider", 0.1 + step / 20)
    now[0] += 2.0
    run(written, "compare.divider", 0.9)
    run_line(written, "edit.undo")
    assert session.view.wipe_position == pytest.approx(0.6)
    run_line(written, "edit.undo")
    assert session.view.wipe_position == begin


def test_undo_leaves_runs_alone(written: Context) -> None:
    written.training.enter(written.session.scene)
    finished(written)
    run_line(written, "training.discard")
    assert "run 1" not in written.session.packs
    assert "nothing to undo" in why_not(written, "edit.undo")


def test_nothing_is_undone_in_another_scene(written: Context, tmp_path: Path) -> None:
    run_line(written, "compare.mode b")
    (tmp_path / "other").mkdir()
    run_or_notify(written, "file.open", write_scene(tmp_path / "other", 1))
    assert "nothing to undo" in why_not(written, "edit.undo")


def test_a_slot_does_not_go_back_to_what_is_closed(written: Context) -> None:
    session = written.session
    run_line(written, "slot.source a reference")
    session.packs = {}
    run_line(written, "edit.undo")
    assert session.view.slot_a.source == "reference"


ROOT = Path(viewer.__file__).parent
WRITERS = ("commands", "state")
"""Packages whose functions are commands and event handlers."""
GROUPS = {name for name, kind in get_type_hints(Session).items() if is_dataclass(kind) and name != "view"}
FILES = [path for path in sorted(ROOT.rglob("*.py")) if path.relative_to(ROOT).parts[0] not in WRITERS]


SESSION = r"(?:\w+\.)*_?session"
CHANGE = r"\w+(?:\[[^\]]*\])?\s*[-+|&]?=(?!=)"


def writes(source: str) -> list[str]:
    """What assigns to an attribute of a session, of one of its groups or of a name for one, or calls setattr on it."""
    state = [rf"{SESSION}(?:\.(?:{'|'.join(GROUPS)}))?"]
    state += re.findall(rf"^\s*(\w+) = {SESSION}\.(?:{'|'.join(GROUPS)})$", source, re.MULTILINE)
    found = re.findall(rf"(?<![\w.])(?:{'|'.join(state)})\.{CHANGE}", source)
    return found + re.findall(rf"(?:set|del)attr\({SESSION}\b", source)


def test_only_commands_and_event_handlers_change_the_session() -> None:
    assert {"navigation", "inspection", "window"} <= GROUPS
    assert len(FILES) > 100
    found = {str(path.relative_to(ROOT)): lines for path in FILES if (lines := writes(path.read_text()))}
    assert found == {}
