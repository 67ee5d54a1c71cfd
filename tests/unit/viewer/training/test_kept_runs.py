"""Runs that nobody has decided about outlive their window, also one that is killed, and belong to one window at a time."""

import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.grid.model import grid_parts
from ntc.errors import InputError
from ntc.pack.file import read_pack
from tests.support.spoilt_files import (
    SECONDS,
    PromptEffects,
    accept,
    errors,
    finished,
    open_context,
    pack_of,
    settle,
    write_scene,
)
from viewer.commands import run_line, run_or_notify
from viewer.commands.command import Context
from viewer.training.kept_runs import FACTS_FILE, PACK_FILE, KeptRun, KeptRuns, scene_stamp
from viewer.training.preparation import EncodeScene
from viewer.training.settings import TrainingSettings

KILLED = """
import os, signal, sys
from pathlib import Path
from tests.support.spoilt_files import PromptEffects
from tests.support.spoilt_files import pack_of
from tests.unit.viewer.training.test_kept_runs import facts_of
from viewer.training.kept_runs import KeptRuns
kept, scene = KeptRuns(Path(sys.argv[1])), Path(sys.argv[2])
kept.write(kept.new_key(), pack_of(scene, 5), facts_of(scene))
assert not KeptRuns(Path(sys.argv[1])).waiting(), "while its window is open, a run is its own"
os.kill(os.getpid(), signal.SIGKILL)
"""


def facts_of(scene: Path) -> KeptRun:
    path = str(scene.resolve())
    return KeptRun("scene", path, scene_stamp(scene), "retrain group 0", "quick", "done", 2, 1.0, 30.0, 2, time.time())


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "scene").mkdir()
    return write_scene(tmp_path / "scene")


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
    assert "kept back from an earlier session: scene run 2" in messages(context)
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
    assert "no training was kept back" in errors(third)[1]
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
