"""Scenes of fine detail with their packs, a screen, and the pictures that windows must rest on."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from lab.window_trials.virtual_display import virtual_display
from ntc.errors import InputError
from tests.support.rest.detailed_scenes import encode, write_wall
from tests.support.rest.plan import USUAL, Budgets, Plan, Stage
from tests.support.rest.records import ALONE, SIZE, Played, Rest, play
from tests.support.rest.truth import Truth

SCREEN = (1280, 720)
Check = Callable[..., None]
Start = Callable[..., Played]


@pytest.fixture(scope="package")
def screen() -> Iterator[str]:
    """DISPLAY of a virtual screen."""
    try:
        with virtual_display(*SCREEN) as name:
            yield name
    except InputError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="package")
def wall(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene of two squares with all maps, and a pack of 4 bits beside it."""
    path = write_wall(tmp_path_factory.mktemp("wall") / "wall.glb")
    encode(path, path.with_suffix(".clustered.ntc"))
    return path


@pytest.fixture(scope="package")
def truth() -> Iterator[Truth]:
    """What windows must show."""
    with Truth() as made:
        yield made


@pytest.fixture(scope="package")
def check(truth: Truth) -> Check:
    """Fails with the figures of a window that rests on another picture than `render` draws."""

    def checked(rest: Rest, budgets: Budgets = USUAL) -> None:
        if not truth.verdict(rest, budgets, quality=False).is_right:
            pytest.fail(str(truth.verdict(rest, budgets)))

    return checked


@pytest.fixture
def start(screen: str, tmp_path: Path) -> Start:
    """Opens a window with these arguments, and lets it rest; the stages that follow may be given."""

    def started(
        *arguments: str,
        stages: tuple[Stage, ...] = (),
        settings: Mapping[str, Any] = ALONE,
        size: tuple[int, int] = SIZE,
        **plan: Any,
    ) -> Played:
        played = play(screen, tmp_path, Plan(arguments, stages, **plan), size, settings)
        assert not played.problem, played.problem
        return played

    return started
