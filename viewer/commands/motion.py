"""Commands: bookmarks of cameras, and cameras that move by themselves."""

from dataclasses import replace
from pathlib import Path

from ntc.errors import InputError
from viewer.commands.command import Command, Parameter
from viewer.scene.cameras_file import read_cameras
from viewer.scene.json_text import printable
from viewer.state.actions import SetCamera
from viewer.state.camera_motion import Playback, Turntable
from viewer.state.session import Session
from viewer.state.view_file import MOST_BOOKMARKS

FASTEST_DEGREES = 720.0
LAST_PATH = ""
"""As a file: the path that was recorded last."""


def _bookmark(session: Session, name: str) -> None:
    if printable(name) != name or not name:
        raise InputError("camera.bookmark: the name must be one line of at most 200 letters")
    bookmarks = {**session.bookmarks, name: replace(session.view.camera, name=name)}
    if len(bookmarks) > MOST_BOOKMARKS:
        raise InputError(f"camera.bookmark: there are {MOST_BOOKMARKS} bookmarks; use the name of one of them")
    session.keep_bookmarks(bookmarks)
    session.say(f"bookmark {name}; view.save keeps it in a file")


def _go_bookmark(session: Session, name: str) -> None:
    session.apply(SetCamera(session.bookmarks[name]))


def _turntable(session: Session, degrees_per_second: float) -> None:
    if not 0.0 < abs(degrees_per_second) <= FASTEST_DEGREES:
        raise InputError(
            f"camera.turntable: {degrees_per_second:g} must be up to {FASTEST_DEGREES:g} either way, not 0"
        )
    session.motion = Turntable(degrees_per_second)


def _toggle_turntable(session: Session) -> None:
    if isinstance(session.motion, Turntable):
        session.motion = None
    else:
        _turntable(session, float(DEGREES.default or 0.0))


def _play(session: Session, file: Path) -> None:
    if file == Path(LAST_PATH):
        cameras = session.last_path
        if not cameras:
            raise InputError("camera.play: no path has been recorded yet; name a file, or use camera.record")
    else:
        cameras = read_cameras(session.file_named(file))
    session.motion = Playback(cameras)


def _stop(session: Session) -> None:
    session.motion = None


NAME = Parameter("name", "text", "any name; an older bookmark of that name is replaced")
BOOKMARK = Parameter("name", "choice", "a bookmark of this scene", lambda session: tuple(session.bookmarks))
DEGREES = Parameter("degrees", "number", "degrees per second; negative turns the other way", default="30")
FILE = Parameter("file", "path", "a cameras file; without one, the path recorded last", default=LAST_PATH)
COMMANDS = (
    Command("camera.bookmark", "Bookmark", "remember where the camera is", "Camera", _bookmark, (NAME,)),
    Command("camera.go-bookmark", "Go to bookmark", "go back to a bookmark", "Camera", _go_bookmark, (BOOKMARK,)),
    Command(
        "camera.turntable", "Turntable at a speed", "turn about the scene's centre", "Camera", _turntable, (DEGREES,)
    ),
    Command(
        "camera.toggle-turntable",
        "Turntable",
        "turn about the scene's centre, until pressed again",
        "Camera",
        _toggle_turntable,
        key="Y",
    ),
    Command("camera.play", "Play path", "go along a recorded path", "Camera", _play, (FILE,), key="Ctrl+R"),
    Command("camera.stop", "Stop camera", "end turntable or path", "Camera", _stop),
)
