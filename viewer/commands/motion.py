"""Commands: bookmarks of cameras, and cameras that move by themselves."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from ntc.errors import InputError
from viewer.commands.camera import place_camera
from viewer.commands.command import Arg, Context, command, switch
from viewer.scene.cameras_file import read_cameras
from viewer.scene.json_text import printable
from viewer.state.camera_motion import Playback, Turntable
from viewer.state.event_handlers import notify
from viewer.state.session import Session
from viewer.state.view_file import MOST_BOOKMARKS

FASTEST_DEGREES = 720.0
USUAL_DEGREES = 30.0
BookmarkName = Annotated[str, Arg("any name; an older bookmark of that name is replaced")]


@command("camera.bookmark", "Bookmark", "remember where the camera is, under a name", "Camera")
def bookmark(session: Session, name: BookmarkName) -> None:
    if printable(name) != name or not name:
        raise InputError("camera.bookmark: the name must be one line of at most 200 letters")
    bookmarks = {**session.bookmarks, name: replace(session.view.camera, name=name)}
    if len(bookmarks) > MOST_BOOKMARKS:
        raise InputError(f"camera.bookmark: there are {MOST_BOOKMARKS} bookmarks; use the name of one of them")
    session.navigation.bookmarks = {**session.navigation.bookmarks, session.scene_key: bookmarks}
    notify(session, f"bookmark {name}; view.save keeps it in a file")


Bookmark = Annotated[str, Arg("a bookmark of this scene", lambda session: tuple(session.bookmarks))]


@command(
    "camera.go-bookmark",
    "Go to bookmark",
    "go back to a bookmark",
    "Camera",
    current=lambda session: session.view.camera.name,
)
def go_bookmark(session: Session, name: Bookmark) -> None:
    place_camera(session, session.bookmarks[name])


Degrees = Annotated[float, Arg("degrees per second; negative turns the other way")]


@command("camera.turntable", "Turntable at a speed", "turn the camera about the scene's centre at this speed", "Camera")
def turntable(session: Session, degrees: Degrees = USUAL_DEGREES) -> None:
    if not 0.0 < abs(degrees) <= FASTEST_DEGREES:
        raise InputError(f"camera.turntable: {degrees:g} must be up to {FASTEST_DEGREES:g} either way, not 0")
    session.navigation.motion = Turntable(degrees)


@command(
    "camera.toggle-turntable",
    "Turntable",
    "turn the camera about the scene's centre until pressed again",
    "Camera",
    "Y",
    current=switch(lambda session: isinstance(session.navigation.motion, Turntable)),
)
def toggle_turntable(session: Session) -> None:
    turns = isinstance(session.navigation.motion, Turntable)
    session.navigation.motion = None if turns else Turntable(USUAL_DEGREES)


PathFile = Annotated[Path, Arg("a cameras file; without one, the path recorded last")]


@command(
    "camera.play",
    "Play a path",
    "move along the path that was recorded last, or along a cameras file",
    "Camera",
    "Ctrl+R",
)
def play(session: Session, file: PathFile = Path()) -> None:
    cameras = session.navigation.last_path if file == Path() else read_cameras(session.file_to_read(file))
    if not cameras:
        raise InputError("camera.play: no path has been recorded yet; name a file, or use camera.record")
    session.navigation.motion = Playback(cameras)


def _camera_rests(context: Context) -> str:
    return "the camera does not move by itself" if context.session.navigation.motion is None else ""


@command(
    "camera.stop",
    "Stop the camera",
    "end the turntable, or the path that is played",
    "Camera",
    unavailable=_camera_rests,
)
def stop(session: Session) -> None:
    session.navigation.motion = None
