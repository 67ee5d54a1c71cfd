"""What a training is prepared from, what is prepared ahead, and the events of a run."""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import pytest

from lab.bench.random_pack import random_block_pack
from ntc.codec.block.config import BlockConfig
from ntc.codec.encoding import BitsTarget, QualityTarget, StepBudget, TimeBudget
from ntc.codec.grid.training.config import TrainingConfig
from ntc.errors import InputError
from ntc.pack.file import read_pack
from ntc.pack.match import changed_groups
from ntc.training.messages import TrainingRequest, checked_request
from tests.end_to_end.conftest import two_squares
from tests.support.gltf_builder import GltfBuilder, noise, png
from tests.support.scenes import built
from viewer.jobs.job import JobReport
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.state.events import Event, Notification, PackClosed, PackShown, PackUpdated
from viewer.training import preparation as module
from viewer.training.live_training import LiveTraining
from viewer.training.preparation import (
    LEAST_MEMORY,
    AheadPreparation,
    EncodeScene,
    MoveTexture,
    Regroup,
    RetrainGroups,
    TrainingJob,
    free_memory,
    prepare,
    settings_text,
)
from viewer.training.settings import TrainingSettings

SETTINGS = TrainingSettings("single")


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return load_scene(two_squares().write(tmp_path_factory.mktemp("scene") / "scene.glb"))


@pytest.mark.parametrize(
    ("job", "dirty"),
    [
        (RetrainGroups(SETTINGS, frozenset({1})), {1}),
        (MoveTexture(SETTINGS, 0, 1), {0}),
        (Regroup(SETTINGS), {0}),
        (Regroup(TrainingSettings("single", recipe="paper", budget=StepBudget(5))), {0}),
    ],
)
def test_jobs_go_on_from_a_block_pack_in_its_own_codec(scene: Scene, job: TrainingJob, dirty: set[int]) -> None:
    pack = random_block_pack(((32, 32), (32, 32)), (0, 1), hashes=[texture.pixel_hash for texture in scene.textures])
    request = checked_request(prepare(job, scene, pack, JobReport()))
    assert request.codec == pack.config
    assert request.start is pack
    assert request.dirty == dirty


def test_textures_are_trained_again_as_large_as_the_pack_has_them() -> None:
    builder = GltfBuilder()
    wide = built(builder.drawn(builder.triangle(builder.material(builder.image(png(noise(32, 64)))))))
    pack = random_block_pack(((32, 16),), (0,), hashes=[texture.pixel_hash for texture in wide.textures])
    request = prepare(RetrainGroups(SETTINGS, frozenset({0})), wide, pack, JobReport())
    assert [texture.size for texture in request.textures] == [(32, 16)]


def test_a_scene_is_encoded_in_blocks_at_full_size_and_the_bits_of_the_command_line(scene: Scene) -> None:
    request = prepare(EncodeScene(SETTINGS), scene, random_block_pack(), JobReport())
    assert request.start is None
    assert request.codec.kind == "block"
    more = prepare(EncodeScene(replace(SETTINGS, target=BitsTarget(12.0))), scene, None, JobReport())
    found = [one.codec.mean_words for one in (request, more) if isinstance(one.codec, BlockConfig)]
    low, high = found
    assert low < high
    assert settings_text(EncodeScene(SETTINGS)) == "full size, block"
    assert settings_text(EncodeScene(replace(SETTINGS, target=QualityTarget(40.0)))) == "full size, block, 40 dB"


@pytest.mark.parametrize(
    "settings",
    [
        replace(SETTINGS, recipe="paper"),
        replace(SETTINGS, codec="grid"),
        replace(SETTINGS, budget=StepBudget(10)),
    ],
)
def test_what_is_asked_of_a_training_is_encoded_in_grids(scene: Scene, settings: TrainingSettings) -> None:
    request = prepare(EncodeScene(settings), scene, None, JobReport())
    assert request.codec.kind == "grid"
    assert cast(TrainingConfig, request.training).recipe == settings.recipe
    assert "grid" in settings_text(EncodeScene(settings))


def test_no_pack_is_regrouped_under_the_decoder_that_ships(scene: Scene) -> None:
    pack = random_block_pack(((32, 32), (32, 32)), (0, 1), hashes=[texture.pixel_hash for texture in scene.textures])
    with pytest.raises(InputError, match="regroup universal: the shipped decoder"):
        prepare(Regroup(TrainingSettings("universal")), scene, pack, JobReport())
    request = checked_request(prepare(EncodeScene(TrainingSettings("universal")), scene, None, JobReport()))
    assert request.grouping.name == "universal"


def test_bits_that_cannot_be_had_are_named(scene: Scene) -> None:
    with pytest.raises(InputError, match=r"bits 500: .*up to"):
        prepare(EncodeScene(replace(SETTINGS, target=BitsTarget(500.0))), scene, None, JobReport())


JOB = EncodeScene(TrainingSettings("single"))


class Worker:
    """In place of the handle of a process."""

    def __init__(self) -> None:
        self.started = 0

    def warm_up(self) -> None:
        self.started += 1


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
        EncodeScene(replace(JOB.settings, target=BitsTarget(3.0))),
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
    ahead.begin(EncodeScene(replace(JOB.settings, target=BitsTarget(900.0))), scene, worker)
    with pytest.raises(InputError, match="up to"):
        ahead.take(EncodeScene(replace(JOB.settings, target=BitsTarget(900.0))), scene, JobReport())


@pytest.mark.parametrize(
    ("text", "begins"),
    [
        (f"MemFree: 1 kB\nMemAvailable: {LEAST_MEMORY // 1024 - 1} kB\n", False),
        (f"MemAvailable:  {LEAST_MEMORY // 1024 + 100} kB\n", True),
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


PATIENCE = 140.0
"""Seconds that anything may take on a busy machine."""
BRIEF = TrainingSettings("baseline", texture_size=32, budget=StepBudget(30))
IN_BLOCKS = replace(BRIEF, budget=TimeBudget(0.5))


@pytest.fixture
def own_scene(tmp_path: Path) -> Scene:
    return load_scene(two_squares(5).write(tmp_path / "scene.glb"))


@pytest.fixture
def events() -> list[Event]:
    return []


@pytest.fixture
def training(events: list[Event]) -> Iterator[LiveTraining]:
    made = LiveTraining(events.append)
    yield made
    made.close()


def tick_until(training: LiveTraining, own_scene: Scene, done: Callable[[], bool]) -> None:
    began = time.monotonic()
    while not done():
        training.tick(own_scene, frozenset())
        assert time.monotonic() - began < PATIENCE, training.state
        time.sleep(0.02)


def updates(events: list[Event]) -> list[PackUpdated]:
    return [event for event in events if isinstance(event, PackUpdated)]


@pytest.mark.process
@pytest.mark.parametrize("settings", [BRIEF, IN_BLOCKS], ids=["grid", "block"])
def test_a_run_is_a_sequence_of_events(
    training: LiveTraining, own_scene: Scene, events: list[Event], tmp_path: Path, settings: TrainingSettings
) -> None:
    training.start(EncodeScene(settings), own_scene, None)
    with pytest.raises(InputError, match="another run is under way"):
        training.start(EncodeScene(settings), own_scene, None)
    tick_until(training, own_scene, lambda: training.active is None)
    first = updates(events)[0]
    assert first.name == "run 1"
    assert isinstance(events[1], PackShown)
    assert events[1].name == "run 1"
    assert isinstance(events[-1], Notification)
    assert "Keep or discard it" in events[-1].text
    encoded = updates(events)[-1].pack
    assert encoded.config.kind == settings.codec_kind
    assert training.log[1].pack is encoded

    training.keep(0, tmp_path / "out.ntc")
    tick_until(training, own_scene, lambda: not training.saving)
    assert read_pack(tmp_path / "out.ntc").grouping.groups == encoded.grouping.groups
    assert changed_groups(encoded, updates(events)[-1].pack) == frozenset()

    events.clear()
    base = training.log[1].pack
    assert base is not None
    training.start(RetrainGroups(settings, frozenset((1,))), own_scene, base)
    tick_until(training, own_scene, lambda: training.active is None)
    assert [event.name for event in events if isinstance(event, PackShown)] == ["run 2"]
    packs = [event.pack for event in updates(events)]
    assert all(changed_groups(*pair) <= {1} for pair in pairwise(packs))
    training.discard(0)
    assert [event.name for event in events if isinstance(event, PackClosed)] == ["run 2"]


@pytest.mark.process
def test_another_scene_ends_the_run(
    training: LiveTraining, own_scene: Scene, events: list[Event], tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="no pack is open to continue from"):
        training.start(RetrainGroups(BRIEF, frozenset((1,))), own_scene, None)
    training.start(EncodeScene(BRIEF), own_scene, None)
    training.tick(load_scene(two_squares(6).write(tmp_path / "other.glb")), frozenset())
    assert training.state == "idle"
    assert events == [Notification("training was stopped because another scene was opened")]
