"""Commands: files, the window and its panels."""

from dataclasses import replace
from pathlib import Path

from ntc.errors import InputError
from viewer.commands.command import Command, Parameter, fixed
from viewer.state.actions import OpenFile
from viewer.state.session import Session
from viewer.state.zoom import WHOLE


def _open(session: Session, path: Path) -> None:
    session.apply(OpenFile(path))


def _whole_picture(session: Session) -> None:
    session.view = replace(session.view, zoom=WHOLE)


def _resolution(session: Session, share: float) -> None:
    if not 0.05 <= share <= 1.0:
        raise InputError(f"view.resolution: {share:g} must be 0.05 to 1")
    session.resolution = share


def _coarse(session: Session, state: str) -> None:
    session.settings = replace(session.settings, coarse_while_moving=state == "on")


def _panels(session: Session) -> None:
    session.show_panels = not session.show_panels


def _help(session: Session) -> None:
    session.show_help = not session.show_help


def _palette(session: Session) -> None:
    session.palette = None if session.palette is not None else ""


def _close(session: Session) -> None:
    if session.show_help:
        session.show_help = False
    else:
        session.closing = True


FILE = Parameter("file", "path", "a .gltf, .glb or .ntc")
SHARE = Parameter("share", "number", "of the window's pixels along a side, 0.05 to 1")
STATE = Parameter("state", "choice", "on or off", fixed("on", "off"))
COMMANDS = (
    Command("file.open", "Open", "open a scene or a pack", "File", _open, (FILE,)),
    Command(
        "view.whole", "Whole picture", "see the whole picture again after Ctrl + wheel", "View", _whole_picture, key="Z"
    ),
    Command("view.resolution", "Resolution", "draw fewer pixels", "View", _resolution, (SHARE,)),
    Command(
        "view.coarse-while-moving",
        "Coarse while moving",
        "draw fewer pixels while the camera moves",
        "View",
        _coarse,
        (STATE,),
    ),
    Command("window.panels", "Panels", "hide or show the panels", "Window", _panels, key="H"),
    Command(
        "help.palette",
        "Command palette",
        "find a command by typing",
        "Help",
        _palette,
        key="Ctrl+P",
        second_key="F3",
    ),
    Command("help.keys", "Keys and mouse", "show keys and mouse", "Help", _help, key="F1", second_key="Shift+/"),
    Command("window.close", "Close", "close the help, else the window", "Window", _close, key="Escape"),
)
