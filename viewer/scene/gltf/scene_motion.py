"""A scene that moves: where its nodes and vertices are at a moment, without reading its file again."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from viewer.scene.gltf.accessors import Accessors
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.motion.animations import Animation, NodeValues
from viewer.scene.gltf.nodes import walk_nodes
from viewer.scene.gltf.shapes import place_shapes, placed_shapes
from viewer.scene.model import Geometry, Pose, Primitive, Stand
from viewer.scene.moving import MovingVertices, moved_boxes
from viewer.scene.report import ReportNotes

MOST_NAMED = 6
"""Animations that one message names."""


def posed_values(animations: Sequence[Animation], pose: Pose | None, scene: str) -> NodeValues:
    """What the animation that `pose` names gives at its time; nothing for None. Raises InputError where there is none of that name."""
    if pose is None:
        return {}
    if not animations:
        raise InputError(f"{scene}: has no animations")
    found = next((animation for animation in animations if pose.animation in ("", animation.name)), None)
    if found is None:
        known = ", ".join(animation.name for animation in animations[:MOST_NAMED])
        raise InputError(f"{scene}: no animation {pose.animation!r}; there are {known}")
    return found.at(pose.seconds)


def animated_weights(animations: Sequence[Animation]) -> frozenset[int]:
    """Nodes whose morph weights some animation changes."""
    return frozenset(
        channel.node for animation in animations for channel in animation.channels if channel.path == "weights"
    )


@dataclass(frozen=True, eq=False)
class SceneMotion:
    """The animations of a file, and what they move. Keeps the file in memory."""

    name: str
    file: GltfFile
    accessors: Accessors
    animations: tuple[Animation, ...]
    moving: tuple[MovingVertices, ...]
    ranges: Mapping[tuple[int, int], tuple[int, int]]
    """(first, count) of the primitives of each shape by its key."""
    primitives: tuple[Primitive, ...]
    geometry: Geometry
    most_instances: int

    @cached_property
    def _animated(self) -> frozenset[int]:
        """Nodes whose morph weights some animation changes: the same in all poses."""
        return animated_weights(self.animations)

    @cached_property
    def _boxes(self) -> NDArray[np.float64]:
        """[primitives, 2, 3] around the vertices of each, as they were read."""
        boxes = np.zeros((len(self.primitives), 2, 3))
        for box, primitive in zip(boxes, self.primitives, strict=True):
            own = self.geometry.positions[primitive.base_vertex : primitive.base_vertex + primitive.vertex_count]
            if len(own):
                box[:] = own.min(axis=0), own.max(axis=0)
        return boxes

    def at(self, pose: Pose | None) -> Stand:
        """How the scene stands in a pose; None: as its nodes say. Raises InputError for a pose of no animation of the file."""
        values = posed_values(self.animations, pose, self.name)
        placements = walk_nodes(self.file, self.accessors, ReportNotes(), values)
        shapes = placed_shapes(self.file, self.accessors, placements, self._animated)
        instances = place_shapes(self.file, shapes, self.ranges, self.most_instances)
        deformations = {shape.node: shape.deformation for shape in shapes if shape.deformation is not None}
        moved = {part.base_vertex: part.box(deformations[part.node]) for part in self.moving}
        boxes = self._boxes.copy()
        for box, primitive in zip(boxes, self.primitives, strict=True):
            if primitive.base_vertex in moved:
                box[:] = moved[primitive.base_vertex]
        placed = moved_boxes(boxes[instances.primitive], instances.transform.astype(np.float64))
        largest = float(np.finfo(np.float32).max)
        bounds = np.clip(np.stack([placed[:, 0].min(axis=0), placed[:, 1].max(axis=0)]), -largest, largest)
        return Stand(pose, instances, deformations, moved, bounds.astype(np.float32))
