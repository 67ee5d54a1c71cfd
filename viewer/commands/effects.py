"""What a command asks to be done outside the session. `viewer/app/effects.py` does each at its point of a frame."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from viewer.state.view_state import PictureAlone
from viewer.training.live_training import Decision

PictureKind = Literal["window", PictureAlone]


@dataclass(frozen=True)
class RunCommand:
    """Run another command after the one that returns this."""

    command_id: str
    values: tuple[Any, ...] = ()
    announced: str = ""
    """What a frame says before it is run, for a command that holds up the window; "" to run it at once."""


@dataclass(frozen=True)
class OpenScene:
    """Read a scene beside the frames, then open it."""

    path: Path
    decision: Decision | None = None
    """What becomes of the runs of the scene before; None where nobody was asked."""
    then: RunCommand | None = None
    """What is run when the scene is open."""


@dataclass(frozen=True)
class ReadVariant:
    """Read the open scene again beside the frames, in another material variant."""

    variant: str


@dataclass(frozen=True)
class CancelOpening:
    """End the reading of a scene."""


@dataclass(frozen=True)
class WriteText:
    """Write a text file at once. Raises InputError."""

    path: Path
    text: str
    message: str
    """What is shown once it is written."""


@dataclass(frozen=True)
class RaisePanel:
    """Bring the panel of this title to the front."""

    title: str


@dataclass(frozen=True)
class ResetLayout:
    """Dock all panels where they are at first."""


@dataclass(frozen=True)
class Measure:
    """Measure both slots in the next whole picture."""


@dataclass(frozen=True)
class TakePicture:
    """Write the next whole picture as a PNG."""

    kind: PictureKind = "window"
    """The window's content, or the picture alone: as shown, of one side, of both with the divider, without overlay."""
    file: Path | None = None
    """Relative to the folder of pictures; None: a name with the time in it."""
    quiet: bool = False
    """Show no message when it has been written: it would be in the next picture."""


@dataclass(frozen=True)
class TakeFilm:
    """Film the window's content from now on."""

    file: Path | None
    """Relative to the folder of pictures; None ends the film and writes it."""


@dataclass(frozen=True)
class CloseWindow:
    """End the program after this frame."""


Effect = (
    RunCommand
    | OpenScene
    | ReadVariant
    | CancelOpening
    | WriteText
    | RaisePanel
    | ResetLayout
    | Measure
    | TakePicture
    | TakeFilm
    | CloseWindow
)
