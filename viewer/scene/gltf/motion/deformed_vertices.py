"""Vertices of a primitive as its node's deformation leaves them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.scene.gltf.accessors import Accessors
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.motion.deformation import (
    Deformation,
    ReadAttribute,
    blended_matrices,
    morphed,
    moved_normals,
    moved_points,
    moved_tangents,
    read_influences,
)

_Target = NDArray[np.float32] | None


@dataclass(frozen=True, eq=False)
class VertexFrames:
    """What a deformation moves; normals and tangents need not be of unit length."""

    positions: NDArray[np.float32]
    """[V, 3]."""
    normals: NDArray[np.float32] | None
    """[V, 3]."""
    tangents: NDArray[np.float32] | None
    """[V, 4]."""


def deformed(
    file: GltfFile,
    accessors: Accessors,
    targets: list[Any],
    read: ReadAttribute,
    deformation: Deformation,
    where: str,
    frames: VertexFrames,
) -> VertexFrames:
    """`frames` of a primitive after its morph `targets`, then its skin. Values that overflow become infinite. Raises InputError."""
    count = len(frames.positions)

    def target_values(name: str) -> list[_Target]:
        return [
            _target(file, accessors, target, name, count, f"{where}.targets[{n}]") for n, target in enumerate(targets)
        ]

    weights = deformation.weights
    with np.errstate(over="ignore", invalid="ignore"):
        positions, normals, tangents = frames.positions, frames.normals, frames.tangents
        if any(weights) and targets:
            positions = morphed(positions, target_values("POSITION"), weights)
            normals = None if normals is None else morphed(normals, target_values("NORMAL"), weights)
            tangents = None if tangents is None else morphed(tangents, target_values("TANGENT"), weights)
        if deformation.joints is not None:
            influences = read_influences(file, read, len(deformation.joints), count, where)
            if influences is None:
                raise file.fail(f"{where}.attributes", "has a skin and no JOINTS_0; export the scene again")
            matrices = blended_matrices(influences, deformation.joints)
            positions = moved_points(positions, matrices)
            normals = None if normals is None else moved_normals(normals, matrices)
            tangents = None if tangents is None else moved_tangents(tangents, matrices)
    return VertexFrames(positions, normals, tangents)


def _target(file: GltfFile, accessors: Accessors, target: Any, name: str, count: int, where: str) -> _Target:
    """[V, 3] what one morph target adds; None where it leaves the attribute alone."""
    if not isinstance(target, dict):
        raise file.fail(where, "must be an object")
    if name not in target:
        return None
    values = accessors.floats(target[name], f"{where}.{name}", ("VEC3",))
    if len(values) != count:
        raise file.fail(f"{where}.{name}", f"has {len(values)} elements for {count} positions")
    return values
