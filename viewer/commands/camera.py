"""Commands for the camera: place, bookmarks, recorded paths, and automatic motion."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from ntc.errors import InputError
from viewer.commands.command import Arg, command, field_command, gesture, next_command, setter, unless
from viewer.commands.effects import Effect, WriteText
from viewer.scene.cameras_file import CAMERAS_TEXT, cameras_json, read_cameras
from viewer.scene.json_text import counted, printable
from viewer.scene.model import Camera
from viewer.state.event_handlers import notify
from viewer.state.framing import frame_shown
from viewer.state.motion import Playback, Turntable
from viewer.state.navigation import FREE
from viewer.state.session import Session
from viewer.state.setting import field_args
from viewer.state.settings import ViewerSettings
from viewer.state.view_file import MOST_BOOKMARKS

FIELD_OF_VIEW = replace(
    field_args(ViewerSettings)["fov_degrees"],
    minimum=1.0,
    maximum=179.0,
    suggestion=lambda session: f"{session.view.camera.fov_degrees:g}",
)


def place_camera(session: Session, camera: Camera) -> None:
    """Place the camera, and end any motion."""
    session.navigation.motion = None
    session.view = replace(session.view, camera=camera)


set_camera = gesture("camera.set")(place_camera)


@gesture("camera.fly-faster")
def fly_faster(session: Session, notches: float) -> None:
    session.navigation.speed_notches += notches


@command("camera.frame-all", "Frame all", "frame the whole scene in its present pose", "F", icon="expand")
def frame_all(session: Session) -> None:
    width, height = session.window.picture_size
    camera = replace(session.view.camera, name=FREE)
    place_camera(session, frame_shown(camera, session.scene, width / height, session.view.pose))


@command(
    "camera.next",
    "Next camera",
    "go to the scene's next camera",
    "C",
    unavailable=unless(lambda context: context.session.scene.cameras, "the scene has no cameras"),
)
def next_camera(session: Session) -> None:
    cameras = session.scene.cameras
    names = [camera.name for camera in cameras]
    present = names.index(session.view.camera.name) if session.view.camera.name in names else -1
    place_camera(session, cameras[(present + 1) % len(cameras)])


def _camera_names(session: Session) -> tuple[str, ...]:
    return tuple(camera.name for camera in session.scene.cameras)


@command("camera.go", "Go to camera", "go to a camera of the scene", current=lambda session: session.view.camera.name)
def go(session: Session, name: Annotated[str, Arg("camera of the scene", _camera_names)]) -> None:
    place_camera(session, next(camera for camera in session.scene.cameras if camera.name == name))


def _place(which: Literal["eye", "target"], axis: int) -> Arg:
    """Return the description of a coordinate, for which the palette suggests the present value."""
    what = "place of the camera" if which == "eye" else "place that the camera looks at"
    return Arg(
        f"{what}; scene units, Y up", suggestion=lambda session: f"{getattr(session.view.camera, which)[axis]:.6g}"
    )


@command("camera.look", "Place camera", "place the camera at a point and aim it at another")
def look(
    session: Session,
    eye_x: Annotated[float, _place("eye", 0)],
    eye_y: Annotated[float, _place("eye", 1)],
    eye_z: Annotated[float, _place("eye", 2)],
    target_x: Annotated[float, _place("target", 0)],
    target_y: Annotated[float, _place("target", 1)],
    target_z: Annotated[float, _place("target", 2)],
    fov: Annotated[float, FIELD_OF_VIEW] = 60.0,
) -> None:
    eye, target = (eye_x, eye_y, eye_z), (target_x, target_y, target_z)
    if eye == target:
        raise InputError("camera.look: eye and target are the same place")
    place_camera(session, Camera("free", eye, target, fov_degrees=fov))


mode = field_command("settings.camera_mode", said=lambda mode: f"camera: {mode}")
next_mode = next_command(mode, "camera.next-mode", "Orbit or fly", "switch between orbiting and flying", "V")


@command(
    "camera.record",
    "Record camera path",
    "record the camera's path; the same command again writes it as a cameras file",
    "R",
    current=lambda session: session.navigation.recording is not None,
)
def record(session: Session) -> Effect | None:
    navigation = session.navigation
    if navigation.recording is None:
        navigation.recording = ()
        notify(session, "recording the camera's path; the same command again ends it")
        return None
    path, file = navigation.recording, session.dated_file("-path", ".json")
    navigation.last_path, navigation.recording = path, None
    message = f"wrote {counted(len(path), 'camera')} to {file}; use it with encode --grouping covisible --views"
    return WriteText(file, cameras_json(path), message)


FASTEST_DEGREES = 720.0
USUAL_DEGREES = 30.0
BookmarkName = Annotated[str, Arg("name; an older bookmark of that name is replaced")]


@command("camera.bookmark", "Bookmark", "save the camera under a name")
def bookmark(session: Session, name: BookmarkName) -> None:
    if printable(name) != name or not name:
        raise InputError("camera.bookmark: the name must be one line of at most 200 characters")
    bookmarks = {**session.bookmarks, name: replace(session.view.camera, name=name)}
    if len(bookmarks) > MOST_BOOKMARKS:
        raise InputError(f"camera.bookmark: there are {MOST_BOOKMARKS} bookmarks; use the name of one of them")
    session.navigation.bookmarks = {**session.navigation.bookmarks, session.scene_key: bookmarks}
    notify(session, f"bookmark {name} saved for this session; Save view keeps it in a file")


Bookmark = Annotated[str, Arg("a bookmark of this scene", lambda session: tuple(session.bookmarks))]


@command(
    "camera.go-bookmark",
    "Go to bookmark",
    "go to a bookmarked camera",
    current=lambda session: session.view.camera.name,
)
def go_bookmark(session: Session, name: Bookmark) -> None:
    place_camera(session, session.bookmarks[name])


Degrees = Annotated[float, Arg("speed in degrees per second; negative turns the other way")]


@command("camera.turntable", "Turntable speed", "rotate the camera around the scene's centre at this speed")
def turntable(session: Session, degrees: Degrees = USUAL_DEGREES) -> None:
    if not 0.0 < abs(degrees) <= FASTEST_DEGREES:
        raise InputError(f"camera.turntable: {degrees:g} must be up to {FASTEST_DEGREES:g} either way, not 0")
    session.navigation.motion = Turntable(degrees)


@command(
    "camera.toggle-turntable",
    "Turntable",
    "rotate the camera around the scene's centre until pressed again",
    "Y",
    current=lambda session: isinstance(session.navigation.motion, Turntable),
)
def toggle_turntable(session: Session) -> None:
    turns = isinstance(session.navigation.motion, Turntable)
    session.navigation.motion = None if turns else Turntable(USUAL_DEGREES)


PathFile = Annotated[Path, Arg(f"{CAMERAS_TEXT}; default: the last recorded path")]


@command(
    "camera.play",
    "Play camera path",
    "move the camera along the last recorded path, or along a cameras file",
    "Ctrl+R",
    icon="play",
)
def play(session: Session, file: PathFile = Path()) -> None:
    cameras = session.navigation.last_path if file == Path() else read_cameras(session.file_to_read(file))
    if not cameras:
        raise InputError("camera.play: no path has been recorded yet; name a file, or use camera.record")
    session.navigation.motion = Playback(cameras)


stop = command(
    "camera.stop",
    "Stop camera",
    "stop the turntable or the camera path",
    unavailable=unless(lambda context: context.session.navigation.motion, "the camera does not move by itself"),
    icon="stop",
)(setter("navigation.motion", None))
