"""Cameras of the node graph, in world space."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.nodes import NodePlacements
from viewer.scene.model import Camera, Light
from viewer.scene.report import ReportNotes


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64] | None:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-20 else None


def _vector(values: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _positive(file: GltfFile, owner: dict[str, object], key: str, where: str) -> float | None:
    value = file.number(owner, key, where, 0.0)
    return value if value > 0.0 else None


def _camera(
    file: GltfFile, placement: NodePlacements, index: int, name: str, center: NDArray[np.float64]
) -> Camera | None:
    """Return the camera on the node `placement`; None when the node's transform leaves it no direction."""
    entry = file.entries("cameras")[index]
    where = f"cameras[{index}]"
    eye = placement.world[:3, 3]
    forward, up = _unit(-placement.world[:3, 2]), _unit(placement.world[:3, 1])
    if forward is None or up is None or np.linalg.norm(np.cross(forward, up)) < 1e-6:
        return None
    # The target only fixes the direction; at the scene's depth it is also a good point to orbit around.
    depth = float(np.dot(center - eye, forward))
    target = eye + forward * (depth if depth > 1e-3 else 1.0)
    kind = file.text(entry, "type", where)
    if kind not in ("perspective", "orthographic"):
        raise file.fail(f"{where}.type", f"{kind!r:.20} is neither perspective nor orthographic")
    lens = file.object(entry, kind, where)
    where = f"{where}.{kind}"
    fov, height = 60.0, None
    if kind == "perspective":
        fov = math.degrees(file.number(lens, "yfov", where, math.radians(60.0)))
        if not 0.0 < fov < 180.0:
            raise file.fail(f"{where}.yfov", f"{fov:g} degrees; must lie between 0 and 180")
    else:
        height = 2.0 * abs(file.number(lens, "ymag", where, 1.0))
        if height == 0.0:
            raise file.fail(f"{where}.ymag", "must not be 0")
    return Camera(
        name=name,
        eye=_vector(eye),
        target=_vector(target),
        up=_vector(up),
        fov_degrees=fov,
        orthographic_height=height,
        near=_positive(file, lens, "znear", where),
        far=_positive(file, lens, "zfar", where),
    )


def read_cameras(
    file: GltfFile, placements: Sequence[NodePlacements], center: NDArray[np.float64], notes: ReportNotes
) -> tuple[Camera, ...]:
    """Return all cameras that stand in the scene, with distinct names: the node's, else the camera's.

    `center` [3] is the middle of the scene; targets are put at its depth. Raises InputError.
    """
    nodes, entries = file.entries("nodes"), file.entries("cameras")
    taken: set[str] = set()
    cameras: list[Camera] = []
    for placement in placements:
        if placement.camera is None:
            continue
        name = file.label(nodes[placement.node], file.label(entries[placement.camera], f"camera {placement.camera}"))
        if name in taken:
            name = f"{name} (node {placement.node})"
        taken.add(name)
        camera = _camera(file, placement, placement.camera, name, center)
        if camera is None:
            notes.ignored(f"camera {name!r}: its node has no direction to look in")
            continue
        if "aspectRatio" in entries[placement.camera].get("perspective", {}):
            notes.ignored("aspect ratios of cameras (the picture's is used)")
        cameras.append(camera)
    return tuple(cameras)


EXTENSION = "KHR_lights_punctual"
BRIGHTEST = 1e30
"""Products of intensity and colour are held below it, so that they stay finite in single precision."""
WIDEST = math.pi / 2


def _entries(file: GltfFile) -> list[Any]:
    extension = file.extension(file.json, EXTENSION, "file")
    return [] if extension is None else file.array(extension, "lights", f"extensions.{EXTENSION}")


def _light(
    file: GltfFile, entry: dict[str, Any], where: str, placement: NodePlacements, notes: ReportNotes
) -> Light | None:
    """Return the light `entry` at its node; None where it shines nowhere. Raises InputError."""
    kind = file.text(entry, "type", where)
    if kind not in ("directional", "point", "spot"):
        raise file.fail(f"{where}.type", f"{kind!r:.20} is none of directional, point and spot")
    intensity = max(0.0, file.number(entry, "intensity", where, 1.0))
    color = file.numbers(entry, "color", where, (1.0, 1.0, 1.0))
    red, green, blue = (min(max(0.0, share) * intensity, BRIGHTEST) for share in color)
    axis = -placement.world[:3, 2]
    length = float(np.linalg.norm(axis))
    if kind != "point" and length < 1e-20:
        notes.ignored("lights whose node has no direction to shine in")
        return None
    down = axis / length if length >= 1e-20 else np.array([0.0, 0.0, -1.0])
    inner, outer = 0.0, math.pi / 4
    if kind == "spot":
        spot = file.object(entry, "spot", where)
        outer = min(max(1e-3, file.number(spot, "outerConeAngle", f"{where}.spot", math.pi / 4)), WIDEST)
        inner = min(max(0.0, file.number(spot, "innerConeAngle", f"{where}.spot", 0.0)), outer)
    x, y, z = placement.world[:3, 3].tolist()
    across, up, along = down.tolist()
    return Light(
        kind="directional" if kind == "directional" else "point" if kind == "point" else "spot",
        color=(red, green, blue),
        position=(x, y, z),
        direction=(across, up, along),
        reach=max(0.0, file.number(entry, "range", where, 0.0)),
        inner_cone=inner,
        outer_cone=outer,
    )


def read_lights(file: GltfFile, placements: Sequence[NodePlacements], notes: ReportNotes) -> tuple[Light, ...]:
    """Return all lights that stand in the scene and are not hidden, in the order of their nodes. Raises InputError.

    Scale does not change their range.
    """
    entries = _entries(file)
    nodes = file.entries("nodes")
    lights: list[Light] = []
    for placement in placements if entries else ():
        node, field = nodes[placement.node], f"nodes[{placement.node}]"
        extension = file.extension(node, EXTENSION, field) if "extensions" in node and placement.visible else None
        if extension is None:
            continue
        number = file.index(extension.get("light"), len(entries), f"{field}.{EXTENSION}.light")
        where = f"extensions.{EXTENSION}.lights[{number}]"
        if not isinstance(entries[number], dict):
            raise file.fail(where, "must be an object")
        light = _light(file, entries[number], where, placement, notes)
        if light is not None:
            lights.append(light)
            notes.honoured(f"{EXTENSION}: {light.kind} lights")
    return tuple(lights)
