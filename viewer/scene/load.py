"""Opens a scene file."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from viewer.scene.bounds import world_bounds
from viewer.scene.extensions import check_required, ignored_extensions, names_of
from viewer.scene.gltf_accessors import Accessors
from viewer.scene.gltf_buffers import Buffers
from viewer.scene.gltf_cameras import read_cameras
from viewer.scene.gltf_container import GltfFile, parse_gltf, read_gltf
from viewer.scene.gltf_geometry import GeometryReader
from viewer.scene.gltf_images import read_images
from viewer.scene.gltf_materials import read_materials
from viewer.scene.gltf_nodes import NodePlacements, walk_nodes
from viewer.scene.model import Instances, Primitive, Scene
from viewer.scene.report_notes import ReportNotes

FOREIGN_SUFFIXES = frozenset({".obj", ".ply", ".stl"})
"""Formats that are turned into GLB first."""
MAX_INSTANCES = 1 << 24


def load_scene(path: Path) -> Scene:
    """The scene in the .gltf, .glb, .obj, .ply or .stl file at `path`.

    Raises InputError where the file is missing, broken, requires an extension that is not supported, or holds no
    triangles. Missing and broken images are no error: the load report names them.
    """
    path = Path(path)
    if path.suffix.lower() in FOREIGN_SUFFIXES:
        from viewer.scene.foreign import foreign_to_glb

        return build_scene(parse_gltf(foreign_to_glb(path), str(path), None), path.stem, path)
    return build_scene(read_gltf(path), path.stem, path)


def build_scene(file: GltfFile, name: str, path: Path | None) -> Scene:
    """The scene in the glTF container `file`, called `name`. Raises InputError."""
    check_required(file)
    notes = ReportNotes()
    buffers = Buffers(file)
    accessors = Accessors(file, buffers)
    sources = read_materials(file, notes)
    placements = walk_nodes(file, accessors, notes)
    geometry_reader = GeometryReader(file, buffers, accessors, sources, notes)
    primitives, ranges = _read_meshes(placements, geometry_reader)
    instances = _place(file, placements, ranges)
    if len(instances.primitive) == 0:
        raise file.fail("scene", "holds no triangles to draw; open a file with meshes")
    geometry = geometry_reader.finish()
    drawn = frozenset(primitive.material for primitive in primitives)
    materials, textures = read_images(file, buffers, sources, drawn, notes)
    if len(sources) - 1 not in drawn:
        materials = materials[:-1]
    bounds = world_bounds(geometry, primitives, instances)
    cameras = read_cameras(file, placements, bounds.astype(np.float64).mean(axis=0), notes)
    _note_whole_file(file, instances, notes)
    triangles = np.array([primitive.index_count // 3 for primitive in primitives], np.int64)
    used = {
        "nodes": len(placements),
        "meshes": len(ranges),
        "primitives": len(primitives),
        "instances": len(instances.primitive),
        "triangles": int(triangles.sum()),
        "triangles drawn": int(triangles[instances.primitive].sum()),
        "vertices": len(geometry.positions),
        "materials": len(drawn),
        "images": len({sources[i].image for i in drawn} - {None}),
        "textures": len(textures),
        "cameras": len(cameras),
    }
    node_names = tuple(file.label(node, f"node {i}") for i, node in enumerate(file.entries_checked("nodes")))
    return Scene(
        name=name,
        path=path,
        geometry=geometry,
        primitives=tuple(primitives),
        instances=instances,
        materials=materials,
        textures=textures,
        cameras=cameras,
        node_names=node_names,
        bounds=bounds,
        report=notes.report(used),
    )


def _read_meshes(
    placements: Sequence[NodePlacements], reader: GeometryReader
) -> tuple[list[Primitive], dict[int, tuple[int, int]]]:
    """(all primitives, (first, count) of each mesh that stands somewhere)."""
    primitives: list[Primitive] = []
    ranges: dict[int, tuple[int, int]] = {}
    for placement in placements:
        if placement.mesh is not None and placement.mesh not in ranges:
            read = reader.read_mesh(placement.mesh)
            ranges[placement.mesh] = (len(primitives), len(read))
            primitives.extend(read)
    return primitives, ranges


def _place(file: GltfFile, placements: Sequence[NodePlacements], ranges: dict[int, tuple[int, int]]) -> Instances:
    primitive: list[np.ndarray] = [np.zeros(0, np.int32)]
    transform: list[np.ndarray] = [np.zeros((0, 4, 4), np.float32)]
    node: list[np.ndarray] = [np.zeros(0, np.int32)]
    total = 0
    for placement in placements:
        if placement.mesh is None:
            continue
        first, count = ranges[placement.mesh]
        copies = len(placement.mesh_worlds)
        total += count * copies
        if total > MAX_INSTANCES:
            raise file.fail(f"nodes[{placement.node}]", f"the scene has more than {MAX_INSTANCES} instances; split it")
        primitive.append(np.tile(np.arange(first, first + count, dtype=np.int32), copies))
        transform.append(np.repeat(placement.mesh_worlds.astype(np.float32), count, axis=0))
        node.append(np.full(count * copies, placement.node, np.int32))
    return Instances(np.concatenate(primitive), np.concatenate(transform), np.concatenate(node))


def _note_whole_file(file: GltfFile, instances: Instances, notes: ReportNotes) -> None:
    for extension in ignored_extensions(file):
        notes.ignored(f"extension {extension}")
    notes.honoured("KHR_mesh_quantization", int("KHR_mesh_quantization" in names_of(file, "extensionsUsed")))
    notes.ignored("animations", len(file.array(file.json, "animations", "file")))
    with np.errstate(over="ignore", invalid="ignore"):
        determinants = np.linalg.det(instances.transform[:, :3, :3].astype(np.float64))
    notes.honoured("mirrored placements (negative determinant)", int((determinants < 0).sum()))
