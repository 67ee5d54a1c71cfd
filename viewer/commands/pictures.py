"""Commands: screenshots."""

from pathlib import Path
from typing import get_args

from ntc.errors import InputError
from viewer.commands.command import Command, Parameter, fixed
from viewer.state.picture_request import PictureKind, PictureRequest
from viewer.state.session import Session

DATED = ""
"""As a file: a name with the scene's name and the time in it."""


def _picture(session: Session, kind: PictureKind, file: Path) -> None:
    dated = file == Path(DATED)
    if not dated and file.suffix.lower() != ".png":
        raise InputError(f"{file}: the name of a picture must end in .png")
    session.want_picture(PictureRequest(kind, None if dated else file))


def _screenshot(session: Session, file: Path) -> None:
    _picture(session, "window", file)


KIND = Parameter(
    "kind",
    "choice",
    "the picture alone: as shown, side a, side b, both with the divider, or without overlay",
    fixed(*(kind for kind in get_args(PictureKind) if kind != "window")),
)
FILE = Parameter("file", "path", "a .png, in the folder of pictures unless it is absolute", default=DATED)
COMMANDS = (
    Command(
        "file.screenshot", "Screenshot", "write the window's content as a PNG", "File", _screenshot, (FILE,), key="F12"
    ),
    Command(
        "file.screenshot-picture",
        "Screenshot of the picture",
        "write the picture without the interface as a PNG",
        "File",
        _picture,
        (KIND, FILE),
    ),
)
