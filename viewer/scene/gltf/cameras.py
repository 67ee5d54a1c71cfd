"""Cameras and lights of the node graph, in world space."""

import math
from collections.abc import Sequence

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from viewer.scene.gltf import schema
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.nodes import NodePlacements
from viewer.scene.model import Camera, Light
from viewer.scene.report import ReportNotes


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64] | None:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-20 else None


def _vector(values: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _camera(
    file: GltfFile, placement: NodePlacements, index: int, name: str, center: NDArray[np.float64]
) -> Camera | None:
    """Return the camera on the node `placement`; None when the node's transform leaves it no direction."""
    entry = file.entry("cameras", index, schema.Camera)
    eye = placement.world[:3, 3]
    forward, up = _unit(-placement.world[:3, 2]), _unit(placement.world[:3, 1])
    if forward is None or up is None or np.linalg.norm(np.cross(forward, up)) < 1e-6:
        return None
    # The target only fixes the direction; at the scene's depth it is also a good point to orbit around.
    depth = float(np.dot(center - eye, forward))
    target = eye + forward * (depth if depth > 1e-3 else 1.0)
    fov, height = 60.0, None
    lens: schema.Perspective | schema.Orthographic
    if entry.type == "perspective":
        lens, fov = entry.perspective, math.degrees(entry.perspective.yfov)
    else:
        lens, height = entry.orthographic, 2.0 * abs(entry.orthographic.ymag)
        if height == 0.0:
            raise file.fail(f"cameras[{index}].orthographic.ymag", "must not be 0")
    return Camera(
        name=name,
        eye=_vector(eye),
        target=_vector(target),
        up=_vector(up),
        fov_degrees=fov,
        orthographic_height=height,
        near=lens.znear if lens.znear > 0.0 else None,
        far=lens.zfar if lens.zfar > 0.0 else None,
    )


def read_cameras(
    file: GltfFile, placements: Sequence[NodePlacements], center: NDArray[np.float64], notes: ReportNotes
) -> tuple[Camera, ...]:
    """Return all cameras that nodes of the scene hold, with distinct names: the node's, else the camera's.

    `center` [3] is the centre of the scene; targets lie at its depth. Raises InputError.
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
        if file.entry("cameras", placement.camera, schema.Camera).perspective.aspect_ratio is not UNSET:
            notes.ignored("aspect ratios of cameras (the picture's is used)")
        cameras.append(camera)
    return tuple(cameras)


EXTENSION = "KHR_lights_punctual"
BRIGHTEST = 1e30
"""Largest product of intensity and colour: larger ones are clamped, because shaders compute in single precision."""
WIDEST = math.pi / 2


def _light(entry: schema.Light, placement: NodePlacements, notes: ReportNotes) -> Light | None:
    """Return the light `entry` at its node; None where the node gives it no direction."""
    intensity = max(0.0, entry.intensity)
    red, green, blue = (min(max(0.0, share) * intensity, BRIGHTEST) for share in entry.color)
    axis = -placement.world[:3, 2]
    length = float(np.linalg.norm(axis))
    if entry.type != "point" and length < 1e-20:
        notes.ignored("lights whose node has no direction to shine in")
        return None
    down = axis / length if length >= 1e-20 else np.array([0.0, 0.0, -1.0])
    inner, outer = 0.0, math.pi / 4
    if entry.type == "spot":
        outer = min(max(1e-3, entry.spot.outer_cone_angle), WIDEST)
        inner = min(max(0.0, entry.spot.inner_cone_angle), outer)
    return Light(
        kind=entry.type,
        color=(red, green, blue),
        position=_vector(placement.world[:3, 3]),
        direction=_vector(down),
        reach=max(0.0, entry.range),
        inner_cone=inner,
        outer_cone=outer,
    )


def read_lights(file: GltfFile, placements: Sequence[NodePlacements], notes: ReportNotes) -> tuple[Light, ...]:
    """Return all visible lights that nodes of the scene hold, in the order of their nodes. Raises InputError.

    The scale of a node does not change the range of its light.
    """
    lights_extension = file.extension(file.document, EXTENSION, schema.Lights, "")
    entries = () if lights_extension is None else lights_extension.lights
    lights: list[Light] = []
    for placement in placements if entries else ():
        node, field = file.entry("nodes", placement.node, schema.Node), f"nodes[{placement.node}]"
        extension = file.extension(node, EXTENSION, schema.LightOfNode, field) if placement.visible else None
        if extension is None:
            continue
        number = file.index(extension.light, len(entries), f"{field}.extensions.{EXTENSION}.light")
        entry = file.read(entries[number], schema.Light, f"extensions.{EXTENSION}.lights[{number}]")
        light = _light(entry, placement, notes)
        if light is not None:
            lights.append(light)
            notes.honoured(f"{EXTENSION}: {light.kind} lights")
    return tuple(lights)
