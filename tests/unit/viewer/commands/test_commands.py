"""The registry: ids, keys and usage are in order, and text becomes calls or one clear line."""

from typing import Any

import pytest

from ntc.errors import InputError
from viewer.commands import COMMANDS, find_command, run, run_line, run_or_notify, why_not
from viewer.commands.command import Context, words
from viewer.locations import assets_folder
from viewer.scene.load import load_scene
from viewer.state.open_files import InitialView, new_session
from viewer.state.settings import ViewerSettings


@pytest.fixture
def context() -> Context:
    """The built-in scene without packs."""
    scene = load_scene(assets_folder() / "courtyard.glb")
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


def test_usage_shows_what_may_be_left_out() -> None:
    assert find_command("compare.divider").usage == "compare.divider [POSITION]"
    assert words("a 'b c' # d") == ["a", "b c"]


@pytest.mark.parametrize(
    ("line", "command_id", "values"),
    [
        ("overlay.opacity 2", "overlay.opacity", (2.0,)),
        ("compare.gain 0", "compare.gain", (0.0,)),
        ("compare.mode c", "compare.mode", ("c",)),
        ("slot.source a missing", "slot.source", ("a", "missing")),
        ("compare.divider nan", "compare.divider", (float("nan"),)),
        ("filter.anisotropy 3", "filter.anisotropy", (3,)),
        ("slot.filter a box", "slot.filter", ("a", "box")),
        ("filter.texels box", "filter.texels", ("box",)),
        ("window.ui-scale 9", "window.ui-scale", (9.0,)),
    ],
)
def test_values_of_widgets_are_checked_as_texts_are(
    context: Context, line: str, command_id: str, values: tuple[Any, ...]
) -> None:
    with pytest.raises(InputError) as typed:
        run_line(context, line)
    with pytest.raises(InputError) as given:
        run(context, command_id, *values)
    assert str(typed.value).replace("'", "") == str(given.value).replace("'", "")


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


def test_every_command_has_help_and_a_line_in_the_documentation() -> None:
    lines = (assets_folder().parent / "docs" / "reference" / "commands.md").read_text(encoding="utf-8")
    for command in COMMANDS:
        assert command.help, f"{command.id}: give it a line of help"
        assert f"| `{command.usage}` | {command.help} |" in lines, f"{command.id}: run: python -m lab.documentation"
