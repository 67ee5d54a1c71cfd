"""Every path, filter, view and way to compare, each from a scene that has just been opened: what rests is what `render` draws."""

from pathlib import Path

import pytest

from tests.support.rest.plan import Plan, Stage
from tests.support.rest.records import Played, play
from tests.ui.rest.conftest import Check

pytestmark = [pytest.mark.process, pytest.mark.slow, pytest.mark.timeout(900)]

PATHS = [
    f"slot.path a {path}; slot.filter a {texels}"
    for path in ("forward", "deferred", "binned", "cached", "auto")
    for texels in ("exact", "stochastic")
]
"""In the view `lit`, with the wipe."""
VIEWS = [f"materials.view {view}" for view in ("base", "normal", "orm", "emissive")]
MODES = [f"compare.mode {mode}" for mode in ("a", "b", "wipe-horizontal", "side-by-side")]
DIFFERENCES = [f"compare.difference {kind}" for kind in ("raw", "amplified", "relative", "flip")]
OVERLAYS = [f"overlay.kind {kind}; overlay.opacity 0.3" for kind in ("divergence", "error-texture")]
WAYS = [*PATHS, *VIEWS, *MODES, *DIFFERENCES, *OVERLAYS]
SOME = [PATHS[5], PATHS[8], VIEWS[2], MODES[3], DIFFERENCES[3], OVERLAYS[1]]
"""One of each kind at least."""
OTHERS = [way for way in WAYS if way not in SOME]


@pytest.fixture(scope="module")
def played(request: pytest.FixtureRequest, screen: str, wall: Path, tmp_path_factory: pytest.TempPathFactory) -> Played:
    """One window for many ways: for each it opens the scene anew, so that nothing of it is on the GPU, and is left alone."""
    ways: list[str] = request.param
    # The view of materials outlives the scene.
    opened = (f"file.open '{wall}'", "materials.view lit")
    stages = tuple(Stage(way, (*opened, *way.split("; "))) for way in ways)
    return play(screen, tmp_path_factory.mktemp("ways"), Plan((str(wall),), stages))


@pytest.mark.parametrize(
    "played", [SOME, pytest.param(OTHERS, marks=pytest.mark.nightly)], ids=["some", "others"], indirect=True
)
def test_a_scene_that_was_just_opened(played: Played, check: Check) -> None:
    assert not played.problem, played.problem
    for rest in played.rests[1:]:
        check(rest)
