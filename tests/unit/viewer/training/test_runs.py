"""Runs belong to their scene, are accepted only over files that are as they were, and outlive their window."""

import errno
import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.grid.model import grid_parts
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.pack.file import read_pack, write_pack
from tests.support.spoilt_files import (
    SECONDS,
    PromptEffects,
    Spoil,
    accept,
    emptied,
    errors,
    finished,
    garbage,
    open_context,
    pack_of,
    settle,
    truncated,
    write_scene,
)
from viewer import locations
from viewer.commands import run_line, run_or_notify
from viewer.commands.command import Context
from viewer.state.event_handlers import apply_event
from viewer.state.events import PackRenamed
from viewer.state.open_files import open_scene, read_scene
from viewer.state.pack_files import packs_beside
from viewer.training.kept_runs import FACTS_FILE, PACK_FILE, KeptRun, KeptRuns, scene_stamp
from viewer.training.preparation import EncodeScene
from viewer.training.run_keeper import save_numbered
from viewer.training.settings import TrainingSettings


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


def same_latents(file: Path, pack: Pack) -> None:
    """The first texture of `file` is that of `pack`."""
    np.testing.assert_array_equal(grid_parts(read_pack(file)).textures[0].latents, grid_parts(pack).textures[0].latents)


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
    same_latents(path.with_name("scene.random.ntc"), pack)
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
        assert "run 1: retrain 1 group (0), done" in question.text
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


def test_a_pack_is_not_written_where_another_scene_would_open_it(context: Context, path: Path, other: Path) -> None:
    finished(context)
    before = packs_in(other)
    for name in (f"{other.stem}.ntc", f"{other.stem}.random.ntc", packs_beside(other)[0].name):
        run_or_notify(context, "training.accept", other.with_name(name))
        settle(context)
        assert f"would open with {other.name}" in errors(context)[-1]
    assert packs_in(other) == before
    assert context.session.window.question is None
    # A name that no scene there has is free.
    accept(context, other.with_name("kept.ntc"))
    assert other.with_name("kept.ntc").is_file()


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


def test_a_pack_that_is_as_it_was_opened_is_replaced(context: Context, path: Path) -> None:
    pack, file = finished(context), path.with_name("scene.single.ntc")
    accept(context, file)
    assert errors(context) == []
    same_latents(file, pack)
    assert context.training.log.undecided is None
    # What was written last is known too.
    finished(context, 8)
    accept(context, file)
    assert errors(context) == []


@pytest.mark.parametrize("spoil", [emptied, garbage, truncated], ids=lambda spoil: spoil.__name__)
def test_a_pack_that_others_have_changed_is_not_replaced(context: Context, path: Path, spoil: Spoil) -> None:
    pack, file = finished(context), path.with_name("scene.single.ntc")
    spoil(file)
    changed = file.read_bytes()
    accept(context, file)
    assert len(errors(context)) == 1
    assert "has changed since it was opened" in errors(context)[0]
    assert file.read_bytes() == changed
    assert context.training.log.undecided == 1
    accept(context)
    written = path.with_name("scene.random.ntc")
    assert len(errors(context)) == 1
    same_latents(written, pack)


def test_another_pack_in_its_place_is_not_replaced(context: Context, path: Path) -> None:
    finished(context)
    file = path.with_name("scene.single.ntc")
    write_pack(file, pack_of(path, 3))
    changed = file.read_bytes()
    accept(context, file)
    assert "has changed since it was opened" in errors(context)[0]
    assert file.read_bytes() == changed
    # Opened again, it is what the user knows.
    run_or_notify(context, "file.open", file)
    accept(context, file)
    assert len(errors(context)) == 1
    assert file.read_bytes() != changed


def test_a_pack_that_is_gone_is_written_anew(context: Context, path: Path) -> None:
    finished(context)
    file = path.with_name("scene.single.ntc")
    file.unlink()
    accept(context, file)
    assert errors(context) == []
    assert read_pack(file).textures


def test_the_scene_folder_is_gone(context: Context, path: Path, tmp_path: Path) -> None:
    finished(context)
    scene_folder = path.parent
    shutil.rmtree(scene_folder)
    scene_folder.write_text("a file")
    accept(context)
    assert len(errors(context)) == 1
    assert context.training.log.undecided == 1
    scene_folder.unlink()
    accept(context, tmp_path / "other" / "pack.ntc")
    assert (tmp_path / "other" / "pack.ntc").is_file()


def test_accepting_onto_a_full_disk(context: Context, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    finished(context)
    fsync = os.fsync

    def full(_handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    before = sorted(path.parent.iterdir())
    accept(context)
    assert len(errors(context)) == 1
    assert "No space left on device" in errors(context)[0]
    assert sorted(path.parent.iterdir()) == before
    assert context.training.log.undecided == 1
    assert context.training.log[1].pack is not None
    monkeypatch.setattr(os, "fsync", fsync)
    accept(context, path.with_name("elsewhere.ntc"))
    assert read_pack(path.with_name("elsewhere.ntc")).textures
    assert context.training.log.undecided is None


KILLED = """
import os, signal, sys
from pathlib import Path
from tests.support.spoilt_files import PromptEffects
from tests.support.spoilt_files import pack_of
from tests.unit.viewer.training.test_runs import facts_of
from viewer.training.kept_runs import KeptRuns
kept, scene = KeptRuns(Path(sys.argv[1])), Path(sys.argv[2])
kept.write(kept.new_key(), pack_of(scene, 5), facts_of(scene))
assert not KeptRuns(Path(sys.argv[1])).waiting(), "while its window is open, a run is its own"
os.kill(os.getpid(), signal.SIGKILL)
"""


def facts_of(scene: Path) -> KeptRun:
    stamp = scene_stamp(scene)
    return KeptRun(
        "scene", str(scene.resolve()), stamp, "retrain 1 group (0)", "quick", "done", 2, 1.0, 30.0, 2, time.time()
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "data" / "runs"


def window(path: Path, folder: Path) -> Context:
    """A window on a scene, as it is after its first frame."""
    opened = open_context(path)
    context = Context(opened.session, kept=KeptRuns(folder))
    PromptEffects(context)
    context.training.tick(context.session.scene, frozenset())
    return context


def end_run(context: Context, seed: int = 7) -> None:
    """A training has ended, and is kept."""
    finished(context, seed)
    training = context.training
    training._keeper.keep(training.log.undecided_run(), context.session.scene)
    wait_until_written(context)


def wait_until_written(context: Context) -> None:
    began = time.monotonic()
    while context.training._keeper.busy:
        context.training.tick(context.session.scene, frozenset(), context.session.packs)
        assert time.monotonic() - began < SECONDS
        time.sleep(0.005)


def messages(context: Context) -> str:
    return "\n".join(entry.text for entry in context.session.window.log)


def waiting(context: Context) -> list[int]:
    return [run.number for run in context.training.waiting.runs]


def test_a_run_of_a_killed_window_is_found_again(path: Path, folder: Path) -> None:
    ended = subprocess.run([sys.executable, "-c", KILLED, str(folder), str(path)], check=False)
    assert ended.returncode == -signal.SIGKILL
    context = window(path, folder)
    assert "undecided runs of an earlier session: scene run 2" in messages(context)
    run_line(context, "training.kept-back open")
    assert context.session.view.slot_a.source == "run 1"
    assert context.training.log.undecided == 1
    accept(context)
    written = read_pack(path.with_name("scene.random.ntc"))
    np.testing.assert_array_equal(
        grid_parts(written).textures[0].latents, grid_parts(pack_of(path, 5)).textures[0].latents
    )
    assert list(folder.iterdir()) == []


def test_a_window_that_is_closed_at_once_leaves_its_runs_and_a_decided_one_leaves_none(
    path: Path, folder: Path
) -> None:
    first = window(path, folder)
    end_run(first)
    second = window(path, folder)
    assert waiting(second) == []
    run_line(first, "window.close")
    first.training.close()
    third = window(path, folder)
    assert waiting(third) == [1]
    run_line(third, "training.kept-back keep")
    assert path.with_name("scene.random.ntc").is_file()
    assert list(folder.iterdir()) == []
    end_run(third, 8)
    run_line(third, "training.discard")
    assert list(folder.iterdir()) == []


def test_a_run_goes_to_one_of_two_windows(path: Path, folder: Path) -> None:
    first = window(path, folder)
    end_run(first)
    first.training.close()
    second, third = window(path, folder), window(path, folder)
    assert waiting(second) == waiting(third) == [1]
    run_line(second, "training.kept-back open")
    for action in ("open", "keep"):
        run_or_notify(third, "training.kept-back", action)
    assert "is open in another window" in errors(third)[0]
    assert "there is no unsaved run" in errors(third)[1]
    assert sorted(file.name for file in path.parent.glob("*.ntc")) == ["scene.single.ntc"]


def test_a_run_goes_back_to_its_own_scene_alone(path: Path, folder: Path, tmp_path: Path) -> None:
    first = window(path, folder)
    end_run(first)
    first.training.close()
    (tmp_path / "other").mkdir()
    other = write_scene(tmp_path / "other", 1)
    second = window(other, folder)
    finished(second)
    run_line(second, "training.kept-back open")
    assert second.session.scene.path == other
    run_or_notify(second, "question.answer", "Keep")
    assert second.session.scene.path == path
    assert second.session.view.slot_a.source == "run 2"
    settle(second)
    assert sorted(file.name for file in other.parent.glob("*.ntc")) == ["scene.random.ntc", "scene.single.ntc"]
    assert sorted(file.name for file in path.parent.glob("*.ntc")) == ["scene.single.ntc"]


def test_a_scene_that_has_changed_gets_no_pack_of_its_earlier_self(path: Path, folder: Path, tmp_path: Path) -> None:
    first = window(path, folder)
    end_run(first)
    first.training.close()
    # Other pictures, so that no texture is the same.
    (tmp_path / "other").mkdir()
    for file in write_scene(tmp_path / "other", 1).parent.iterdir():
        file.replace(path.parent / file.name)
    second = window(path, folder)
    run_or_notify(second, "training.kept-back", "keep")
    run_or_notify(second, "training.kept-back", "open")
    assert "has changed since" in errors(second)[0]
    assert "made for another scene" in errors(second)[1]
    assert waiting(second) == [1]
    assert sorted(file.name for file in path.parent.glob("*.ntc")) == ["scene.single.ntc"]


def test_what_cannot_be_written_when_the_window_closes_is_kept_back(
    path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    context = window(path, folder)
    end_run(context)

    def full(destination: Path, _pack: object) -> None:
        raise InputError(f"{destination}: cannot be written")

    monkeypatch.setattr("viewer.training.run_keeper.write_pack", full)
    effects = PromptEffects(context)
    run_line(context, "file.quit")
    run_or_notify(context, "question.answer", "Keep")
    assert effects.is_closing
    context.training.close()
    assert sorted(file.name for file in path.parent.glob("*.ntc")) == ["scene.single.ntc"]
    assert waiting(window(path, folder)) == [1]


def test_discarding_for_good_asks_first(path: Path, folder: Path) -> None:
    first = window(path, folder)
    end_run(first)
    first.training.close()
    second = window(path, folder)
    run_line(second, "training.kept-back discard")
    run_line(second, "window.dismiss")
    assert waiting(second) == [1]
    run_line(second, "training.kept-back discard")
    run_or_notify(second, "question.answer", "Discard")
    assert waiting(second) == []
    assert list(folder.iterdir()) == []


def test_what_is_no_run_is_passed_over_and_a_full_disk_is_said_once(path: Path, folder: Path) -> None:
    kept = KeptRuns(folder)
    key = kept.new_key()
    kept.write(key, pack_of(path), facts_of(path))
    kept.release(key)
    for spoilt in (FACTS_FILE, PACK_FILE):
        other = kept.new_key()
        kept.write(other, pack_of(path), replace(facts_of(path), number=9))
        (folder / other / spoilt).write_bytes(b"?") if spoilt == FACTS_FILE else (folder / other / spoilt).unlink()
        kept.release(other)
    assert [run.number for run in kept.waiting()] == [2]
    (folder.parent / "file").write_text("")
    context = window(path, folder.parent / "file" / "runs")
    end_run(context)
    end_run(context)
    assert [line for line in errors(context) if "runs will be lost" in line] == errors(context)
    assert len(errors(context)) == 1


@pytest.mark.process
def test_a_run_under_way_is_kept_as_far_as_it_is(path: Path, folder: Path) -> None:
    context = window(path, folder)
    training, scene = context.training, context.session.scene
    training.start(EncodeScene(TrainingSettings("baseline", texture_size=16)), scene, None)
    began = time.monotonic()
    while not (training.log.runs and not training._keeper.busy):
        training.tick(scene, frozenset(), context.session.packs)
        assert time.monotonic() - began < 100.0
        time.sleep(0.01)
    # It was killed here.
    (place,) = folder.iterdir()
    assert read_pack(place / PACK_FILE).textures
    training.close()
    assert [run.title for run in KeptRuns(folder).waiting()] == ["encode baseline"]


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of an installation's assets, of which the scene is the only one."""
    assets = tmp_path / "installed"
    assets.mkdir()
    write_scene(assets)
    monkeypatch.setattr(locations, "assets_folder", lambda: assets)
    monkeypatch.setattr(locations, "builtin_scene_path", lambda name="": assets / "scene.gltf")
    monkeypatch.setenv(locations.DATA_FOLDER_VARIABLE, str(tmp_path / "data"))
    return assets


def test_an_accepted_pack_lies_in_the_data_folder_and_is_opened_with_the_scene(installed: Path, tmp_path: Path) -> None:
    before = sorted(installed.iterdir())
    scene_path, packs = installed / "scene.gltf", tmp_path / "data" / "packs"
    context = open_context(scene_path)
    for _ in range(2):
        finished(context)
        accept(context)
    assert errors(context) == []
    assert sorted(installed.iterdir()) == before
    written = (packs / "scene.random-2.ntc", packs / "scene.random.ntc")
    assert packs_beside(scene_path) == (installed / "scene.single.ntc", *written)
    run_or_notify(context, "file.open", scene_path)
    assert {pack.path for pack in context.session.packs.values()} == set(packs_beside(scene_path))


def test_leaving_says_where_the_pack_is_kept(installed: Path, tmp_path: Path) -> None:
    context = open_context(installed / "scene.gltf")
    finished(context)
    other = tmp_path / "other"
    other.mkdir()
    run_or_notify(context, "file.open", write_scene(other, 1))
    question = context.session.window.question
    assert question is not None
    assert "in the data folder" in question.text
    run_or_notify(context, "question.answer", "Keep")
    settle(context)
    assert (tmp_path / "data" / "packs" / "scene.random.ntc").is_file()


def test_the_same_file_elsewhere_keeps_its_packs_beside_it(installed: Path, tmp_path: Path) -> None:
    copied = Path(shutil.copytree(installed, tmp_path / "copied")) / "scene.gltf"
    assert locations.packs_folder(copied) == copied.parent
