"""The node graph: world matrices of nodes, and of the instances of their meshes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from msgspec import UnsetType
from numpy.typing import NDArray

from viewer.scene.gltf.buffers import Accessors, normalize
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.motion.animations import AnimatedPath, NodeValues
from viewer.scene.gltf.schema import ABSENT, Attributes, Instancing, Mesh, Node, Scene, Visibility
from viewer.scene.report import ReportNotes

VISIBILITY = "KHR_node_visibility"
INSTANCING = "EXT_mesh_gpu_instancing"
TRANSFORM_PATHS: tuple[AnimatedPath, ...] = ("translation", "rotation", "scale")
NOTHING: NodeValues = {}
MAX_DEPTH = 1 << 14
"""Deepest nesting of nodes that is read; rigs have a few hundred levels."""


@dataclass(frozen=True, eq=False)
class NodePlacements:
    """Node of the drawn scene with the placements of its mesh."""

    node: int
    world: NDArray[np.float64]
    """[4, 4] local-to-world, for column vectors."""
    mesh: int | None
    mesh_worlds: NDArray[np.float64]
    """[N, 4, 4] placements of the mesh: `world`, or one for each instance of EXT_mesh_gpu_instancing."""
    camera: int | None
    visible: bool = True
    """True if its mesh and lights are drawn (KHR_node_visibility)."""
    weights: tuple[float, ...] = ()
    """Weights of the morph targets of its mesh."""


def compose(
    translations: NDArray[np.float64], rotations: NDArray[np.float64], scales: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return [N, 4, 4] matrices T R S from translations [N, 3], quaternions xyzw [N, 4] and scales [N, 3].

    Quaternions are normalised first; a zero quaternion is no rotation.
    """
    lengths = np.linalg.norm(rotations, axis=1, keepdims=True)
    unit = np.where(lengths > 0, rotations / np.where(lengths > 0, lengths, 1.0), (0.0, 0.0, 0.0, 1.0))
    x, y, z, w = unit.T
    matrices = np.zeros((len(unit), 4, 4))
    matrices[:, 0, 0] = 1 - 2 * (y * y + z * z)
    matrices[:, 0, 1] = 2 * (x * y - z * w)
    matrices[:, 0, 2] = 2 * (x * z + y * w)
    matrices[:, 1, 0] = 2 * (x * y + z * w)
    matrices[:, 1, 1] = 1 - 2 * (x * x + z * z)
    matrices[:, 1, 2] = 2 * (y * z - x * w)
    matrices[:, 2, 0] = 2 * (x * z - y * w)
    matrices[:, 2, 1] = 2 * (y * z + x * w)
    matrices[:, 2, 2] = 1 - 2 * (x * x + y * y)
    matrices[:, :3, :3] *= scales[:, None, :]
    matrices[:, :3, 3] = translations
    matrices[:, 3, 3] = 1.0
    return matrices


def local_matrices(file: GltfFile, indices: Sequence[int], animated: NodeValues = NOTHING) -> NDArray[np.float64]:
    """Return [N, 4, 4] node-to-parent matrices of the nodes `indices`. `animated` values replace those of the nodes.
    Raises InputError."""
    nodes = [file.entry("nodes", index, Node) for index in indices]

    def values(path: AnimatedPath, components: int) -> NDArray[np.float64]:
        rows = [getattr(node, path) for node in nodes]
        if animated:
            rows = [animated.get((index, path), row) for index, row in zip(indices, rows, strict=True)]
        return np.array(rows, np.float64).reshape(len(rows), components)

    composed = compose(values("translation", 3), values("rotation", 4), values("scale", 3))
    for row, (index, node) in enumerate(zip(indices, nodes, strict=True)):
        if not isinstance(node.matrix, UnsetType) and not any((index, path) in animated for path in TRANSFORM_PATHS):
            # glTF stores columns one after another.
            composed[row] = np.array(node.matrix).reshape(4, 4).T
    return composed


def scene_roots(file: GltfFile, notes: ReportNotes) -> list[int]:
    """Return the root nodes of the default scene; without scenes, all nodes without a parent. Raises InputError."""
    count, scenes = len(file.entries("nodes")), file.entries("scenes")
    if not scenes:
        children = {child for index in range(count) for child in file.entry("nodes", index, Node).children}
        return [index for index in range(count) if index not in children]
    chosen = file.index(file.json.get("scene", 0), len(scenes), "scene")
    if len(scenes) > 1:
        notes.ignored("scenes other than the default one", len(scenes) - 1)
    return [file.index(root, count, f"scenes[{chosen}].nodes") for root in file.entry("scenes", chosen, Scene).nodes]


def _instance_matrices(
    file: GltfFile, accessors: Accessors, attributes: Attributes, where: str, notes: ReportNotes
) -> NDArray[np.float64]:
    kinds = {"TRANSLATION": ("VEC3",), "ROTATION": ("VEC4",), "SCALE": ("VEC3",)}
    values: dict[str, NDArray[np.float64]] = {}
    for name, kind in kinds.items():
        if name in attributes:
            raw = accessors.raw(attributes[name], f"{where}.attributes.{name}", kind)
            # Rotations may be stored as normalised integers, translations and scales only as floats.
            values[name] = (normalize(raw) if name == "ROTATION" else raw).astype(np.float64)
    counts = {len(value) for value in values.values()}
    if len(counts) != 1:
        raise file.fail(f"{where}.attributes", "needs TRANSLATION, ROTATION or SCALE, all of one count")
    count = counts.pop()
    for value in values.values():
        if not np.isfinite(value).all():
            notes.note("instance transforms with NaN or infinity were replaced by 0")
            np.nan_to_num(value, copy=False, nan=0.0, posinf=0.0, neginf=0.0)
    return compose(
        values.get("TRANSLATION", np.zeros((count, 3))),
        values.get("ROTATION", np.tile((0.0, 0.0, 0.0, 1.0), (count, 1))),
        values.get("SCALE", np.ones((count, 3))),
    )


def _visible(file: GltfFile, order: Sequence[int], parents: Sequence[int], notes: ReportNotes) -> list[bool]:
    """Return whether each node of `order` is visible: neither it nor an ancestor is hidden (KHR_node_visibility)."""
    visible: list[bool] = []
    for index, parent in zip(order, parents, strict=True):
        node, hidden = file.entry("nodes", index, Node), False
        # Most nodes have no extensions, and there may be a million nodes.
        if node.extensions:
            extension = file.extension(node, VISIBILITY, Visibility, f"nodes[{index}]")
            hidden = extension is not None and extension.visible is False
            notes.honoured(f"{VISIBILITY}: hidden nodes", int(hidden))
        visible.append(not hidden and (parent < 0 or visible[parent]))
    return visible


def _tree(file: GltfFile, notes: ReportNotes) -> tuple[list[int], list[int], list[int]]:
    """Return (nodes of the default scene in depth-first order, position of each node's parent in that order or -1, depth of each).

    Raises InputError where a node has two parents or is an ancestor of itself: the walk would not end.
    """
    count = len(file.entries("nodes"))
    seen = bytearray(count)
    order: list[int] = []
    parents: list[int] = []
    depths: list[int] = []
    stack = [(root, -1) for root in reversed(scene_roots(file, notes))]
    while stack:
        index, parent = stack.pop()
        if seen[index]:
            raise file.fail(f"nodes[{index}]", "is reached twice; the node graph must be a tree without cycles")
        seen[index] = 1
        depth = depths[parent] + 1 if parent >= 0 else 0
        if depth > MAX_DEPTH:
            raise file.fail(f"nodes[{index}]", f"nodes are nested more than {MAX_DEPTH} deep; flatten the scene")
        place = len(order)
        order.append(index)
        parents.append(parent)
        depths.append(depth)
        children = file.entry("nodes", index, Node).children
        if not children:
            continue
        where = f"nodes[{index}].children"
        # More children than nodes must repeat one. They are refused before they fill the stack.
        if len(children) > count:
            raise file.fail(where, f"has {len(children)} entries for {count} nodes")
        stack.extend((file.index(child, count, where), place) for child in reversed(children))
    return order, parents, depths


def _world_matrices(
    file: GltfFile, order: Sequence[int], parents: Sequence[int], depths: Sequence[int], animated: NodeValues
) -> NDArray[np.float64]:
    """Return [N, 4, 4] local-to-world matrices, computed level by level. Raises InputError where one overflows."""
    worlds = local_matrices(file, order, animated)
    parent_rows, levels = np.array(parents, np.int64), np.array(depths, np.int64)
    by_level = np.argsort(levels, kind="stable")
    starts = np.searchsorted(levels[by_level], np.arange(int(levels.max(initial=0)) + 2))
    with np.errstate(over="ignore", invalid="ignore"):
        for level in range(1, len(starts) - 1):
            rows = by_level[starts[level] : starts[level + 1]]
            worlds[rows] = worlds[parent_rows[rows]] @ worlds[rows]
        wide = ~(np.abs(worlds) < 1e38).all(axis=(1, 2))
    if wide.any():
        where = f"nodes[{order[int(np.argmax(wide))]}]"
        raise file.fail(where, "has a transform that overflows; check its scale and its parents'")
    return worlds


def _weights(file: GltfFile, node: Node, index: int, mesh: int | None, animated: NodeValues) -> tuple[float, ...]:
    """Return the weights of the morph targets at a node: the animated ones, else the node's, else the mesh's.
    Raises InputError."""
    if mesh is None:
        return ()
    if animated and (index, "weights") in animated:
        return tuple(animated[index, "weights"].tolist())
    weights = node.weights
    return file.entry("meshes", mesh, Mesh).weights if isinstance(weights, UnsetType) else weights


def walk_nodes(
    file: GltfFile, accessors: Accessors, notes: ReportNotes, animated: NodeValues = NOTHING
) -> tuple[NodePlacements, ...]:
    """Return all nodes of the default scene in depth-first order. `animated` values replace those of the nodes.

    Raises InputError where a node has two parents or is an ancestor of itself, and where a transform overflows.
    """
    mesh_count, camera_count = len(file.entries("meshes")), len(file.entries("cameras"))
    order, parents, depths = _tree(file, notes)
    worlds = _world_matrices(file, order, parents, depths, animated)
    visible = _visible(file, order, parents, notes)
    placements: list[NodePlacements] = []
    for place, index in enumerate(order):
        node, where = file.entry("nodes", index, Node), f"nodes[{index}]"
        world = worlds[place]
        has_mesh = node.mesh != ABSENT and visible[place]
        mesh = file.index(node.mesh, mesh_count, f"{where}.mesh") if has_mesh else None
        camera = file.index(node.camera, camera_count, f"{where}.camera") if node.camera != ABSENT else None
        mesh_worlds = worlds[place : place + 1]
        instancing = file.extension(node, INSTANCING, Instancing, where) if node.extensions else None
        if instancing is not None and mesh is not None:
            field = f"{where}.extensions.{INSTANCING}"
            matrices = _instance_matrices(file, accessors, instancing.attributes, field, notes)
            with np.errstate(over="ignore", invalid="ignore"):
                mesh_worlds = world @ matrices
            if not (np.abs(mesh_worlds) < 1e38).all():
                raise file.fail(where, "has instance transforms that overflow; check their scales")
            notes.honoured(f"{INSTANCING}: instances", len(matrices))
        weights = _weights(file, node, index, mesh, animated)
        placements.append(NodePlacements(index, world, mesh, mesh_worlds, camera, visible[place], weights))
    return tuple(placements)
