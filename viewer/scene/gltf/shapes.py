"""Placed meshes: their geometry, read once each, and an instance for each primitive of each placement."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from viewer.scene.gltf.buffers import Accessors
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.geometry import GeometryReader
from viewer.scene.gltf.motion.animations import Animation, NodeValues
from viewer.scene.gltf.motion.deformation import read_deformation
from viewer.scene.gltf.nodes import NodePlacements, walk_nodes
from viewer.scene.model import Geometry, Instances, Pose, Primitive, Stand
from viewer.scene.moving import Deformation, MovingVertices, moved_boxes
from viewer.scene.report import ReportNotes


@dataclass(frozen=True, eq=False)
class Shape:
    """Mesh with its placements and its deformation."""

    mesh: int
    deformation: Deformation | None
    node: int
    worlds: NDArray[np.float64]
    """[N, 4, 4] placements."""

    @property
    def key(self) -> tuple[int, int]:
        """Key that shapes with the same vertices share."""
        return self.mesh, -1 if self.deformation is None else self.node


def placed_shapes(
    file: GltfFile, accessors: Accessors, placements: Sequence[NodePlacements], animated: Collection[int]
) -> list[Shape]:
    """Return the shapes of all placements. `animated`: nodes whose morph weights some animation changes. Raises InputError."""
    worlds = {placement.node: placement.world for placement in placements}
    shapes: list[Shape] = []
    for placement in placements:
        if placement.mesh is not None:
            deformation = read_deformation(file, accessors, placement.node, placement.weights, worlds, animated)
            # Joints transform vertices to world space; the transform of a skinned mesh's node does not count.
            skinned = deformation is not None and deformation.joints is not None
            mesh_worlds = np.eye(4)[None] if skinned else placement.mesh_worlds
            shapes.append(Shape(placement.mesh, deformation, placement.node, mesh_worlds))
    return shapes


def read_shapes(
    shapes: Sequence[Shape], reader: GeometryReader
) -> tuple[list[Primitive], dict[tuple[int, int], tuple[int, int]]]:
    """Return (all primitives; range (first, count) of the primitives of each shape, by its key). Raises InputError."""
    primitives: list[Primitive] = []
    ranges: dict[tuple[int, int], tuple[int, int]] = {}
    for shape in shapes:
        if shape.key not in ranges:
            read = reader.read_mesh(shape.mesh, shape.deformation)
            ranges[shape.key] = (len(primitives), len(read))
            primitives.extend(read)
    return primitives, ranges


def place_shapes(
    file: GltfFile, shapes: Sequence[Shape], ranges: Mapping[tuple[int, int], tuple[int, int]], most: int
) -> Instances:
    """Return an instance for every primitive of every placement. Raises InputError for more than `most`."""
    of_mesh = np.array([ranges[shape.key] for shape in shapes], np.int64).reshape(-1, 2)
    copies = np.array([len(shape.worlds) for shape in shapes], np.int64)
    rows = np.cumsum(of_mesh[:, 1] * copies)
    if len(rows) and rows[-1] > most:
        node = shapes[int(np.searchsorted(rows, most, side="right"))].node
        raise file.fail(f"nodes[{node}]", f"the scene has more than {most} instances; split it")
    counts = np.repeat(of_mesh[:, 1], copies)
    worlds = np.concatenate([np.zeros((0, 4, 4)), *(shape.worlds for shape in shapes)]).astype(np.float32)
    # Each placement lists the primitives of its mesh, from the first one on.
    within = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
    return Instances(
        primitive=(np.repeat(np.repeat(of_mesh[:, 0], copies), counts) + within).astype(np.int32),
        transform=np.repeat(worlds, counts, axis=0),
        node=np.repeat(np.repeat(np.array([shape.node for shape in shapes], np.int32), copies), counts),
    )


MOST_NAMED = 6
"""Most animations that one message names."""


def posed_values(animations: Sequence[Animation], pose: Pose | None, scene: str) -> NodeValues:
    """Return the values of the animation and the time that `pose` names; {} for None.
    Raises InputError for an unknown animation."""
    if pose is None:
        return {}
    if not animations:
        raise InputError(f"{scene}: has no animations")
    chosen = next((animation for animation in animations if pose.animation in ("", animation.name)), None)
    if chosen is None:
        known = ", ".join(animation.name for animation in animations[:MOST_NAMED])
        raise InputError(f"{scene}: no animation {pose.animation!r}; there are {known}")
    return chosen.at(pose.seconds)


def animated_weights(animations: Sequence[Animation]) -> frozenset[int]:
    """Return the nodes whose morph weights some animation changes."""
    return frozenset(
        channel.node for animation in animations for channel in animation.channels if channel.path == "weights"
    )


@dataclass(frozen=True, eq=False)
class SceneMotion:
    """The animations of a file, and the parts of the scene that they move. Holds the file in memory."""

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
        """Boxes [primitives, 2, 3] around the vertices of each primitive, as they were read."""
        boxes = np.zeros((len(self.primitives), 2, 3))
        for box, primitive in zip(boxes, self.primitives, strict=True):
            vertices = self.geometry.positions[primitive.base_vertex : primitive.base_vertex + primitive.vertex_count]
            if len(vertices):
                box[:] = vertices.min(axis=0), vertices.max(axis=0)
        return boxes

    def at(self, pose: Pose | None) -> Stand:
        """Return the positions of all moving parts in a pose; None: without an animation. Raises InputError for an unknown one."""
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
