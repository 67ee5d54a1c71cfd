"""Plan of a test window, as JSON: its actions until it rests, and delays and memory limits that make the test hard."""

import random
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

import msgspec

from viewer.gl.read_back import ReadBack
from viewer.render.image_sources import ImageSources
from viewer.render.resources.latent_store import LatentBudget
from viewer.scene.model import SceneTexture


@dataclass(frozen=True)
class Stage:
    """Actions on a window at rest, after which it is left alone until it rests again."""

    name: str
    commands: tuple[str, ...] = ()
    """Lines as in scripts. A line that cannot be carried out ends the program."""
    drops: tuple[str, ...] = ()
    """Files that are dropped on the window, before the commands."""


@dataclass(frozen=True)
class Budgets:
    """Memory limits of the test; None for the defaults."""

    latent_bytes: int | None = None
    image_bytes: int | None = None
    tile_megabytes: int | None = None
    """Limit of the tile cache, which a window reads from its settings."""


USUAL = Budgets()


@dataclass(frozen=True)
class Plan:
    """A window from its opening to its end."""

    arguments: tuple[str, ...]
    """Arguments of `ntc-viewer view`."""
    stages: tuple[Stage, ...] = ()
    """Stages after the first rest, which is called `start`."""
    budgets: Budgets = USUAL
    slowest_read: float = 0.0
    """Largest added delay in seconds of reading an image."""
    slowest_answer: float = 0.0
    """Largest added delay in seconds of data that is read back from the GPU."""
    seed: int = 0
    """Seed of the random delays."""
    records_figures: bool = False
    """True to record pictures of frames whose figures are called current."""
    idle_seconds: float = 0.0
    """Seconds for which the last rest is watched."""
    patience: float = 90.0
    """Most seconds until a window rests."""


def plan_of(text: bytes) -> Plan:
    """The plan in JSON text."""
    return msgspec.json.decode(text, type=Plan)


@contextmanager
def small_budgets(budgets: Budgets) -> Iterator[None]:
    """Give objects that are made within the block these limits, where none are given."""
    with _default_of(LatentBudget, budgets.latent_bytes), _default_of(ImageSources, budgets.image_bytes):
        yield


@contextmanager
def _default_of(kind: type[Any], last: int | None) -> Iterator[None]:
    """Change the last default of `kind`, a number of bytes, within the block; None: unchanged."""
    if last is None:
        yield
        return
    make: Any = kind.__init__
    before = make.__defaults__
    assert isinstance(before[-1], int), f"{kind.__name__}: its last default is no number of bytes"
    make.__defaults__ = (*before[:-1], last)
    try:
        yield
    finally:
        make.__defaults__ = before


class SlowReading:
    """Random delays, of one seed, of images and of data that is read back from the GPU, for the rest of the process."""

    def __init__(self, plan: Plan) -> None:
        self.delays: list[float] = []
        """Seconds, in the order in which they were drawn."""
        self._plan, self._random = plan, random.Random(plan.seed)
        self._due: dict[int, float] = {}
        """Monotonic seconds before which an answer is not there, by the object that reads it back."""

    def _delay(self, longest: float) -> float:
        # Threads that draw at the same time draw different numbers: `random` is locked by the interpreter.
        self.delays.append(self._random.random() * longest)
        return self.delays[-1]

    def install(self) -> None:
        """Begin to delay."""
        if self._plan.slowest_read > 0.0:
            for name in ("pixels", "further_maps"):
                self._slow_property(name)
        if self._plan.slowest_answer > 0.0:
            self._slow_answers()

    def _slow_property(self, name: str) -> None:
        read: Any = vars(SceneTexture)[name].fget

        def slow(texture: SceneTexture) -> Any:
            time.sleep(self._delay(self._plan.slowest_read))
            return read(texture)

        mock.patch.object(SceneTexture, name, property(slow)).start()

    def _slow_answers(self) -> None:
        arrived: Any = ReadBack.arrived

        def late(back: ReadBack[Any], waits: bool) -> Any:
            if not back.is_pending:
                return arrived(back, waits)
            if waits:
                # Who waits gets it.
                self._due[id(back)] = 0.0
                return arrived(back, waits)
            now = time.monotonic()
            if now < self._due.setdefault(id(back), now + self._delay(self._plan.slowest_answer)):
                return None
            answer = arrived(back, waits)
            if answer is not None:
                del self._due[id(back)]
            return answer

        mock.patch.object(ReadBack, "arrived", late).start()


def write_plan(path: Path, plan: Plan) -> Path:
    """Write `plan` as JSON."""
    path.write_bytes(msgspec.json.encode(plan))
    return path
