"""Meshes where they stand: their shapes, read once each, and one row for each primitive of each placement."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from viewer.scene.gltf.accessors import Accessors
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.geometry import GeometryReader
from viewer.scene.gltf.motion.deformation import read_deformation
from viewer.scene.gltf.nodes import NodePlacements
from viewer.scene.model import Instances, Primitive
from viewer.scene.moving import Deformation


@dataclass(frozen=True, eq=False)
class Shape:
    """A mesh that stands somewhere."""

    mesh: int
    deformation: Deformation | None
    node: int
    worlds: NDArray[np.float64]
    """[N, 4, 4] placements."""

    @property
    def key(self) -> tuple[int, int]:
        """The same for shapes of the same vertices."""
        return self.mesh, -1 if self.deformation is None else self.node


def placed_shapes(
    file: GltfFile, accessors: Accessors, placements: Sequence[NodePlacements], animated: Collection[int]
) -> list[Shape]:
    """The meshes of all placements; `animated`: nodes whose morph weights some animation changes. Raises InputError."""
    worlds = {placement.node: placement.world for placement in placements}
    shapes: list[Shape] = []
    for placement in placements:
        if placement.mesh is not None:
            deformation = read_deformation(file, accessors, placement.node, placement.weights, worlds, animated)
            # Joints take vertices to the world whatever the node's own place is.
            skinned = deformation is not None and deformation.joints is not None
            stands = np.eye(4)[None] if skinned else placement.mesh_worlds
            shapes.append(Shape(placement.mesh, deformation, placement.node, stands))
    return shapes


def read_shapes(
    shapes: Sequence[Shape], reader: GeometryReader
) -> tuple[list[Primitive], dict[tuple[int, int], tuple[int, int]]]:
    """(all primitives, (first, count) of those of each shape by its key). Raises InputError."""
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
    """Every primitive of every shape, placement by placement; `most` in all, else InputError."""
    of_mesh = np.array([ranges[shape.key] for shape in shapes], np.int64).reshape(-1, 2)
    copies = np.array([len(shape.worlds) for shape in shapes], np.int64)
    rows = np.cumsum(of_mesh[:, 1] * copies)
    if len(rows) and rows[-1] > most:
        node = shapes[int(np.searchsorted(rows, most, side="right"))].node
        raise file.fail(f"nodes[{node}]", f"the scene has more than {most} instances; split it")
    counts = np.repeat(of_mesh[:, 1], copies)
    worlds = np.concatenate([np.zeros((0, 4, 4)), *(shape.worlds for shape in shapes)]).astype(np.float32)
    # Each placement lists its mesh's primitives one after another, starting anew.
    within = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
    return Instances(
        primitive=(np.repeat(np.repeat(of_mesh[:, 0], copies), counts) + within).astype(np.int32),
        transform=np.repeat(worlds, counts, axis=0),
        node=np.repeat(np.repeat(np.array([shape.node for shape in shapes], np.int32), copies), counts),
    )
