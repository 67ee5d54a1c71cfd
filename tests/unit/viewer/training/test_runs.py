"""Runs belong to their scene, replace no file, and outlive their window as autosaved packs."""

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

from ntc.codec.encoding import TimeBudget
from ntc.codec.grid.model import grid_parts
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.pack.file import read_pack
from tests.support.spoilt_files import (
    SECONDS,
    PromptEffects,
    emptied,
    errors,
    finished,
    garbage,
    keep,
    open_context,
    settle,
    write_scene,
)
from viewer import locations
from viewer.commands import run_line, run_or_notify
from viewer.commands.command import Context
from viewer.state.event_handlers import apply_event
from viewer.state.events import PackRenamed
from viewer.state.open_files import open_scene, read_scene
from viewer.state.pack_files import packs_beside
from viewer.training import run_store
from viewer.training.preparation import EncodeScene
from viewer.training.run_store import UnsavedRuns, save_numbered
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


def packs_in(path: Path) -> list[str]:
    return sorted(file.name for file in path.parent.glob("*.ntc"))


def test_a_pack_is_written_beside_the_scene_that_it_was_trained_on(context: Context, path: Path, other: Path) -> None:
    pack = finished(context)
    run_or_notify(context, "training.keep")
    run_or_notify(context, "file.open", other)
    assert context.session.scene.path == other
    settle(context)
    assert packs_in(other) == ["scene.single.ntc"]
    assert packs_in(path) == ["scene.random.ntc", "scene.single.ntc"]
    same_latents(path.with_name("scene.random.ntc"), pack)
    assert set(context.session.packs) == {"random"}
    run_or_notify(context, "training.keep")
    assert "there is no unsaved run" in errors(context)[-1]


def test_a_scene_that_is_opened_behind_its_back_gets_no_pack(context: Context, path: Path, other: Path) -> None:
    finished(context)
    open_scene(context.session, read_scene(other))
    context.training.tick(context.session.scene, frozenset())
    keep(context)
    run_or_notify(context, "training.show", 1, "a")
    assert "there is no unsaved run" in errors(context)[0]
    assert "no such run" in errors(context)[1]
    assert (packs_in(path), packs_in(other)) == (["scene.single.ntc"], ["scene.single.ntc"])


def test_packs_that_are_written_at_once_replace_none_of_each_other(context: Context, path: Path) -> None:
    pack, place = finished(context), path.with_name("scene.random.ntc")
    with ThreadPoolExecutor(8) as pool:
        written = [saved.path for saved in pool.map(lambda _: save_numbered(place, pack), range(16))]
    assert len(set(written)) == 16
    assert all(file is not None and read_pack(file).textures for file in written)


def test_the_slot_shows_the_pack_that_was_kept(context: Context, path: Path) -> None:
    finished(context)
    run_line(context, "slot.source a 'run 1'")
    keep(context)
    assert set(context.session.packs) == {"random", "scene.random"}
    assert context.session.view.slot_a.source == "scene.random"
    assert context.training.log[1].name == "scene.random"
    # A name that is taken stays whose it is.
    apply_event(context.session, PackRenamed("random", "scene.random"))
    assert set(context.session.packs) == {"random", "scene.random"}
    finished(context, 9)
    keep(context)
    assert set(context.session.packs) == {"random", "scene.random", "scene.random-2"}
    assert packs_in(path) == ["scene.random-2.ntc", "scene.random.ntc", "scene.single.ntc"]
    assert context.session.view.slot_a.source == "scene.random-2", "not the older pack of this grouping"
    finished(context, 10)
    run_or_notify(context, "training.keep", Path(), 2)
    assert f"run 2: is kept in {path.with_name('scene.random-2.ntc')}" in errors(context)[-1]


def test_no_file_is_replaced(context: Context, path: Path) -> None:
    pack, file = finished(context), path.with_name("scene.single.ntc")
    before = file.read_bytes()
    keep(context, file)
    assert file.read_bytes() == before
    same_latents(path.with_name("scene.single-2.ntc"), pack)


def test_a_pack_is_not_written_where_another_scene_would_open_it(context: Context, path: Path, other: Path) -> None:
    finished(context)
    before = packs_in(other)
    for name in (f"{other.stem}.ntc", f"{other.stem}.random.ntc", packs_beside(other)[0].name):
        keep(context, other.with_name(name))
        assert f"would open with {other.name}" in errors(context)[-1]
    assert packs_in(other) == before
    # A name that no scene there has is free.
    keep(context, other.with_name("elsewhere.ntc"))
    assert other.with_name("elsewhere.ntc").is_file()


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


def test_the_scene_folder_is_gone(context: Context, path: Path, tmp_path: Path) -> None:
    finished(context)
    scene_folder = path.parent
    shutil.rmtree(scene_folder)
    scene_folder.write_text("a file")
    keep(context)
    assert len(errors(context)) == 1
    assert context.training.log.chosen == 1
    scene_folder.unlink()
    keep(context, tmp_path / "other" / "pack.ntc")
    assert (tmp_path / "other" / "pack.ntc").is_file()


def test_keeping_onto_a_full_disk(context: Context, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    finished(context)
    fsync = os.fsync

    def full(_handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    before = sorted(path.parent.iterdir())
    keep(context)
    assert len(errors(context)) == 1
    assert "No space left on device" in errors(context)[0]
    assert sorted(path.parent.iterdir()) == before
    assert context.training.log.chosen == 1
    assert context.training.log[1].pack is not None
    monkeypatch.setattr(os, "fsync", fsync)
    keep(context, path.with_name("elsewhere.ntc"))
    assert read_pack(path.with_name("elsewhere.ntc")).textures
    assert context.training.log.chosen is None


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "data" / "runs"


def window(path: Path, folder: Path) -> Context:
    """A window on a scene, as it is after its first frame."""
    opened = open_context(path)
    context = Context(opened.session, unsaved=UnsavedRuns(folder))
    PromptEffects(context)
    context.training.tick(context.session.scene, frozenset())
    return context


def wait_until_written(context: Context) -> None:
    began = time.monotonic()
    while context.training._store.busy:
        context.training.tick(context.session.scene, frozenset(), context.session.packs)
        assert time.monotonic() - began < SECONDS
        time.sleep(0.005)


def end_run(context: Context, seed: int = 7) -> Pack:
    """A training has ended, and is autosaved."""
    pack, training = finished(context, seed), context.training
    run = training.log.runs[-1]
    training.log.change(replace(run, autosave=training._store.autosave(pack, context.session.scene, None)))
    wait_until_written(context)
    return pack


def messages(context: Context) -> str:
    return "\n".join(entry.text for entry in context.session.window.log)


def unsaved(context: Context) -> list[int]:
    return [run.number for run in context.training.log.unsaved_runs]


def autosaved(folder: Path) -> list[str]:
    return sorted(file.name.partition(".")[2] for file in folder.glob("*.ntc"))


KILLED = """
import os, signal, sys, time
from pathlib import Path
from tests.unit.viewer.training.test_runs import window
from viewer.training.preparation import EncodeScene
from viewer.training.settings import TrainingSettings, parse_budget
context = window(Path(sys.argv[1]), Path(sys.argv[2]))
training, scene = context.training, context.session.scene
settings = TrainingSettings("baseline", codec="grid", texture_size=16, budget=parse_budget("600s"))
training.start(EncodeScene(settings), scene, None)
while training.active.autosave is None or training._store.busy:
    training.tick(scene, frozenset(), context.session.packs)
    time.sleep(0.01)
os.kill(training.process_id, signal.SIGKILL)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.process
def test_the_last_snapshot_of_a_killed_window_is_listed(path: Path, folder: Path) -> None:
    arguments = [sys.executable, "-c", KILLED, str(path), str(folder)]
    assert subprocess.run(arguments, check=False).returncode == -signal.SIGKILL
    (file,) = folder.glob("*.ntc")
    context = window(path, folder)
    assert "1 unsaved run of this scene" in messages(context)
    assert context.training.log.chosen is None
    run_line(context, "training.show 1 a")
    assert context.session.view.slot_a.source == "run 1"
    pack = context.session.packs["run 1"]
    assert pack.training["ended_early"]
    assert context.training.log[1].psnr_db is None or context.training.log[1].psnr_db > 0.0
    written = file.read_bytes()
    keep(context)
    assert path.with_name("scene.baseline.ntc").read_bytes() == written
    assert autosaved(folder) == []


def test_a_closed_window_leaves_its_runs_to_the_next_one_of_the_scene(path: Path, other: Path, folder: Path) -> None:
    first = window(path, folder)
    pack = end_run(first)
    run_line(first, "file.quit")
    first.training.close()
    assert packs_in(path) == ["scene.single.ntc"]
    assert unsaved(window(other, folder)) == []
    second = window(path, folder)
    assert unsaved(second) == [1]
    run_line(second, "training.keep '' 1")
    settle(second)
    same_latents(path.with_name("scene.random.ntc"), pack)
    assert second.session.view.slot_a.source == "scene.random"
    assert autosaved(folder) == []


def test_a_discarded_run_is_deleted_and_can_be_kept_until_the_window_closes(path: Path, folder: Path) -> None:
    first = window(path, folder)
    end_run(first)
    end_run(first, 8)
    assert autosaved(folder) == ["random-2.ntc", "random.ntc"]
    run_line(first, "training.discard")
    wait_until_written(first)
    assert (autosaved(folder), unsaved(first), first.training.log.chosen) == (["random.ntc"], [1], None)
    assert "run 2" not in first.session.packs
    run_line(first, "training.keep '' 2")
    settle(first)
    assert path.with_name("scene.random.ntc").is_file()
    assert first.training.log[2].fate == "done, kept"
    first.training.close()
    second = window(path, folder)
    run_line(second, "training.discard 1")
    run_line(second, "training.show 1 a")
    wait_until_written(second)
    assert (autosaved(folder), unsaved(second)) == ([], [])
    assert unsaved(window(path, folder)) == []


def test_two_windows_of_a_scene_write_other_files_and_share_what_is_there(path: Path, folder: Path) -> None:
    first, second = window(path, folder), window(path, folder)
    end_run(first)
    end_run(second, 8)
    assert autosaved(folder) == ["random-2.ntc", "random.ntc"]
    third = window(path, folder)
    assert unsaved(third) == [1, 2]
    for context in (first, third):
        run_or_notify(context, "training.keep", Path(), 1)
        settle(context)
    assert packs_in(path) == ["scene.random.ntc", "scene.single.ntc"]
    assert len(errors(third)) == 1, "the first window has written it"
    assert autosaved(folder) == ["random-2.ntc"]


def test_a_scene_that_has_changed_gets_no_pack_of_its_earlier_self(path: Path, other: Path, folder: Path) -> None:
    first = window(path, folder)
    end_run(first)
    first.training.close()
    # Other pictures, so that no texture is the same.
    for file in other.parent.iterdir():
        file.replace(path.parent / file.name)
    second = window(path, folder)
    run_or_notify(second, "training.show", 1, "a")
    run_or_notify(second, "training.keep", Path(), 1)
    assert "made for another scene" in errors(second)[0]
    assert packs_in(path) == ["scene.single.ntc"]
    run_line(second, "training.discard 1")
    wait_until_written(second)
    assert autosaved(folder) == []


def test_what_is_no_pack_is_refused_and_a_full_disk_is_said_once(path: Path, folder: Path) -> None:
    first = window(path, folder)
    end_run(first)
    end_run(first)
    spoilt, empty = sorted(folder.glob("*.ntc"))
    garbage(spoilt)
    emptied(empty)
    second = window(path, folder)
    assert unsaved(second) == [1]
    run_or_notify(second, "training.show", 1, "a")
    assert errors(second)
    (folder.parent / "file").write_text("")
    context = window(path, folder.parent / "file" / "runs")
    end_run(context)
    end_run(context)
    assert len(errors(context)) == 1
    assert "runs will be lost" in errors(context)[0]


def test_the_oldest_runs_are_deleted_beyond_the_limits(
    path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    context = window(path, folder)
    monkeypatch.setattr(run_store, "MOST_FILES", 3)
    packs = [end_run(context, seed) for seed in range(5)]
    for file, pack in zip(UnsavedRuns(folder).of(context.session.scene), packs[2:], strict=True):
        same_latents(file, pack)
    monkeypatch.setattr(run_store, "MOST_BYTES", 1)
    end_run(context)
    assert len(autosaved(folder)) == 1, "the newest stays"


@pytest.mark.process
def test_a_run_under_way_is_autosaved_and_stays_when_the_window_closes(path: Path, folder: Path) -> None:
    context = window(path, folder)
    training, scene = context.training, context.session.scene
    settings = TrainingSettings("baseline", codec="grid", texture_size=16, budget=TimeBudget(600.0))
    training.start(EncodeScene(settings), scene, None)
    began = time.monotonic()
    while training.active is not None and training.active.autosave is None:
        training.tick(scene, frozenset(), context.session.packs)
        assert time.monotonic() - began < 100.0
        time.sleep(0.01)
    training.close()
    (file,) = folder.glob("*.ntc")
    assert read_pack(file).training["ended_early"]
    assert unsaved(window(path, folder)) == [1]


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


def test_a_kept_pack_lies_in_the_data_folder_and_is_opened_with_the_scene(installed: Path, tmp_path: Path) -> None:
    before = sorted(installed.iterdir())
    scene_path, packs = installed / "scene.gltf", tmp_path / "data" / "packs"
    context = open_context(scene_path)
    for _ in range(2):
        finished(context)
        keep(context)
    assert errors(context) == []
    assert sorted(installed.iterdir()) == before
    written = (packs / "scene.random-2.ntc", packs / "scene.random.ntc")
    assert packs_beside(scene_path) == (installed / "scene.single.ntc", *written)
    run_or_notify(context, "file.open", scene_path)
    assert {pack.path for pack in context.session.packs.values()} == set(packs_beside(scene_path))


@pytest.mark.parametrize(
    ("line", "use"),
    [
        ("training.accept", "use training.keep"),
        ("training.kept-back open 1", "use training.show, training.keep or training.discard"),
        ("window.close", "use file.quit"),
    ],
)
def test_commands_of_earlier_versions_say_what_to_use(context: Context, line: str, use: str) -> None:
    with pytest.raises(InputError, match=use):
        run_line(context, line)
