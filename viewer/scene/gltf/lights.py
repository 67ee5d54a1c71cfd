"""Lights of the node graph (KHR_lights_punctual), in world space."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.nodes import NodePlacements
from viewer.scene.model import Light
from viewer.scene.report import ReportNotes

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
    """The light `entry` at its node; None where it shines nowhere. Raises InputError."""
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
    """All lights that stand in the scene and are not hidden, in the order of their nodes. Raises InputError.

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
