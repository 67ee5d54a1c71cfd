"""Requests for codec `block`: what a scene without a pack is encoded in, and what goes on from a pack of it."""

from dataclasses import replace
from typing import cast

import pytest

from lab.bench.random_pack import random_block_pack
from ntc.codec.block.config import BlockConfig
from ntc.codec.encoding import StepBudget
from ntc.codec.grid.training.config import TrainingConfig
from ntc.errors import InputError
from ntc.training.messages import checked_request
from tests.end_to_end.conftest import two_squares
from viewer.jobs.job import JobReport
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.training.preparation import (
    EncodeScene,
    MoveTexture,
    Regroup,
    RetrainGroups,
    TrainingJob,
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


def test_a_scene_is_encoded_in_blocks_at_two_bits(scene: Scene) -> None:
    request = prepare(EncodeScene(SETTINGS), scene, random_block_pack(), JobReport())
    assert request.start is None
    assert request.codec.kind == "block"
    more = prepare(EncodeScene(replace(SETTINGS, bits=12.0)), scene, None, JobReport())
    found = [one.codec.mean_words for one in (request, more) if isinstance(one.codec, BlockConfig)]
    low, high = found
    assert low < high
    assert settings_text(EncodeScene(SETTINGS)) == "256 texels, block, 2 bits per texel, 30s"


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
        prepare(EncodeScene(replace(SETTINGS, bits=500.0)), scene, None, JobReport())
