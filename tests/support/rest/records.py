"""Records of windows at rest, and the start of a test window that writes them."""

import json
import pickle
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.window_trials.virtual_display import remembering_in
from tests.support.rest.plan import Plan, write_plan
from viewer.state.view_state import PathChoice, Slot, ViewState

ROOT = Path(__file__).resolve().parents[3]
SIZE = (320, 200)
"""Size of the smallest window that settings may name. Smaller ones are refused, and the window has its default size and panels."""
ALONE = {"show_panels": False, "first_steps": False, "prepare_encoding": False, "column_folded": False}
"""Settings of a window that shows the picture alone, and prepares nothing."""
STARTING_SECONDS = 120.0
"""Seconds that a program may take besides its plan's patience."""


@dataclass(frozen=True, eq=False)
class Figures:
    """Figures that panels showed for the picture of a frame."""

    frame: int
    is_current: bool
    psnr_db: float | None
    picture: NDArray[np.uint8] | None
    """[H, W, 3] the picture, where panels called the figures current."""


@dataclass(frozen=True, eq=False)
class Rest:
    """Window at rest: the screen, and the state that it shows."""

    name: str
    """Name of the stage."""
    scene: Path | None
    packs: Mapping[str, Path]
    """Copies of the open packs by their names."""
    view: ViewState
    """View of the session."""
    image: NDArray[np.uint8]
    """[H, W, 3] sRGB, row 0 on top: the picture."""
    screen: NDArray[np.uint8]
    """[H, W, 3]: the window as the window system shows it."""
    interface: NDArray[np.bool_]
    """[H, W] mask of the pixels that the user interface covers."""
    corner: tuple[int, int]
    """Where the picture lies in the window: its left and top in pixels."""
    paths: Mapping[Slot, PathChoice]
    """Paths that `auto` chose for the slots."""
    frames: int
    """Figures shown until the window rested."""
    seconds: float
    """Time until the window rested."""
    figures: tuple[Figures, ...] = ()
    messages: tuple[str, ...] = field(default=())
    """All messages."""

    @property
    def screen_agrees(self) -> float:
        """Share of the pixels of the screen beside the interface that are those of the picture, within 1/255."""
        (left, top), (height, width, _) = self.corner, self.image.shape
        part = slice(top, top + height), slice(left, left + width)
        free = ~self.interface[part]
        return share_equal(self.screen[part][free], self.image[free])


@dataclass(frozen=True)
class Idle:
    """Window at rest that was watched for changes."""

    seconds: float
    frames: int
    """Figures shown meanwhile."""
    processor_seconds: float


def share_equal(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float:
    """Share of the pixels [..., 3] whose channels all differ by 1 at most; 0 for pictures of different sizes."""
    if a.shape != b.shape:
        return 0.0
    return float((np.abs(a.astype(np.int16) - b) <= 1).all(axis=-1).mean())


def write_rest(folder: Path, number: int, rest: Rest | Idle) -> None:
    """Write the rest that stage `number` has ended in."""
    (folder / f"{number:03}.rest").write_bytes(pickle.dumps(rest))


@dataclass(frozen=True, eq=False)
class Played:
    """Result of a plan."""

    rests: tuple[Rest, ...]
    idle: Idle | None
    problem: str
    """Exit status and last lines of a program that ended with an error; else ""."""

    def of(self, stage: str) -> Rest:
        """The rest that a stage ended in. Raises LookupError with what the program said."""
        for rest in self.rests:
            if rest.name == stage:
                return rest
        raise LookupError(f"no rest of {stage!r}: {self.problem or 'the plan has no such stage'}")


def play(
    display: str,
    folder: Path,
    plan: Plan,
    size: tuple[int, int] = SIZE,
    settings: Mapping[str, Any] = ALONE,
) -> Played:
    """Open a window of `size` and let it follow `plan`, with its settings and files in `folder`."""
    if plan.budgets.tile_megabytes is not None:
        settings = {**settings, "tile_cache_megabytes": plan.budgets.tile_megabytes}
    (folder / "config").mkdir(parents=True, exist_ok=True)
    (folder / "config" / "settings.json").write_text(json.dumps({**settings, "window_size": size}))
    written = folder / "rests"
    written.mkdir()
    path = write_plan(folder / "plan.json", plan)
    patience = STARTING_SECONDS + plan.patience * (1 + len(plan.stages)) + plan.idle_seconds
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.rest.window_at_rest", str(path), str(written)],
        cwd=ROOT,
        env=remembering_in(folder, display),
        capture_output=True,
        text=True,
        timeout=patience,
        check=False,
    )
    records = [pickle.loads(file.read_bytes()) for file in sorted(written.glob("*.rest"))]
    rests = tuple(rest for rest in records if isinstance(rest, Rest))
    failed = done.returncode != 0 or "Traceback" in done.stderr
    problem = f"exit status {done.returncode}: {done.stderr[-2000:]}" if failed else ""
    if rests and rests[0].screen.shape[1::-1] != size:
        problem += f"the window has {rests[0].screen.shape[1::-1]} pixels, not {size}: {rests[0].messages}"
    return Played(rests, next((rest for rest in records if isinstance(rest, Idle)), None), problem)
