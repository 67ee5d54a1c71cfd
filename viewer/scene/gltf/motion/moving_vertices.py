"""Reading the vertices of a primitive that move."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.scene.gltf.accessors import Accessors
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.motion.deformation import ReadAttribute, read_influences
from viewer.scene.moving import Deformation, MorphTarget, MovingVertices, VertexFrames

_Target = NDArray[np.float32] | None


def read_moving(
    file: GltfFile,
    accessors: Accessors,
    targets: Sequence[Any],
    read: ReadAttribute,
    deformation: Deformation,
    where: str,
    frames: VertexFrames,
    base_vertex: int,
) -> MovingVertices:
    """What moves the vertices `frames` of a primitive: its morph `targets`, and the joints of its node's skin. Raises InputError."""
    count = len(frames.positions)

    def values(entry: Any, number: int, name: str) -> _Target:
        return _target(file, accessors, entry, name, count, f"{where}.targets[{number}]")

    found = tuple(
        MorphTarget(
            values(entry, number, "POSITION"),
            None if frames.normals is None else values(entry, number, "NORMAL"),
            None if frames.tangents is None else values(entry, number, "TANGENT"),
        )
        for number, entry in enumerate(targets)
    )
    influences = None
    if deformation.joints is not None:
        influences = read_influences(file, read, len(deformation.joints), count, where)
        if influences is None:
            raise file.fail(f"{where}.attributes", "has a skin and no JOINTS_0; export the scene again")
    return MovingVertices(deformation.node, base_vertex, frames, found, influences)


def _target(file: GltfFile, accessors: Accessors, target: Any, name: str, count: int, where: str) -> _Target:
    """[V, 3] what one morph target adds; None where it leaves the attribute alone."""
    if not isinstance(target, dict):
        raise file.fail(where, "must be an object")
    if name not in target:
        return None
    values = accessors.floats(target[name], f"{where}.{name}", ("VEC3",))
    if len(values) != count:
        raise file.fail(f"{where}.{name}", f"has {len(values)} elements for {count} positions")
    # What is not finite moves nothing.
    return np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0) if not np.isfinite(values).all() else values
