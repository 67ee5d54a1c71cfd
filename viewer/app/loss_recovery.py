"""Recovery from a lost OpenGL context: attempts to open a new window, and the view that is saved at the end."""

import shlex
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, TypeVar

from ntc.errors import InputError
from ntc.io import write_text
from viewer.gl.context_loss import ContextLostError
from viewer.state.pack_files import packs_beside
from viewer.state.session import Session
from viewer.state.view_file import present_view, view_json

RECOVERED: Final = "the graphics driver was reset; everything was uploaded again"
MOST_LOSSES = 3
"""Number of losses within LOSS_SECONDS that ends the window."""
LOSS_SECONDS = 60.0
RESET_SECONDS = 2.0
"""Longest wait for the end of a driver's reset, in seconds."""
PAUSES: Final = (0.0, 1.0, 3.0)
"""Seconds before each attempt to open a new window: a driver that restarts is not there at once."""

Opened = TypeVar("Opened")


class LossHistory:
    """Times at which contexts were lost."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._losses: deque[float] = deque(maxlen=MOST_LOSSES)

    def add(self) -> bool:
        """Record a loss; returns True where too many came in a short time."""
        self._losses.append(self._clock())
        return len(self._losses) == MOST_LOSSES and self._losses[-1] - self._losses[0] <= LOSS_SECONDS


def open_again(open_window: Callable[[], Opened], pauses: Sequence[float] = PAUSES) -> Opened:
    """Return the result of `open_window`, which is tried after each of `pauses`. Raises the InputError of the last attempt."""
    for pause in pauses[:-1]:
        time.sleep(pause)
        try:
            return open_window()
        except InputError:
            continue
    time.sleep(pauses[-1])
    return open_window()


def _command(session: Session, view: Path) -> str:
    """Return the command line that opens `view` again."""
    scene, packs = session.scene.path, [pack.path for pack in session.packs.values() if pack.path is not None]
    beside = {path.resolve() for path in packs_beside(scene)} if scene is not None else set()
    named = [str(path.resolve()) for path in packs if path.resolve() not in beside]
    arguments = [
        "ntc-viewer",
        "view",
        *([str(scene.resolve())] if scene is not None else []),
        *(["--pack", *named] if named else []),
        "--exec",
        f"view.load {shlex.quote(str(view))}",
        *(["--exec", f"materials.variant {shlex.quote(session.scene.variant)}"] if session.scene.variant else []),
    ]
    return shlex.join(arguments)


def context_lost_error(session: Session, lost: ContextLostError, why: str) -> InputError:
    """Save the view to a file, and return the error to end with; `why` says why there is no new window."""
    path = session.dated_file("-view", ".json").resolve()
    try:
        write_text(path, view_json(present_view(session)))
    except InputError as error:
        return InputError(f"{lost}, {why}; the view could not be saved: {error}")
    return InputError(f"{lost}, {why}; the view is saved; to open it again: {_command(session, path)}")
