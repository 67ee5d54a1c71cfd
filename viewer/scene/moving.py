"""Vertices moved by morph targets, then by the joints of a skin (glTF 2.0, Sec. 3.7.2.2 and 3.7.3), in float64.

A vertex moves by the weighted sum of its morph offsets, then by the mean of its joints' matrices, weighted by its influences (linear
blend skinning). Normals are turned by the cofactors of that matrix, tangents by the matrix. This is the reference of the compute
shader `pose_vertices`.

Bounds need no vertex: a blended position is a weighted mean of the positions that single joints give, so it lies inside the box
around the moved boxes of the joints.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

_Target = NDArray[np.float32] | None
BOX_MARGIN = 1e-5
"""Margin of boxes for the rounding of single precision, as a share of their largest coordinate."""


@dataclass(frozen=True, eq=False)
class Deformation:
    """Deformation of a node's mesh at one time."""

    node: int
    joints: NDArray[np.float64] | None
    """[J, 4, 4] matrices from the mesh's local space to the world, by joint; None without a skin."""
    weights: tuple[float, ...]
    """Weights of the morph targets."""


@dataclass(frozen=True, eq=False)
class Influences:
    """Joints that move each vertex, with their weights."""

    joints: NDArray[np.int64]
    """[V, I] index of the joint."""
    weights: NDArray[np.float64]
    """[V, I] weight; the sum of each vertex is 1."""


@dataclass(frozen=True, eq=False)
class VertexFrames:
    """Vertex attributes that a deformation moves; normals and tangents need not be of unit length."""

    positions: NDArray[np.float32]
    """[V, 3]."""
    normals: NDArray[np.float32] | None
    """[V, 3]."""
    tangents: NDArray[np.float32] | None
    """[V, 4]."""


@dataclass(frozen=True, eq=False)
class MorphTarget:
    """Offsets of one morph target, [V, 3] each; None where it does not change the attribute."""

    positions: _Target
    normals: _Target
    tangents: _Target


@dataclass(frozen=True, eq=False)
class MovingVertices:
    """Vertices of a primitive at a node that a skin or morph targets move."""

    node: int
    base_vertex: int
    """First vertex of the primitive in the scene's geometry."""
    frames: VertexFrames
    """Vertex attributes before any deformation."""
    targets: tuple[MorphTarget, ...]
    influences: Influences | None
    """Influences of the joints of the node's skin; None without one."""

    def at(self, deformation: Deformation) -> VertexFrames:
        """Return the vertex attributes [V, ...] moved by the morph targets, then by the skin. Values that overflow become infinite."""
        frames, weights = self.frames, deformation.weights
        positions, normals, tangents = frames.positions, frames.normals, frames.tangents
        with np.errstate(over="ignore", invalid="ignore"):
            if any(weights) and self.targets:
                positions = morphed(positions, [target.positions for target in self.targets], weights)
                if normals is not None:
                    normals = morphed(normals, [target.normals for target in self.targets], weights)
                if tangents is not None:
                    tangents = morphed(tangents, [target.tangents for target in self.targets], weights)
            if deformation.joints is not None and self.influences is not None:
                matrices = blended_matrices(self.influences, deformation.joints)
                positions = moved_points(positions, matrices)
                normals = None if normals is None else moved_normals(normals, matrices)
                tangents = None if tangents is None else moved_tangents(tangents, matrices)
        return VertexFrames(positions, normals, tangents)

    @cached_property
    def _joint_boxes(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Joints that move any vertex, and [J, 2, 3] boxes around the positions that each joint moves; without a skin one box."""
        points = self.frames.positions.astype(np.float64)
        if self.influences is None or not len(points):
            box = np.stack([points.min(axis=0), points.max(axis=0)]) if len(points) else np.zeros((2, 3))
            return np.zeros(1, np.int64), box[None]
        rows, columns = np.nonzero(self.influences.weights)
        order = np.argsort(self.influences.joints[rows, columns], kind="stable")
        joints, starts = np.unique(self.influences.joints[rows, columns][order], return_index=True)
        moved = points[rows[order]]
        low, high = (extreme.reduceat(moved, starts, axis=0) for extreme in (np.minimum, np.maximum))
        return joints, np.stack([low, high], axis=1)

    @cached_property
    def _target_extents(self) -> NDArray[np.float64]:
        """Lowest and highest offsets of positions, [targets, 2, 3]."""
        extents = np.zeros((len(self.targets), 2, 3))
        for number, target in enumerate(self.targets):
            if target.positions is not None and len(target.positions):
                extents[number] = target.positions.min(axis=0), target.positions.max(axis=0)
        return extents

    def box(self, deformation: Deformation) -> NDArray[np.float64]:
        """Return a box [2, 3] around all moved vertices, from the boxes of the joints; it may be too wide."""
        joints, boxes = self._joint_boxes
        for extent, weight in zip(self._target_extents, deformation.weights, strict=False):
            boxes = boxes + np.sort(weight * extent, axis=0)
        if deformation.joints is not None and self.influences is not None:
            boxes = moved_boxes(boxes, deformation.joints[joints])
        low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
        margin = BOX_MARGIN * np.maximum(np.abs(low), np.abs(high)).max(initial=0.0)
        return np.stack([low - margin, high + margin])


def morphed(
    values: NDArray[np.float32], targets: Sequence[NDArray[np.float32] | None], weights: Sequence[float]
) -> NDArray[np.float32]:
    """Return [V, 3 or more] `values` with the first three components moved by each target [V, 3] times its weight."""
    moved = values.astype(np.float64)
    for target, weight in zip(targets, weights, strict=False):
        if target is not None and weight:
            moved[:, :3] += weight * target.astype(np.float64)
    return moved.astype(np.float32)


def blended_matrices(influences: Influences, joints: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return [V, 4, 4] the weighted mean of each vertex's joint matrices."""
    blended = np.zeros((len(influences.joints), 4, 4))
    for column in range(influences.joints.shape[1]):
        share = influences.weights[:, column]
        if share.any():
            blended += share[:, None, None] * joints[influences.joints[:, column]]
    return blended


def moved_points(points: NDArray[np.float32], matrices: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return [V, 3] `points` moved by `matrices` [V, 4, 4]."""
    moved = np.einsum("nij,nj->ni", matrices[:, :3, :3], points.astype(np.float64)) + matrices[:, :3, 3]
    return np.asarray(moved, np.float32)


def moved_normals(normals: NDArray[np.float32], matrices: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return [V, 3] `normals` turned by the cofactors of `matrices` [V, 4, 4], which need no inverse. Lengths are not 1."""
    a, b, c = matrices[:, 0, :3], matrices[:, 1, :3], matrices[:, 2, :3]
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    return np.asarray(np.einsum("nij,nj->ni", cofactors, normals.astype(np.float64)), np.float32)


def moved_tangents(tangents: NDArray[np.float32], matrices: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return [V, 4] `tangents` turned by `matrices` [V, 4, 4], with unchanged signs. Lengths are not 1."""
    turned = np.einsum("nij,nj->ni", matrices[:, :3, :3], tangents[:, :3].astype(np.float64))
    return np.concatenate([turned, tangents[:, 3:]], axis=1).astype(np.float32)


def moved_boxes(boxes: NDArray[np.float64], matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return [N, 2, 3] boxes around `boxes` [N, 2, 3] moved by `matrices` [N, 4, 4]."""
    centre, half = boxes.mean(axis=1), (boxes[:, 1] - boxes[:, 0]) / 2.0
    centre = np.einsum("nij,nj->ni", matrices[:, :3, :3], centre) + matrices[:, :3, 3]
    half = np.einsum("nij,nj->ni", np.abs(matrices[:, :3, :3]), half)
    return np.stack([centre - half, centre + half], axis=1)
