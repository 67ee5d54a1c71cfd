"""A run belongs to its scene, and nothing that was trained is lost without a question."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.grid.model import grid_parts
from ntc.pack.file import read_pack
from tests.support.spoilt_files import PromptEffects, accept, errors, finished, open_context, settle, write_scene
from viewer.commands import run_line, run_or_notify
from viewer.commands.command import Context
from viewer.state.event_handlers import apply_event
from viewer.state.events import PackRenamed
from viewer.state.open_files import open_scene, read_scene
from viewer.training.run_keeper import save_numbered


def scene_in(folder: Path, seed: int) -> Path:
    folder.mkdir()
    return write_scene(folder, seed)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return scene_in(tmp_path / "jungle", 0)


@pytest.fixture
def other(tmp_path: Path) -> Path:
    return scene_in(tmp_path / "bistro", 1)


@pytest.fixture
def context(path: Path) -> Context:
    return open_context(path)


def answer(context: Context, label: str) -> None:
    run_or_notify(context, "question.answer", label)


def packs_in(path: Path) -> list[str]:
    return sorted(file.name for file in path.parent.glob("*.ntc"))


def test_a_pack_is_written_beside_the_scene_that_it_was_trained_on(context: Context, path: Path, other: Path) -> None:
    pack = finished(context)
    run_or_notify(context, "file.open", other)
    assert context.session.scene.path == path
    answer(context, "Keep")
    assert context.session.scene.path == other
    settle(context)
    assert packs_in(other) == ["scene.single.ntc"]
    assert packs_in(path) == ["scene.random.ntc", "scene.single.ntc"]
    written = read_pack(path.with_name("scene.random.ntc"))
    np.testing.assert_array_equal(grid_parts(written).textures[0].latents, grid_parts(pack).textures[0].latents)
    assert set(context.session.packs) == {"random"}
    run_or_notify(context, "training.accept")
    assert "no finished run" in errors(context)[-1]


def test_a_scene_that_is_opened_behind_its_back_gets_no_pack(context: Context, path: Path, other: Path) -> None:
    finished(context)
    open_scene(context.session, read_scene(other))
    accept(context)
    run_or_notify(context, "training.show", 1, "a")
    assert "no finished run waits" in errors(context)[0]
    assert "no such run" in errors(context)[1]
    assert (packs_in(path), packs_in(other)) == (["scene.single.ntc"], ["scene.single.ntc"])


def test_cancel_leaves_all_as_it_is_and_discard_writes_nothing(context: Context, path: Path, other: Path) -> None:
    finished(context)
    for run_in_question in ("Cancel", "escape"):
        run_or_notify(context, "file.open", other)
        question = context.session.window.question
        assert question is not None
        assert "run 1: retrain group 0, done" in question.text
        if run_in_question == "Cancel":
            answer(context, "Cancel")
        else:
            run_line(context, "window.dismiss")
        assert context.session.window.question is None
        assert context.session.scene.path == path
        assert context.training.log.undecided == 1
    run_or_notify(context, "file.open", other)
    answer(context, "Discard")
    settle(context)
    assert context.session.scene.path == other
    assert packs_in(path) == ["scene.single.ntc"]


def test_a_scene_that_cannot_be_opened_ends_nothing(context: Context, path: Path, tmp_path: Path) -> None:
    finished(context)
    run_or_notify(context, "file.open", tmp_path / "absent.gltf")
    answer(context, "Discard")
    assert errors(context)
    assert context.session.scene.path == path
    assert context.training.log.undecided == 1


def test_a_run_that_is_being_accepted_is_not_asked_about(context: Context, path: Path, other: Path) -> None:
    finished(context)
    run_or_notify(context, "training.accept")
    run_or_notify(context, "file.open", other)
    assert context.session.window.question is None
    assert context.session.scene.path == other
    settle(context)
    assert packs_in(path) == ["scene.random.ntc", "scene.single.ntc"]
    assert set(context.session.packs) == {"random"}


def test_packs_that_are_written_at_once_replace_none_of_each_other(context: Context, path: Path) -> None:
    pack, place = finished(context), path.with_name("scene.random.ntc")
    with ThreadPoolExecutor(8) as pool:
        written = [saved.path for saved in pool.map(lambda _: save_numbered(place, pack), range(16))]
    assert len(set(written)) == 16
    assert all(file is not None and read_pack(file).textures for file in written)


def test_quitting_asks(context: Context, path: Path) -> None:
    effects = PromptEffects(context)
    run_line(context, "file.quit")
    assert effects.is_closing
    effects = PromptEffects(context)
    finished(context)
    run_line(context, "file.quit")
    assert not effects.is_closing
    answer(context, "Keep")
    assert effects.is_closing
    context.training.close()
    assert packs_in(path) == ["scene.random.ntc", "scene.single.ntc"]


def test_runs_get_other_numbers_in_every_scene(context: Context, other: Path) -> None:
    finished(context)
    run_or_notify(context, "file.open", other)
    answer(context, "Discard")
    finished(context)
    assert context.training.log.undecided == 2


def test_an_accepted_pack_is_open_under_the_name_that_it_would_have(context: Context, path: Path) -> None:
    finished(context)
    run_line(context, "slot.source a 'run 1'")
    accept(context)
    assert set(context.session.packs) == {"random", "scene.random"}
    assert context.session.view.slot_a.source == "scene.random"
    assert context.training.log[1].name == "scene.random"
    # A name that is taken stays whose it is.
    apply_event(context.session, PackRenamed("random", "scene.random"))
    assert set(context.session.packs) == {"random", "scene.random"}
    finished(context, 9)
    accept(context)
    assert set(context.session.packs) == {"random", "scene.random", "scene.random-2"}
    assert packs_in(path) == ["scene.random-2.ntc", "scene.random.ntc", "scene.single.ntc"]


def test_a_file_is_replaced_only_where_that_is_said(context: Context, path: Path) -> None:
    finished(context)
    file = path.with_name("scene.single.ntc")
    before = file.read_bytes()
    run_or_notify(context, "training.accept", file)
    answer(context, "Write scene.single-2.ntc")
    settle(context)
    assert file.read_bytes() == before
    assert read_pack(path.with_name("scene.single-2.ntc")).textures


def test_saved_views_are_numbered(context: Context, path: Path) -> None:
    for _ in range(3):
        run_line(context, "view.save")
    assert sorted(file.name for file in (path.parent / "pictures").iterdir()) == [
        "view-2.json",
        "view-3.json",
        "view.json",
    ]


def test_escape_closes_what_is_on_top_and_never_the_window(context: Context) -> None:
    session, effects = context.session, PromptEffects(context)
    run_line(context, "help.keys")
    session.inspection.flat_texture, session.inspection.pixel, session.inspection.selected_texture = 0, (0.5, 0.5), 1
    session.window.palette = ""
    states = []
    for _ in range(6):
        run_line(context, "window.dismiss")
        window, inspection = session.window, session.inspection
        shown = (window.palette, window.show_help or None, inspection.flat_texture, inspection.pixel)
        states.append(sum(value is not None for value in (*shown, inspection.selected_texture)))
    assert states == [4, 3, 2, 1, 0, 0]
    assert not effects.is_closing
