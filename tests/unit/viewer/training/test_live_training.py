"""Training beside the window without a window and without a session: a scene and packs go in, events come out."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from ntc.codec.encoding import StepBudget, TimeBudget
from ntc.errors import InputError
from ntc.pack.file import read_pack
from ntc.pack.match import changed_groups
from tests.end_to_end.conftest import two_squares
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.state.events import Event, Notification, PackClosed, PackUpdated, RunStarted
from viewer.training.live_training import LiveTraining
from viewer.training.preparation import EncodeScene, RetrainGroups
from viewer.training.settings import TrainingSettings

pytestmark = pytest.mark.process
PATIENCE = 140.0
"""Seconds that anything may take on a busy machine."""
SETTINGS = TrainingSettings("baseline", texture_size=32, budget=StepBudget(30))
IN_BLOCKS = replace(SETTINGS, budget=TimeBudget(2.0))


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return load_scene(two_squares(5).write(tmp_path / "scene.glb"))


@pytest.fixture
def events() -> list[Event]:
    return []


@pytest.fixture
def training(events: list[Event]) -> Iterator[LiveTraining]:
    made = LiveTraining(events.append)
    yield made
    made.close()


def tick_until(training: LiveTraining, scene: Scene, done: Callable[[], bool]) -> None:
    began = time.monotonic()
    while not done():
        training.tick(scene, frozenset())
        assert time.monotonic() - began < PATIENCE, training.state
        time.sleep(0.02)


def updates(events: list[Event]) -> list[PackUpdated]:
    return [event for event in events if isinstance(event, PackUpdated)]


@pytest.mark.parametrize("settings", [SETTINGS, IN_BLOCKS], ids=["grid", "block"])
def test_a_run_is_a_sequence_of_events(
    training: LiveTraining, scene: Scene, events: list[Event], tmp_path: Path, settings: TrainingSettings
) -> None:
    training.start(EncodeScene(settings), scene, None)
    with pytest.raises(InputError, match="another run is under way"):
        training.start(EncodeScene(settings), scene, None)
    tick_until(training, scene, lambda: training.active is None)
    first = updates(events)[0]
    assert first.name == "run 1"
    assert isinstance(events[1], RunStarted)
    assert events[1].name == "run 1"
    assert isinstance(events[-1], Notification)
    assert "Accept or discard it" in events[-1].text
    encoded = updates(events)[-1].pack
    assert encoded.config.kind == settings.codec_kind
    assert training.log[1].pack is encoded

    training.accept(tmp_path / "out.ntc", (encoded,))
    tick_until(training, scene, lambda: not training.saving)
    assert read_pack(tmp_path / "out.ntc").grouping.groups == encoded.grouping.groups
    assert changed_groups(encoded, updates(events)[-1].pack) == frozenset()

    events.clear()
    base = training.log[1].pack
    assert base is not None
    training.start(RetrainGroups(settings, frozenset((1,))), scene, ("run 1", base))
    tick_until(training, scene, lambda: training.active is None)
    assert [event.name for event in events if isinstance(event, RunStarted)] == ["run 2"]
    packs = [event.pack for event in updates(events)]
    assert all(changed_groups(*pair) <= {1} for pair in pairwise(packs))
    training.discard()
    assert [event.name for event in events if isinstance(event, PackClosed)] == ["run 2"]


def test_another_scene_ends_the_run(training: LiveTraining, scene: Scene, events: list[Event], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no pack is open to continue from"):
        training.start(RetrainGroups(SETTINGS, frozenset((1,))), scene, None)
    training.start(EncodeScene(SETTINGS), scene, None)
    training.tick(load_scene(two_squares(6).write(tmp_path / "other.glb")), frozenset())
    assert training.state == "idle"
    assert events == [Notification("training was stopped because another scene was opened")]
