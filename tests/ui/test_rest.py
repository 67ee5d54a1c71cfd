"""Windows that nobody touches, in a process of their own each, come to rest on the picture that `render` draws."""

import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from lab.window_trials.virtual_display import virtual_display
from ntc.errors import InputError
from tests.support.rest.detailed_scenes import encode, write_panorama, write_wall
from tests.support.rest.plan import USUAL, Budgets, Plan, Stage
from tests.support.rest.records import ALONE, SIZE, Played, play, share_equal
from tests.support.rest.truth import LEAST_SHARE, Truth
from viewer.state.view_state import REFERENCE

pytestmark = [pytest.mark.process, pytest.mark.slow, pytest.mark.guards("rest"), pytest.mark.timeout(900)]

SCREEN = (1280, 720)
WITH_PANELS = {**ALONE, "show_panels": True}
LARGEST_ERROR_DB = 0.01
SLOWEST = 1.0
"""Seconds until the slowest answer of the GPU, and the slowest image, arrive."""
MATERIALS, SIDE = 4, 128
IMAGE_BYTES = 4 * MATERIALS * SIDE * SIDE * 4 * 4 // 3 // 3
"""About a third of all maps of the scene of four materials."""
LATENT_BYTES = 15_000
"""Memory for what each near view needs, but not for what all of them need."""
SQUARES = tuple(Stage(f"{x} {y}", (f"camera.look {x} {y} 0.4 {x} {y} 0",)) for x in (0.5, -0.5) for y in (0.5, -0.5))
"""Views in which one of four squares fills the picture."""
WAYS = (
    "slot.path a binned; slot.filter a stochastic",
    "slot.path a auto; slot.filter a exact",
    "materials.view orm",
    "compare.mode side-by-side",
    "compare.difference flip",
    "overlay.kind error-texture; overlay.opacity 0.3",
)
"""One of each kind: path and filter, view, way to compare, kind of difference, overlay."""
Start = Callable[..., Played]
Check = Callable[..., None]


@pytest.fixture(scope="module")
def screen() -> Iterator[str]:
    """DISPLAY of a virtual screen."""
    try:
        with virtual_display(*SCREEN) as name:
            yield name
    except InputError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def wall(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene of two squares with all maps, and a pack of 4 bits beside it."""
    path = write_wall(tmp_path_factory.mktemp("wall") / "wall.glb")
    encode(path, path.with_suffix(".clustered.ntc"))
    return path


@pytest.fixture(scope="module")
def four(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene of four materials with a pack of 4 bits beside it."""
    path = write_wall(tmp_path_factory.mktemp("four") / "four.glb", MATERIALS, SIDE)
    encode(path, path.with_suffix(".clustered.ntc"))
    return path


@pytest.fixture(scope="module")
def truth() -> Iterator[Truth]:
    """What windows must show."""
    with Truth() as made:
        yield made


@pytest.fixture
def check(truth: Truth) -> Check:
    """Fails with the figures of a window that rests on another picture than `render` draws, at any of the stages."""

    def checked(played: Played, *stages: str, budgets: Budgets = USUAL) -> None:
        for name in stages:
            rest = played.of(name)
            if not truth.verdict(rest, budgets, quality=False).is_right:
                pytest.fail(f"{name}: {truth.verdict(rest, budgets)}")

    return checked


@pytest.fixture
def start(screen: str, tmp_path: Path) -> Start:
    """Opens a window with these arguments, and lets it rest; the stages that follow may be given."""

    def started(
        *arguments: str, stages: tuple[Stage, ...] = (), settings: Mapping[str, Any] = ALONE, **plan: Any
    ) -> Played:
        size = plan.pop("size", SIZE)
        played = play(screen, tmp_path, Plan(arguments, stages, **plan), size, settings)
        assert not played.problem, played.problem
        return played

    return started


def test_the_builtin_scene(start: Start, check: Check) -> None:
    played = start()
    assert played.of("start").view.slot_a.source == "clustered"
    check(played, "start")


def test_original_images_and_a_pack_and_a_scene_that_are_dropped(
    start: Start, check: Check, wall: Path, tmp_path: Path
) -> None:
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
    check(played, "start", "pack", "compared", "scene")


def test_every_way_to_show_a_scene_that_was_just_opened(start: Start, check: Check, wall: Path) -> None:
    """For each way the window opens the scene anew: nothing of it is on the GPU."""
    # The view of materials outlives the scene.
    opened = (f"file.open '{wall}'", "materials.view lit")
    played = start(str(wall), stages=tuple(Stage(way, (*opened, *way.split("; "))) for way in WAYS))
    check(played, *WAYS)


def test_figures_are_of_the_final_picture_though_answers_come_late(
    start: Start, check: Check, truth: Truth, wall: Path
) -> None:
    arguments = (str(wall), "--path", "cached")
    played = start(*arguments, settings=WITH_PANELS, size=(1000, 600), records_figures=True, slowest_answer=1.5)
    check(played, "start")
    rest = played.of("start")
    current = [figures for figures in rest.figures if figures.is_current]
    assert current, "the window rests without figures"
    for figures in current:
        assert figures.picture is not None
        assert share_equal(figures.picture, truth.picture(rest)) >= LEAST_SHARE, f"frame {figures.frame}"
    assert current[-1].psnr_db == pytest.approx(truth.figure(rest), abs=LARGEST_ERROR_DB)


def test_images_that_there_is_no_room_for(start: Start, check: Check, four: Path) -> None:
    """They are read slowly in threads, while frames show coarser ones."""
    budgets = Budgets(image_bytes=IMAGE_BYTES)
    stages = (SQUARES[0], Stage("base", ("materials.view base",)))
    played = start(str(four), "--grouping", REFERENCE, stages=stages, budgets=budgets, slowest_read=SLOWEST)
    check(played, "start", SQUARES[0].name, "base", budgets=budgets)


def test_tiles_whose_latents_there_was_no_room_for(start: Start, check: Check, four: Path) -> None:
    """Tiles that the first view decoded from coarser latents are decoded anew where a near view has room for finer ones.

    The first view itself is not compared: a window decodes its tiles a few at a time, each from the latents that fit with the others.
    """
    budgets = Budgets(latent_bytes=LATENT_BYTES)
    played = start(str(four), "--path", "cached", stages=SQUARES, budgets=budgets)
    check(played, *(stage.name for stage in SQUARES), budgets=budgets)


def test_light_that_is_prefiltered(start: Start, check: Check, wall: Path, tmp_path: Path) -> None:
    panorama = write_panorama(tmp_path / "room.hdr")
    stages = (
        Stage("panorama", drops=(str(panorama),)),
        Stage("turned", ("light.turn 120",)),
        Stage("sun", ("light.environment sky", "light.sun 40 20")),
    )
    played = start(str(wall), "--path", "cached", stages=stages)
    assert played.of("panorama").view.lighting.environment == str(panorama)
    check(played, *(stage.name for stage in stages))


def test_an_animation_that_is_paused(start: Start, check: Check, tmp_path: Path) -> None:
    scene = write_wall(tmp_path / "turning.glb", side=SIDE, animated=True)
    encode(scene, tmp_path / "turning.clustered.ntc")
    stages = (
        Stage("moment", ("animation.time 0.9",)),
        Stage("paused", ("animation.play", "animation.time 1.3", "animation.play")),
        Stage("as it was read", ("animation.rest",)),
    )
    played = start(str(scene), stages=stages)
    assert played.of("paused").view.pose is not None
    check(played, "start", *(stage.name for stage in stages))


def test_a_pack_that_is_encoded_and_accepted(start: Start, check: Check, tmp_path: Path) -> None:
    scene = write_wall(tmp_path / "scene.glb", side=SIDE)
    stages = (
        Stage("encoded", (f"training.encode clustered auto {SIDE} 30s best block 4",)),
        Stage("accepted", ("training.keep",)),
    )
    played = start(str(scene), stages=stages, settings={**ALONE, "prepare_encoding": True})
    assert list(tmp_path.glob("scene.*.ntc"))
    for stage in stages:
        assert played.of(stage.name).view.slot_a.source != REFERENCE
        check(played, stage.name)
