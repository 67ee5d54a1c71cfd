"""Cameras of the node graph, in world space."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.nodes import NodePlacements
from viewer.scene.model import Camera
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
    """The camera on the node `placement`; None when the node's transform leaves it no direction."""
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
    """All cameras that stand in the scene, with distinct names: the node's, else the camera's.

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
