"""Skins and morph targets of a file: matrices of joints, influences of joints on vertices, and offsets of morph targets."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.scene.gltf.buffers import Accessors, normalize
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.schema import ABSENT, Attributes, Node, Skin
from viewer.scene.moving import Deformation, Influences, MorphTarget, MovingVertices, VertexFrames

LARGEST_TERM = 1e30
"""Largest term of a joint's matrix: products with positions must stay finite in single precision."""
MOST_INFLUENCES = 16
"""Most joints that move one vertex: four for each of JOINTS_0 to JOINTS_3."""


def read_deformation(
    file: GltfFile,
    accessors: Accessors,
    node: int,
    weights: tuple[float, ...],
    worlds: Mapping[int, NDArray[np.float64]],
    animated: Collection[int] = (),
) -> Deformation | None:
    """Return the deformation of the mesh at a node; None where nothing ever deforms it.

    `weights`: weights of its morph targets. `worlds`: local-to-world matrices of all nodes of the scene. `animated`: nodes whose
    weights some animation changes. Raises InputError for a skin whose joints are not in the scene, that has fewer matrices than
    joints, or whose transforms overflow.
    """
    skin, where = file.entry("nodes", node, Node).skin, f"nodes[{node}]"
    joints = _joint_matrices(file, accessors, skin, where, worlds) if skin != ABSENT else None
    if joints is None and not any(weights) and node not in animated:
        return None
    if joints is not None and not (np.abs(joints) < LARGEST_TERM).all():
        raise file.fail(where, "has joints whose transforms overflow; check their scales")
    return Deformation(node, joints, weights)


def _joint_matrices(
    file: GltfFile, accessors: Accessors, number: int, where: str, worlds: Mapping[int, NDArray[np.float64]]
) -> NDArray[np.float64]:
    file.index(number, len(file.entries("skins")), f"{where}.skin")
    field, skin = f"skins[{number}]", file.entry("skins", number, Skin)
    joints = [file.index(joint, len(file.entries("nodes")), f"{field}.joints") for joint in skin.joints]
    if not joints:
        raise file.fail(f"{field}.joints", "must name a node at least")
    missing = next((joint for joint in joints if joint not in worlds), None)
    if missing is not None:
        raise file.fail(f"{field}.joints", f"node {missing} is not in the scene that is drawn")
    matrices = np.stack([worlds[joint] for joint in joints])
    if skin.inverse_bind_matrices == ABSENT:
        return matrices
    inverse = accessors.floats(skin.inverse_bind_matrices, f"{field}.inverseBindMatrices", ("MAT4",))
    if len(inverse) < len(joints):
        raise file.fail(f"{field}.inverseBindMatrices", f"has {len(inverse)} matrices for {len(joints)} joints")
    # Accessors store columns one after another.
    return matrices @ inverse[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1).astype(np.float64)


ReadAttribute = Callable[[str], NDArray[Any] | None]
"""Function that returns [V, components] of the attribute of a name in its stored type; None for no attribute. Raises InputError."""


def read_influences(file: GltfFile, read: ReadAttribute, joints: int, vertices: int, where: str) -> Influences | None:
    """Return the influences of joints on a primitive's vertices; None without JOINTS attributes. Raises InputError."""
    parts: list[NDArray[np.int64]] = []
    weights: list[NDArray[np.float64]] = []
    for number in range(MOST_INFLUENCES // 4):
        joint_indices, share = read(f"JOINTS_{number}"), read(f"WEIGHTS_{number}")
        if joint_indices is None:
            continue
        if joint_indices.dtype.kind != "u" or share is None or not joint_indices.shape == share.shape == (vertices, 4):
            problem = f"must be four unsigned integers, with weights, for each of {vertices} vertices"
            raise file.fail(f"{where}.attributes.JOINTS_{number}", problem)
        parts.append(joint_indices.astype(np.int64))
        weights.append(np.nan_to_num(normalize(share).astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0))
    if not parts:
        return None
    used, share_of = np.concatenate(parts, axis=1), np.maximum(np.concatenate(weights, axis=1), 0.0)
    if int(used[share_of > 0.0].max(initial=0)) >= joints:
        raise file.fail(f"{where}.attributes.JOINTS_0", f"names joint {int(used[share_of > 0.0].max())} of {joints}")
    total = share_of.sum(axis=1, keepdims=True)
    # Vertices without weights follow the first joint.
    share_of[:, :1] += total <= 0.0
    return Influences(np.minimum(used, joints - 1), share_of / np.where(total > 0.0, total, 1.0))


_Target = NDArray[np.float32] | None


def read_moving(
    file: GltfFile,
    accessors: Accessors,
    targets: Sequence[Attributes],
    read: ReadAttribute,
    deformation: Deformation,
    where: str,
    frames: VertexFrames,
    base_vertex: int,
) -> MovingVertices:
    """Return the vertices `frames` of a primitive with all that moves them: its morph `targets` and the joints of its node's skin.
    Raises InputError."""
    count = len(frames.positions)

    def values(entry: Attributes, number: int, name: str) -> _Target:
        return _target(file, accessors, entry, name, count, f"{where}.targets[{number}]")

    morph_targets = tuple(
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
    return MovingVertices(deformation.node, base_vertex, frames, morph_targets, influences)


def _target(file: GltfFile, accessors: Accessors, target: Attributes, name: str, count: int, where: str) -> _Target:
    """Return [V, 3] the offsets of one morph target; None where it does not change the attribute."""
    if name not in target:
        return None
    values = accessors.floats(target[name], f"{where}.{name}", ("VEC3",))
    if len(values) != count:
        raise file.fail(f"{where}.{name}", f"has {len(values)} elements for {count} positions")
    # Offsets that are not finite become 0.
    return np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0) if not np.isfinite(values).all() else values
