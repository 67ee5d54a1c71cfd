"""Scripts, saved views and command lines of any content: read, or refused by one line."""

import json
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from ntc.errors import InputError
from tests.support.scenes import REACHING_OUT, example_view
from viewer.commands import COMMANDS, run_line
from viewer.commands.command import Context
from viewer.locations import assets_folder
from viewer.scene.load import load_scene
from viewer.script.directions import DIRECTIONS
from viewer.script.script import parse_script
from viewer.state.open_files import InitialView, new_session
from viewer.state.settings import ViewerSettings
from viewer.state.view_file import parse_view, view_json

SCENE = load_scene(assets_folder() / "courtyard.glb")
SAVED = example_view(new_session(SCENE, {}, ViewerSettings(), InitialView()))
HARMLESS = [command for command in COMMANDS if not command.id.startswith(REACHING_OUT)]
WORDS = st.one_of(
    st.sampled_from([*(command.id for command in HARMLESS), *DIRECTIONS, "a", "b", "on", "0.5", "-1", "1e400", "nan"]),
    st.text(max_size=12),
)
LINES = st.lists(WORDS, max_size=6).map(" ".join)
VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8)),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=8), inner, max_size=4)),
    max_leaves=12,
)


def one_line(error: InputError) -> None:
    assert str(error)
    assert "\n" not in str(error)


@given(text=st.one_of(st.text(max_size=200), st.lists(LINES, max_size=8).map("\n".join)))
@settings(max_examples=300, deadline=None)
def test_any_script_is_read_or_refused(text: str) -> None:
    try:
        parse_script(text, "any.script")
    except InputError as error:
        one_line(error)


@given(lines=st.lists(LINES, max_size=6))
@settings(max_examples=200, deadline=None)
def test_any_command_runs_or_is_refused(lines: list[str]) -> None:
    context = Context(new_session(SCENE, {}, ViewerSettings(), InitialView()))
    for line in lines:
        if any(line.split()[:1] == [command.id] for command in COMMANDS if command not in HARMLESS):
            continue
        try:
            run_line(context, line)
        except InputError as error:
            one_line(error)


@given(path=st.lists(st.integers(0, 30), min_size=1, max_size=4), value=VALUES)
@settings(max_examples=300, deadline=None)
def test_a_view_with_any_field_replaced_is_read_or_refused(path: list[int], value: Any) -> None:
    content = json.loads(view_json(SAVED))
    place: Any = content
    for number in path[:-1]:
        inner = [
            entry for entry in (place.values() if isinstance(place, dict) else place) if isinstance(entry, dict | list)
        ]
        if not inner:
            break
        place = inner[number % len(inner)]
    keys = list(place) if isinstance(place, dict) else list(range(len(place)))
    if keys:
        place[keys[path[-1] % len(keys)]] = value
    try:
        parse_view(json.dumps(content), "any view", SAVED)
    except InputError as error:
        one_line(error)
