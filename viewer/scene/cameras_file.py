"""Camera files: JSON [{"name", "eye", "target", "fov" (vertical, degrees)}]."""

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import msgspec

from ntc.errors import InputError
from ntc.io import read_file
from viewer.scene.json_text import Vector, convert, nonempty_line, parse_json
from viewer.scene.model import Camera, Scene
from viewer.scene.scene_files import CAMERAS_FILE

CAMERAS_TEXT = "JSON file of cameras"
"""Description of a cameras file in help texts."""
LARGEST_FILE = 1 << 26
"""Most bytes of a cameras file: half a million cameras."""
NAMES_SHOWN = 20
"""Names that the message about a missing camera lists."""
REMEDY = "give a list of cameras, each with name, eye, target and fov"


class Viewpoint(msgspec.Struct):
    """Fields of every camera in JSON. Lengths are in scene units."""

    name: str
    eye: Vector
    target: Vector

    def __post_init__(self) -> None:
        """Raises ValueError for an empty name and where the viewing direction is undefined."""
        self.name = nonempty_line(self.name)
        if math.dist(self.eye, self.target) == 0.0:
            raise ValueError("eye and target are the same point: move one")


class CameraEntry(Viewpoint):
    """Camera as a cameras file describes it."""

    fov: Annotated[float, msgspec.Meta(gt=0.0, lt=180.0)] = 60.0


def read_cameras(path: Path) -> tuple[Camera, ...]:
    """Return the cameras of the file at `path`, at least one, with distinct names. Raises InputError."""
    try:
        data = read_file(Path(path), LARGEST_FILE)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    entries = convert(parse_json(data, str(path), REMEDY), list[CameraEntry], str(path), REMEDY)
    if not entries:
        raise InputError(f"{path}: holds no camera; {REMEDY}")
    cameras: dict[str, Camera] = {}
    for entry in entries:
        if entry.name in cameras:
            raise InputError(f"{path}: two cameras are called {entry.name!r}; rename one")
        cameras[entry.name] = Camera(entry.name, entry.eye, entry.target, fov_degrees=entry.fov)
    return tuple(cameras.values())


def find_camera(cameras: Sequence[Camera], name: str) -> Camera:
    """Return the camera called `name`. Raises InputError that lists the names there are."""
    for camera in cameras:
        if camera.name == name:
            return camera
    there = ", ".join(camera.name for camera in cameras[:NAMES_SHOWN]) or "none"
    if len(cameras) > NAMES_SHOWN:
        there += f" and {len(cameras) - NAMES_SHOWN} more"
    raise InputError(f"--camera {name}: no such camera (there are: {there})")


def cameras_json(cameras: Sequence[Camera]) -> str:
    """Return the text of a camera file that `read_cameras` reads back."""
    entries = [
        {"name": camera.name, "eye": camera.eye, "target": camera.target, "fov": camera.fov_degrees}
        for camera in cameras
    ]
    return json.dumps(entries, indent=1) + "\n"


def cameras_beside(scene_path: Path) -> Path | None:
    """Return the cameras file of a scene: `NAME.cameras.json` beside it, else `cameras.json`; None without one."""
    candidates = (
        scene_path.with_name(f"{scene_path.stem}.{CAMERAS_FILE}"),
        scene_path.with_name(CAMERAS_FILE),
    )
    return next((path for path in candidates if path.is_file()), None)


def with_cameras_beside(scene: Scene) -> Scene:
    """Return `scene` with the cameras of the cameras file beside it first; they replace cameras of the same name.

    Raises InputError where that file cannot be read.
    """
    path = cameras_beside(scene.path) if scene.path is not None else None
    if path is None:
        return scene
    file_cameras = read_cameras(path)
    names = {camera.name for camera in file_cameras}
    return replace(scene, cameras=(*file_cameras, *(camera for camera in scene.cameras if camera.name not in names)))
