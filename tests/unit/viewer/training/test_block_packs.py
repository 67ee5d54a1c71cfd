"""Packs of codec `block` are not trained in the window: every job that would says so in one line."""

from pathlib import Path

import pytest

from lab.bench.random_pack import random_block_pack
from ntc.errors import InputError
from tests.end_to_end.conftest import two_squares
from viewer.jobs.job import JobReport
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.training.preparation import EncodeScene, MoveTexture, Regroup, RetrainGroups, TrainingJob, prepare
from viewer.training.settings import TrainingSettings

SETTINGS = TrainingSettings("single")


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return load_scene(two_squares().write(tmp_path_factory.mktemp("scene") / "scene.glb"))


@pytest.mark.parametrize(
    "job", [RetrainGroups(SETTINGS, frozenset({0})), MoveTexture(SETTINGS, 0, 1), Regroup(SETTINGS)]
)
def test_jobs_that_go_on_from_a_block_pack_are_refused(scene: Scene, job: TrainingJob) -> None:
    hashes = [texture.pixel_hash for texture in scene.textures]
    pack = random_block_pack(((32, 32), (32, 32)), (0, 1), hashes=hashes)
    with pytest.raises(InputError, match="random: codec block is not trained; encode it again with ntc-viewer encode"):
        prepare(job, scene, pack, JobReport())


def test_encoding_the_scene_anew_needs_no_pack_to_go_on_from(scene: Scene, tmp_path: Path) -> None:
    del tmp_path
    request = prepare(EncodeScene(SETTINGS), scene, random_block_pack(), JobReport())
    assert request.start is None
    assert request.codec.kind == "grid"
