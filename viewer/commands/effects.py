"""Effects of commands outside the session. `viewer/app/effects.py` carries out each effect at its point of a frame."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from viewer.export import ExportRequest
from viewer.state.view_state import PictureAlone

PictureKind = Literal["window", PictureAlone]


class Effect:
    """Request of a command to the window."""


@dataclass(frozen=True)
class RunCommand(Effect):
    """Run another command after the one that returns this."""

    command_id: str
    values: tuple[Any, ...] = ()
    announced: str = ""
    """Notice that is shown for one frame before a slow command runs; "" runs the command at once."""


@dataclass(frozen=True)
class OpenScene(Effect):
    """Read a scene in the background, then open it."""

    path: Path


@dataclass(frozen=True)
class ReadVariant(Effect):
    """Read the open scene again in the background, in another material variant."""

    variant: str


@dataclass(frozen=True)
class CancelOpening(Effect):
    """End the reading of a scene."""


@dataclass(frozen=True)
class WriteText(Effect):
    """Write a file at once. Raises InputError."""

    path: Path
    text: str | bytes
    message: str
    """Message to show when the file is written; "" for none."""
    then: Effect | None = None
    """Effect to carry out afterwards."""


@dataclass(frozen=True)
class Export(Effect):
    """Export in the background."""

    title: str
    """Name of the work in the window."""
    request: ExportRequest
    folder: Path
    """Folder that the files are written into."""


@dataclass(frozen=True)
class CancelExport(Effect):
    """End the export under way."""


@dataclass(frozen=True)
class RaisePanel(Effect):
    """Bring the panel of this title to the front."""

    title: str


@dataclass(frozen=True)
class ResetLayout(Effect):
    """Dock all panels in their original places."""


@dataclass(frozen=True)
class Measure(Effect):
    """Measure both slots in the next complete picture."""


@dataclass(frozen=True)
class TakePicture(Effect):
    """Write the next complete picture as a PNG."""

    kind: PictureKind = "window"
    """Content of the picture: the whole window, or only the picture (`PictureAlone`)."""
    file: Path | None = None
    """File to write, relative to the folder of pictures; None makes a name from scene and time."""
    quiet: bool = False
    """Write without a message, which the next picture would show."""


@dataclass(frozen=True)
class TakeFilm(Effect):
    """Film the window's content from now on."""

    file: Path | None
    """File to write, relative to the folder of pictures; None ends the film and writes it."""


@dataclass(frozen=True)
class CloseWindow(Effect):
    """End the program after this frame."""
