"""A window that is opened and left alone, in a process of its own each, comes to rest on the picture that `render` draws."""

import shutil
from pathlib import Path

import pytest

from tests.support.rest.detailed_scenes import encode, write_wall
from tests.support.rest.plan import Stage
from tests.ui.rest.conftest import Check, Start
from viewer.state.view_state import REFERENCE

SMALL = 128
"""Texels along a side of a texture that is encoded for one test."""
pytestmark = [pytest.mark.process, pytest.mark.slow]


def test_the_builtin_scene(start: Start, check: Check) -> None:
    rest = start().of("start")
    assert rest.view.slot_a.source == "clustered"
    check(rest)


@pytest.mark.parametrize(
    "path", ["auto", *(pytest.param(path, marks=pytest.mark.nightly) for path in ("deferred", "cached"))]
)
def test_a_pack_beside_the_scene(start: Start, check: Check, wall: Path, path: str) -> None:
    rest = start(str(wall), "--path", path).of("start")
    assert (rest.view.slot_a.source, rest.view.slot_a.path) == ("clustered", path)
    check(rest)


@pytest.mark.nightly
def test_the_stochastic_filter(start: Start, check: Check, wall: Path) -> None:
    rest = start(str(wall), "--filter", "stochastic").of("start")
    assert rest.view.slot_a.filter == "stochastic"
    check(rest)


def test_original_images(start: Start, check: Check, tmp_path: Path) -> None:
    rest = start(str(write_wall(tmp_path / "plain.glb"))).of("start")
    assert (rest.view.slot_a.source, rest.view.compare) == (REFERENCE, "a")
    check(rest)


@pytest.mark.nightly
def test_a_pack_of_the_command_line(start: Start, check: Check, wall: Path, tmp_path: Path) -> None:
    scene = Path(shutil.copy(wall, tmp_path / "alone.glb"))
    pack = Path(shutil.copy(wall.with_suffix(".clustered.ntc"), tmp_path / "elsewhere.ntc"))
    rest = start(str(scene), "--pack", str(pack)).of("start")
    assert rest.view.slot_a.source == "clustered"
    check(rest)


@pytest.mark.nightly
def test_a_library(start: Start, check: Check, tmp_path: Path) -> None:
    scene = write_wall(tmp_path / "alone.glb", side=SMALL)
    library = encode(scene, tmp_path / "library", "--workers", "1")
    rest = start(str(scene), "--pack", str(library)).of("start")
    assert rest.view.slot_a.source != REFERENCE
    check(rest)


@pytest.mark.nightly
def test_surfaces_that_let_light_through(start: Start, check: Check, tmp_path: Path) -> None:
    # Many samples of each pixel are drawn.
    scene = write_wall(tmp_path / "panes.glb", side=SMALL, blend=True)
    encode(scene, tmp_path / "panes.clustered.ntc")
    played = start(str(scene), stages=(Stage("side by side", ("compare.mode side-by-side",)),))
    for name in ("start", "side by side"):
        check(played.of(name))


@pytest.mark.nightly
def test_an_animation_that_is_paused(start: Start, check: Check, tmp_path: Path) -> None:
    scene = write_wall(tmp_path / "turning.glb", side=SMALL, animated=True)
    encode(scene, tmp_path / "turning.clustered.ntc")
    stages = (
        Stage("moment", ("animation.time 0.9",)),
        Stage("paused", ("animation.play", "animation.time 1.3", "animation.play")),
        Stage("as it was read", ("animation.rest",)),
    )
    played = start(str(scene), stages=stages)
    assert played.of("paused").view.pose is not None
    for name in ("start", *(stage.name for stage in stages)):
        check(played.of(name))
