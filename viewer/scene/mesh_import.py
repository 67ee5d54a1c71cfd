"""OBJ, PLY and STL as GLB bytes in memory, through trimesh, which is imported only here."""

from pathlib import Path

from ntc.errors import InputError


def foreign_to_glb(path: Path) -> bytes:
    """The file at `path` as GLB bytes. Raises InputError where it cannot be read or holds no triangles."""
    if not path.is_file():
        raise InputError(f"{path}: cannot be read (no such file); check the path")
    import trimesh

    try:
        scene = trimesh.load_scene(path, process=False)
        meshes = [geometry for geometry in scene.geometry.values() if isinstance(geometry, trimesh.Trimesh)]
        data = scene.export(file_type="glb") if any(len(mesh.faces) for mesh in meshes) else None
    except Exception as error:  # trimesh's readers let any exception through on broken files.
        raise InputError(
            f"{path}: not a readable {path.suffix[1:].upper()} file ({error}); convert it to glTF"
        ) from error
    if not isinstance(data, bytes):
        raise InputError(f"{path}: holds no triangles to draw; open a file with meshes")
    return data
