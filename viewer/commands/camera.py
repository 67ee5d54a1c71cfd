"""Commands: where the picture is seen from."""

from dataclasses import replace

from ntc.errors import InputError
from viewer.commands.command import Command, Parameter, fixed
from viewer.scene.model import Camera
from viewer.state.actions import SetCamera
from viewer.state.navigation import frame
from viewer.state.session import Session
from viewer.state.settings import CameraMode


def _frame_all(session: Session) -> None:
    aspect = session.picture_size[0] / session.picture_size[1]
    session.apply(SetCamera(frame(session.view.camera, session.scene.bounds, aspect)))


def _next_camera(session: Session) -> None:
    cameras = session.scene.cameras
    if not cameras:
        session.say("the scene has no cameras")
        return
    names = [camera.name for camera in cameras]
    present = names.index(session.view.camera.name) if session.view.camera.name in names else -1
    session.apply(SetCamera(cameras[(present + 1) % len(cameras)]))


def _go(session: Session, name: str) -> None:
    session.apply(SetCamera(next(camera for camera in session.scene.cameras if camera.name == name)))


def _look(session: Session, *numbers: float) -> None:
    eye, target, fov = numbers[:3], numbers[3:6], numbers[6]
    if eye == target:
        raise InputError("camera.look: eye and target are the same place")
    if not 1.0 <= fov <= 179.0:
        raise InputError(f"camera.look: fov {fov:g} must be 1 to 179 degrees")
    place = (eye[0], eye[1], eye[2]), (target[0], target[1], target[2])
    session.apply(SetCamera(Camera("free", *place, fov_degrees=fov)))


def _mode(session: Session, mode: CameraMode) -> None:
    session.settings = replace(session.settings, camera_mode=mode)
    session.say(f"camera: {mode}")


def _next_mode(session: Session) -> None:
    _mode(session, "fly" if session.settings.camera_mode == "orbit" else "orbit")


def _record(session: Session) -> None:
    if session.recording is None:
        session.recording = ()
        session.say("recording the camera's path; the same key ends it")
    else:
        session.recorded_path, session.recording = session.recording, None
        session.last_path = session.recorded_path


NAME = Parameter("name", "choice", "camera of the scene", lambda s: tuple(camera.name for camera in s.scene.cameras))
MODE = Parameter("mode", "choice", "how the mouse moves it", fixed("orbit", "fly"))
PLACE = tuple(
    Parameter(f"{what}_{axis}", "number", "scene units, Y up") for what in ("eye", "target") for axis in "xyz"
)
FOV = Parameter("fov", "number", "vertical field of view, degrees", default="60")
COMMANDS = (
    Command("camera.frame-all", "Frame all", "see the whole scene", "Camera", _frame_all, key="F"),
    Command("camera.next", "Next camera", "go to the scene's next camera", "Camera", _next_camera, key="C"),
    Command("camera.go", "Camera", "go to a camera of the scene", "Camera", _go, (NAME,)),
    Command("camera.look", "Look", "look from a place at another", "Camera", _look, (*PLACE, FOV)),
    Command("camera.next-mode", "Orbit or fly", "switch between orbiting and flying", "Camera", _next_mode, key="V"),
    Command("camera.mode", "Camera mode", "how the mouse moves the camera", "Camera", _mode, (MODE,)),
    Command(
        "camera.record",
        "Record path",
        "record the camera's path as a cameras file, until pressed again",
        "Camera",
        _record,
        key="R",
    ),
)
