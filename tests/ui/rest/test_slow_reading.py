"""Images that are read slowly, answers of the GPU that come many frames later, and memory that holds not all of a scene."""

from pathlib import Path

import pytest

from tests.support.rest.detailed_scenes import encode, write_wall
from tests.support.rest.plan import Budgets, Stage
from tests.ui.rest.conftest import Check, Start
from viewer.state.view_state import REFERENCE

pytestmark = [pytest.mark.process, pytest.mark.slow]

SLOWEST = 1.0
"""Seconds."""
MATERIALS, SIDE = 4, 128
IMAGE_BYTES = 4 * MATERIALS * SIDE * SIDE * 4 * 4 // 3 // 3
"""Of all maps of the scene, about a third."""
LATENT_BYTES = 15_000
TILE_MEGABYTES = 4
NEAR = "camera.look 0.5 0.5 0.4 0.5 0.5 0"
"""One of the four squares fills the picture."""
SQUARES = tuple(Stage(f"{x} {y}", (f"camera.look {x} {y} 0.4 {x} {y} 0",)) for x in (0.5, -0.5) for y in (0.5, -0.5))
"""Each fills the picture."""


@pytest.fixture(scope="module")
def four(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene of four materials with a pack of 4 bits beside it."""
    path = write_wall(tmp_path_factory.mktemp("four") / "four.glb", MATERIALS, SIDE)
    encode(path, path.with_suffix(".clustered.ntc"))
    return path


@pytest.mark.parametrize(
    ("path", "seed"),
    [("cached", 3), *(pytest.param("deferred", seed, marks=pytest.mark.nightly) for seed in (1, 2))],
)
def test_answers_that_come_late(start: Start, check: Check, wall: Path, path: str, seed: int) -> None:
    played = start(str(wall), "--path", path, slowest_answer=SLOWEST, seed=seed)
    check(played.of("start"))


@pytest.mark.nightly
def test_a_map_of_decoders_whose_answers_come_late(start: Start, check: Check, wall: Path) -> None:
    stages = (Stage("map", ("overlay.kind divergence", "overlay.opacity 0.3", "compare.mode side-by-side")),)
    played = start(str(wall), stages=stages, slowest_answer=SLOWEST)
    check(played.of("map"))


@pytest.mark.nightly
def test_images_and_answers_that_come_late(start: Start, check: Check, four: Path) -> None:
    played = start(str(four), slowest_read=SLOWEST, slowest_answer=SLOWEST)
    check(played.of("start"))


@pytest.mark.nightly
@pytest.mark.parametrize("slowest", [0.0, SLOWEST])
def test_images_that_there_is_no_room_for(start: Start, check: Check, four: Path, slowest: float) -> None:
    """They are read in threads, while frames show coarser ones."""
    budgets = Budgets(image_bytes=IMAGE_BYTES)
    stages = (Stage("near", (NEAR,)), Stage("base", ("materials.view base",)))
    played = start(str(four), "--grouping", REFERENCE, stages=stages, budgets=budgets, slowest_read=slowest)
    for name in ("start", "near", "base"):
        check(played.of(name), budgets)


@pytest.mark.nightly
def test_latents_of_one_texture_at_a_time(start: Start, check: Check, four: Path) -> None:
    """The budget holds what each near view needs, but not what all of them need, nor the first view: that has coarser mips."""
    budgets = Budgets(latent_bytes=LATENT_BYTES)
    played = start(str(four), stages=SQUARES, budgets=budgets)
    for name in ("start", *(stage.name for stage in SQUARES)):
        check(played.of(name), budgets)


def test_tiles_whose_latents_there_was_no_room_for(start: Start, check: Check, four: Path) -> None:
    """Tiles that the first view decoded from coarser latents are decoded anew where a near view has room for finer ones.

    The first view itself is not compared: a window decodes its tiles a few at a time, each from the latents that fit with the others.
    """
    budgets = Budgets(latent_bytes=LATENT_BYTES)
    played = start(str(four), "--path", "cached", stages=SQUARES, budgets=budgets)
    for stage in SQUARES:
        check(played.of(stage.name), budgets)


@pytest.mark.nightly
def test_tiles_in_a_small_cache(start: Start, check: Check, four: Path) -> None:
    budgets = Budgets(tile_megabytes=TILE_MEGABYTES)
    stages = (Stage("near", (NEAR,)), Stage("back", ("camera.next",)))
    played = start(str(four), "--path", "cached", stages=stages, budgets=budgets)
    for name in ("start", "near", "back"):
        check(played.of(name), budgets)
