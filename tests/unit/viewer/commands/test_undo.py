"""Undo and redo: what a command changed is put back, and nothing else."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest

from ntc.errors import InputError
from tests.support.spoilt_files import accept, finished, open_context, write_scene
from viewer.commands import run, run_line, run_or_notify, why_not
from viewer.commands.command import Context


@pytest.fixture
def context(tmp_path: Path) -> Context:
    return open_context(write_scene(tmp_path))


def test_the_last_change_is_undone_and_done_again(context: Context) -> None:
    session = context.session
    before = session.view, session.settings, session.resolution
    with pytest.raises(InputError, match="there is nothing to undo"):
        run_line(context, "edit.undo")
    run_line(context, "compare.mode side-by-side")
    run_line(context, "window.theme light")
    run_line(context, "view.resolution 0.5")
    run_line(context, "texture.select 1")
    after = session.view, session.settings, session.resolution
    for _ in range(4):
        run_line(context, "edit.undo")
    assert (session.view, session.settings, session.resolution) == before
    assert session.inspection.selected_texture is None
    assert "nothing to undo" in why_not(context, "edit.undo")
    for _ in range(4):
        run_line(context, "edit.redo")
    assert (session.view, session.settings, session.resolution) == after
    assert session.inspection.selected_texture == 1
    run_line(context, "edit.undo")
    run_line(context, "window.theme dark")
    with pytest.raises(InputError, match="nothing was undone"):
        run_line(context, "edit.redo")


def test_a_drag_is_one_change(context: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    session, now = context.session, [100.0]
    monkeypatch.setattr("viewer.commands.history.monotonic", lambda: now[0])
    begin = session.view.wipe_position
    for step in range(10):
        now[0] += 0.1
        run(context, "compare.divider", 0.1 + step / 20)
    now[0] += 2.0
    run(context, "compare.divider", 0.9)
    run_line(context, "edit.undo")
    assert session.view.wipe_position == pytest.approx(0.55)
    run_line(context, "edit.undo")
    assert session.view.wipe_position == begin


def test_what_changes_nothing_that_can_be_undone_is_not_looked_through(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    walked: list[object] = []

    def walk(value: Any) -> Any:
        walked.append(value)
        return fields(value)

    monkeypatch.setattr("viewer.commands.history.fields", walk)
    for step in range(10):
        run(context, "picture.hover", (step / 10.0, 0.5))
    assert walked == []
    assert "nothing to undo" in why_not(context, "edit.undo")
    run_line(context, "window.theme light")
    assert walked == [context.session.settings], "the view is the same object as before"
    run_line(context, "edit.undo")
    assert context.session.settings.theme == "dark"


def test_what_other_hands_changed_since_stays(context: Context) -> None:
    session = context.session
    run_line(context, "compare.mode b")
    session.view = replace(session.view, anisotropy=16)
    run_line(context, "edit.undo")
    assert (session.view.compare, session.view.anisotropy) != ("b", 1)
    assert session.view.anisotropy == 16


def test_discarding_a_run_can_be_undone(context: Context, tmp_path: Path) -> None:
    session = context.session
    context.training.enter(session.scene)
    pack = finished(context)
    run_line(context, "slot.source a 'run 1'")
    run_line(context, "training.discard")
    assert "run 1" not in session.packs
    run_line(context, "edit.undo")
    assert session.packs["run 1"] is pack
    assert session.view.slot_a.source == "run 1"
    assert context.training.log.undecided == 1
    run_line(context, "edit.redo")
    assert "run 1" not in session.packs
    assert context.training.log.undecided is None
    run_line(context, "edit.undo")
    accept(context)
    assert (tmp_path / "scene.random.ntc").is_file()


def test_nothing_is_undone_in_another_scene(context: Context, tmp_path: Path) -> None:
    run_line(context, "compare.mode b")
    (tmp_path / "other").mkdir()
    run_or_notify(context, "file.open", write_scene(tmp_path / "other", 1))
    assert "nothing to undo" in why_not(context, "edit.undo")


def test_a_slot_does_not_go_back_to_what_is_closed(context: Context) -> None:
    session = context.session
    run_line(context, "slot.source a reference")
    session.packs = {}
    run_line(context, "edit.undo")
    assert session.view.slot_a.source == "reference"
