"""Loading of scenes: from a file, folder or archive to a `Scene`."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ntc.errors import InputError
from viewer.scene.bounds import world_bounds
from viewer.scene.gltf.buffers import Accessors, Buffers
from viewer.scene.gltf.cameras import read_cameras, read_lights
from viewer.scene.gltf.container import (
    GltfFile,
    check_required,
    ignored_extensions,
    parse_gltf,
    read_gltf,
    used_extensions,
)
from viewer.scene.gltf.geometry import GeometryReader
from viewer.scene.gltf.maps.material_sets import read_textures
from viewer.scene.gltf.materials import chosen_variant, read_materials, variant_names
from viewer.scene.gltf.motion.animations import read_animations
from viewer.scene.gltf.nodes import walk_nodes
from viewer.scene.gltf.packed_textures import pack_paths, with_packed_images
from viewer.scene.gltf.shapes import (
    SceneMotion,
    animated_weights,
    place_shapes,
    placed_shapes,
    posed_values,
    read_shapes,
)
from viewer.scene.image_folder import folder_gltf
from viewer.scene.images import ProgressReport
from viewer.scene.mesh_files import convert_mesh
from viewer.scene.model import Instances, Pose, Scene
from viewer.scene.report import ReportNotes
from viewer.scene.scene_files import ARCHIVE_SUFFIX, MESH_SUFFIXES, require_scene, scene_file, unpacked_scene

MAX_INSTANCES = 1 << 24
FREE_INSTANCES = 1 << 21
"""Instances that any file may have. More are allowed only in proportion to its bytes, one for each."""


def load_scene(
    path: Path,
    variant: str = "",
    pose: Pose | None = None,
    report: ProgressReport | None = None,
    before: Scene | None = None,
) -> Scene:
    """Return the scene in the .gltf, .glb, .obj, .ply, .stl or .off file at `path`, or in the folder or zip archive there. A folder
    with images and no scene becomes a scene that shows them on panels and spheres.

    `variant`: name of the material variant to draw (KHR_materials_variants), "" for the materials that primitives name themselves.
    The textures of all variants are read. `pose`: animation and time of the scene's pose. `report` receives the number of images
    that are examined. `before`: the same scene in another variant or pose. If its file has not changed since, materials, textures
    and their lines of the load report are taken from it, and no image is read. Pixels that are no longer in memory are read from
    their files again when they are needed.

    Raises the exceptions of `report`, and InputError for an unknown variant or animation, and for a file that is missing, in another
    format, broken, without triangles, too large for the memory, or that requires an unsupported extension. Missing and broken images
    raise nothing: the load report names them.
    """
    path = scene_file(Path(path))
    require_scene(path)
    try:
        return _load(path, variant, pose, report, before)
    except MemoryError as error:
        raise InputError(f"{path}: takes more memory than there is; split the scene or reduce its textures") from error


def _load(path: Path, variant: str, pose: Pose | None, report: ProgressReport | None, before: Scene | None) -> Scene:
    # Taken before the file is read, so that a change while it is read is noticed.
    stamp = _stamp(path)
    if before is not None and (before.path, before.file_stamp) != (path, stamp):
        before = None
    return replace(build_scene(_container(path), path.stem, path, variant, pose, report, before), file_stamp=stamp)


def _stamp(path: Path) -> tuple[int, int]:
    """Return (bytes, nanoseconds of the last change) of a file. Raises InputError."""
    try:
        state = path.stat()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    return state.st_size, state.st_mtime_ns


def open_container(path: Path) -> GltfFile:
    """Return the glTF container at `path`, any path that `load_scene` takes. Other formats are converted. Raises InputError."""
    path = scene_file(Path(path))
    require_scene(path)
    return _container(path)


def _container(path: Path) -> GltfFile:
    if path.suffix.lower() == ARCHIVE_SUFFIX:
        unpacked = unpacked_scene(path)
        return replace(_file(unpacked.scene, f"{path}/{unpacked.scene.name}"), keeps=unpacked)
    return _file(path, str(path))


def _file(path: Path, name: str) -> GltfFile:
    if path.is_dir():
        return folder_gltf(path)
    if path.suffix.lower() in MESH_SUFFIXES:
        mesh = convert_mesh(path)
        return replace(parse_gltf(mesh.glb, name, None), converted=mesh)
    return read_gltf(path, name)


def build_scene(
    file: GltfFile,
    name: str,
    path: Path | None,
    variant: str = "",
    pose: Pose | None = None,
    report: ProgressReport | None = None,
    before: Scene | None = None,
) -> Scene:
    """Return the scene in the glTF container `file`, called `name`, in a material variant and a pose.

    `before`: the scene in the same container, in another variant or pose, as `load_scene` takes it. Raises InputError.
    """
    check_required(file)
    notes = ReportNotes()
    file = with_packed_images(file)
    buffers = Buffers(file)
    accessors = Accessors(file, buffers)
    sources = read_materials(file, notes)
    animations = read_animations(file, accessors, notes)
    placements = walk_nodes(file, accessors, notes, posed_values(animations, pose, name))
    variants = variant_names(file)
    notes.honoured("KHR_materials_variants: variants", len(variants))
    chosen = chosen_variant(variants, variant, name)
    geometry_reader = GeometryReader(file, buffers, accessors, sources, notes, chosen)
    shapes = placed_shapes(file, accessors, placements, animated_weights(animations))
    primitives, ranges = read_shapes(shapes, geometry_reader)
    most_instances = min(MAX_INSTANCES, FREE_INSTANCES + buffers.byte_count)
    instances = place_shapes(file, shapes, ranges, most_instances)
    if len(instances.primitive) == 0:
        raise file.fail("scene", "holds no triangles to draw; open a file with meshes")
    geometry = geometry_reader.finish()
    moves = (tuple(geometry_reader.moving), ranges, tuple(primitives), geometry, most_instances)
    motion = SceneMotion(name, file, accessors, animations, *moves) if animations else None
    drawn = frozenset(geometry_reader.all_materials)
    # The last source is the default material, which is dropped unless a primitive uses it.
    material_count = len(sources) if len(sources) - 1 in drawn else len(sources) - 1
    if before is not None and len(before.materials) == material_count:
        materials, textures = before.materials, before.textures
    else:
        before = None
        materials, textures = read_textures(file, buffers, sources, drawn, notes, path, report)
        materials = materials[:material_count]
    bounds = world_bounds(geometry, primitives, instances)
    cameras = read_cameras(file, placements, bounds.astype(np.float64).mean(axis=0), notes)
    lights = read_lights(file, placements, notes)
    _note_whole_file(file, instances, notes)
    packs = pack_paths(file, notes)
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
        "images": len({reference.image for i in drawn for reference in sources[i].maps.values()}),
        "textures": len(textures),
        "cameras": len(cameras),
        "lights": len(lights),
    }
    node_names = tuple(file.label(node, f"node {i}") for i, node in enumerate(file.entries("nodes")))
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
        report=notes.report(used) if before is None else replace(before.report, used=used),
        lights=lights,
        variants=variants,
        variant=variant,
        animations=tuple(animation.facts for animation in animations),
        pose=pose,
        motion=motion,
        packs=packs,
    )


def _note_whole_file(file: GltfFile, instances: Instances, notes: ReportNotes) -> None:
    for extension in ignored_extensions(file):
        notes.ignored(f"extension {extension}")
    if file.converted is not None:
        for add, lines in (
            (notes.honoured, file.converted.honoured),
            (notes.ignored, file.converted.ignored),
            (notes.missing, file.converted.missing),
        ):
            for line in lines:
                add(line)
    notes.honoured("KHR_mesh_quantization", int("KHR_mesh_quantization" in used_extensions(file)))
    with np.errstate(over="ignore", invalid="ignore"):
        determinants = np.linalg.det(instances.transform[:, :3, :3].astype(np.float64))
    notes.honoured("mirrored placements (negative determinant)", int((determinants < 0).sum()))
