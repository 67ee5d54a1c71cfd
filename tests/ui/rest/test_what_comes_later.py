"""What comes beside frames, while the window is open: packs, scenes, panoramas, programs, and what is encoded and trained there."""

import shutil
from pathlib import Path

import pytest

from tests.support.rest.detailed_scenes import encode, write_panorama, write_wall
from tests.support.rest.plan import Stage
from tests.support.rest.records import ALONE
from tests.ui.rest.conftest import Check, Start
from viewer.state.view_state import REFERENCE

pytestmark = [pytest.mark.process, pytest.mark.slow]

SMALL = 128
"""Texels along a side of a texture that is encoded for one test."""
TRAINED = 128
"""The same of one that is trained."""


def test_a_pack_and_a_scene_that_are_dropped(start: Start, check: Check, wall: Path, tmp_path: Path) -> None:
    alone = Path(shutil.copy(wall, tmp_path / "alone.glb"))
    pack = Path(shutil.copy(wall.with_suffix(".clustered.ntc"), tmp_path / "elsewhere.ntc"))
    stages = (
        Stage("pack", drops=(str(pack),)),
        Stage("compared", ("compare.mode wipe",)),
        Stage("scene", drops=(str(wall),)),
    )
    played = start(str(alone), stages=stages)
    assert played.of("start").view.slot_a.source == REFERENCE
    assert played.of("pack").view.slot_a.source == "clustered"
    assert played.of("scene").scene == wall
    for name in ("start", "pack", "compared", "scene"):
        check(played.of(name))


@pytest.mark.nightly
def test_a_library_that_is_opened(start: Start, check: Check, tmp_path: Path) -> None:
    scene = write_wall(tmp_path / "alone.glb", side=SMALL)
    library = encode(scene, tmp_path / "library", "--workers", "1")
    played = start(str(scene), stages=(Stage("library", (f"file.open '{library}'",)),))
    assert played.of("library").view.slot_a.source != REFERENCE
    check(played.of("library"))


@pytest.mark.nightly
def test_light_that_is_prefiltered(start: Start, check: Check, wall: Path, tmp_path: Path) -> None:
    panorama = write_panorama(tmp_path / "room.hdr")
    stages = (
        Stage("panorama", drops=(str(panorama),)),
        Stage("turned", ("light.turn 120",)),
        Stage("sun", ("light.environment sky", "light.sun 40 20")),
    )
    played = start(str(wall), "--path", "cached", stages=stages)
    assert played.of("panorama").view.lighting.environment == str(panorama)
    for stage in stages:
        check(played.of(stage.name))


@pytest.mark.nightly
def test_paths_that_are_switched(start: Start, check: Check, wall: Path) -> None:
    """While programs are compiled, and what the paths before have uploaded is there."""
    paths = ("deferred", "cached", "binned", "forward", "auto")
    played = start(str(wall), "--grouping", REFERENCE, stages=tuple(switched(path) for path in paths))
    for path in paths:
        check(played.of(path))


def switched(path: str) -> Stage:
    """Slot A decodes by `path`."""
    return Stage(path, ("slot.source a clustered", f"slot.path a {path}", "compare.mode a"))


@pytest.mark.nightly
def test_a_pack_that_is_encoded_and_accepted(start: Start, check: Check, tmp_path: Path) -> None:
    scene = write_wall(tmp_path / "scene.glb", side=SMALL)
    stages = (
        Stage("encoded", (f"training.encode clustered auto {SMALL} 30s best block 4",)),
        Stage("accepted", ("training.keep",)),
    )
    played = start(str(scene), stages=stages, settings={**ALONE, "prepare_encoding": True})
    assert list(tmp_path.glob("scene.*.ntc"))
    for stage in stages:
        assert played.of(stage.name).view.slot_a.source != REFERENCE
        check(played.of(stage.name))


@pytest.mark.nightly
def test_groups_that_are_trained_and_trained_again(start: Start, check: Check, tmp_path: Path) -> None:
    scene = write_wall(tmp_path / "scene.glb", side=TRAINED)
    stages = (
        Stage("trained", (f"training.encode baseline auto {TRAINED} 60steps best grid",)),
        Stage("trained again", ("training.retrain 0 60steps",)),
    )
    played = start(str(scene), stages=stages)
    for stage in stages:
        rest = played.of(stage.name)
        assert rest.view.slot_a.source != REFERENCE, rest.told
        check(rest)
