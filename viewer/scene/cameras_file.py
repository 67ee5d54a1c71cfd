"""Camera files: JSON [{"name", "eye", "target", "fov" (vertical, degrees)}]."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ntc.errors import InputError
from ntc.reading import read_file
from viewer.scene.gltf.container import describe, printable
from viewer.scene.model import Camera

LARGEST_FILE = 1 << 26
"""Bytes: half a million cameras."""
NAMES_SHOWN = 20
"""Names that the message about a missing camera lists."""


def _vector(value: Any, where: str) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise InputError(f"{where}: must be three numbers")
    x, y, z = (_number(component, where) for component in value)
    return x, y, z


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e30:
        raise InputError(f"{where}: must be a finite number, not {describe(value)}")
    return float(value)


def _camera(entry: Any, where: str) -> Camera:
    if not isinstance(entry, dict):
        raise InputError(f"{where}: must be an object with name, eye, target and fov")
    for key in ("name", "eye", "target"):
        if key not in entry:
            raise InputError(f"{where}: lacks {key!r}")
    name = printable(entry["name"]) if isinstance(entry["name"], str) else ""
    if not name:
        raise InputError(f"{where}.name: must be a text")
    eye = _vector(entry["eye"], f"{where}.eye")
    target = _vector(entry["target"], f"{where}.target")
    fov = _number(entry.get("fov", 60.0), f"{where}.fov")
    if not 0.0 < fov < 180.0:
        raise InputError(f"{where}.fov: {fov:g} must lie between 0 and 180 degrees")
    if math.dist(eye, target) == 0.0:
        raise InputError(f"{where}: eye and target are the same point; move one")
    return Camera(name=name, eye=eye, target=target, fov_degrees=fov)


def read_cameras(path: Path) -> tuple[Camera, ...]:
    """Cameras of the file at `path`, at least one, with distinct names. Raises InputError."""
    try:
        content = json.loads(read_file(Path(path), LARGEST_FILE).decode("utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not valid JSON ({error})") from error
    if not isinstance(content, list) or not content:
        raise InputError(f"{path}: must be a list of cameras, each with name, eye, target and fov")
    cameras = tuple(_camera(entry, f"{path}: camera {index}") for index, entry in enumerate(content))
    taken: set[str] = set()
    for camera in cameras:
        if camera.name in taken:
            raise InputError(f"{path}: two cameras are called {camera.name!r}; rename one")
        taken.add(camera.name)
    return cameras


def find_camera(cameras: Sequence[Camera], name: str) -> Camera:
    """The camera called `name`. Raises InputError that lists the names there are."""
    for camera in cameras:
        if camera.name == name:
            return camera
    there = ", ".join(camera.name for camera in cameras[:NAMES_SHOWN]) or "none"
    if len(cameras) > NAMES_SHOWN:
        there += f" and {len(cameras) - NAMES_SHOWN} more"
    raise InputError(f"--camera {name}: no such camera (there are: {there})")


def cameras_json(cameras: Sequence[Camera]) -> str:
    """The text of a camera file that `read_cameras` reads back."""
    entries = [
        {"name": camera.name, "eye": camera.eye, "target": camera.target, "fov": camera.fov_degrees}
        for camera in cameras
    ]
    return json.dumps(entries, indent=1) + "\n"
