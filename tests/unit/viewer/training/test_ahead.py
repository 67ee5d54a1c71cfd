"""What is prepared before an encoding is asked for: taken where it fits, dropped where it does not, never waited for."""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ntc.codec.encoding import StepBudget, TimeBudget
from ntc.errors import InputError
from ntc.training.messages import TrainingRequest
from tests.end_to_end.conftest import two_squares
from viewer.jobs.job import JobReport
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.training import preparation as module
from viewer.training.preparation import (
    LEAST_MEMORY,
    AheadPreparation,
    EncodeScene,
    RetrainGroups,
    TrainingJob,
    free_memory,
    prepare,
)
from viewer.training.settings import TrainingSettings

JOB = EncodeScene(TrainingSettings("single"))


class Worker:
    """In place of the handle of a process."""

    def __init__(self) -> None:
        self.started = 0

    def warm_up(self) -> None:
        self.started += 1


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return load_scene(two_squares().write(tmp_path_factory.mktemp("scene") / "scene.glb"))


@pytest.fixture
def worker() -> Any:
    return Worker()


@pytest.fixture
def ahead() -> Iterator[AheadPreparation]:
    made = AheadPreparation()
    yield made
    made.end()


@pytest.fixture
def slowly(monkeypatch: pytest.MonkeyPatch) -> Callable[[], int]:
    """Preparing goes on until it is cancelled; how many have ended."""
    ended = []

    def wait(_job: TrainingJob, _scene: Scene, _base: object, report: JobReport) -> TrainingRequest:
        try:
            while True:
                report.check()
                time.sleep(0.005)
        finally:
            ended.append(1)

    monkeypatch.setattr(module, "prepare", wait)
    return lambda: len(ended)


@pytest.mark.parametrize(
    "settings",
    [
        JOB.settings,
        replace(JOB.settings, budget=TimeBudget(3.0)),
        replace(JOB.settings, codec="block"),
    ],
)
def test_what_was_prepared_is_what_would_be(
    ahead: AheadPreparation, worker: Any, scene: Scene, settings: TrainingSettings
) -> None:
    ahead.begin(JOB, scene, worker)
    ahead.begin(JOB, scene, worker)
    found = ahead.take(EncodeScene(settings), scene, JobReport())
    expected = prepare(EncodeScene(settings), scene, None, JobReport())
    assert found is not None
    assert worker.started == 1
    assert (found.grouping, found.codec, found.training, found.budget) == (
        expected.grouping,
        expected.codec,
        expected.training,
        expected.budget,
    )
    assert [texture.pixels.tobytes() for texture in found.textures] == [t.pixels.tobytes() for t in expected.textures]
    assert ahead.take(EncodeScene(settings), scene, JobReport()) is None, "it is used once"


@pytest.mark.parametrize(
    "job",
    [
        EncodeScene(replace(JOB.settings, texture_size=16)),
        EncodeScene(replace(JOB.settings, recipe="paper")),
        EncodeScene(replace(JOB.settings, budget=StepBudget(5))),
        EncodeScene(replace(JOB.settings, bits=3.0)),
        RetrainGroups(JOB.settings, frozenset({0})),
    ],
)
def test_what_is_something_else_ends_it(
    ahead: AheadPreparation, worker: Any, scene: Scene, slowly: Callable[[], int], job: TrainingJob
) -> None:
    ahead.begin(JOB, scene, worker)
    assert ahead.take(job, scene, JobReport()) is None
    assert slowly() == 1


def test_another_scene_ends_it_without_waiting(
    ahead: AheadPreparation, worker: Any, scene: Scene, slowly: Callable[[], int], tmp_path: Path
) -> None:
    other = load_scene(two_squares(6).write(tmp_path / "other.glb"))
    ahead.begin(JOB, scene, worker)
    ahead.forget_other(scene)
    ahead.forget_other(other)
    ahead.begin(JOB, other, worker)
    ahead.end()
    assert slowly() >= 1
    assert ahead.take(JOB, other, JobReport()) is None


def test_cancelled_while_it_waits(
    ahead: AheadPreparation, worker: Any, scene: Scene, slowly: Callable[[], int]
) -> None:
    ahead.begin(JOB, scene, worker)
    report = JobReport()
    report.cancelled = True
    with pytest.raises(CancelledError):
        ahead.take(JOB, scene, report)
    assert slowly() == 1


def test_what_cannot_be_prepared_is_said_when_it_is_asked_for(
    ahead: AheadPreparation, worker: Any, scene: Scene
) -> None:
    ahead.begin(EncodeScene(replace(JOB.settings, bits=900.0)), scene, worker)
    with pytest.raises(InputError, match="up to"):
        ahead.take(EncodeScene(replace(JOB.settings, bits=900.0)), scene, JobReport())


@pytest.mark.parametrize(
    ("text", "begins"),
    [
        (f"MemFree: 1 kB\nMemAvailable: {LEAST_MEMORY // 1024 - 1} kB\n", False),
        (f"MemAvailable:  {LEAST_MEMORY // 1024 + 1} kB\n", True),
        ("nothing of it\n", True),
        ("MemAvailable:\n", True),
    ],
)
def test_nothing_is_begun_where_memory_is_short(
    ahead: AheadPreparation,
    worker: Any,
    scene: Scene,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    text: str,
    begins: bool,
) -> None:
    (tmp_path / "meminfo").write_text(text)
    monkeypatch.setattr(module, "MEMORY_FILE", tmp_path / "meminfo")
    ahead.begin(JOB, scene, worker)
    assert (ahead.take(JOB, scene, JobReport()) is not None) == begins
    assert worker.started == begins


def test_free_memory_is_a_number_or_not_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = free_memory()
    assert found is None or found > 0
    monkeypatch.setattr(module, "MEMORY_FILE", tmp_path / "absent")
    assert free_memory() is None
