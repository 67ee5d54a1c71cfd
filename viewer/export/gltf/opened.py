"""A scene and its pack, opened to be exported."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.pack.file import read_pack
from ntc.pack.match import PackMatch, require_match
from viewer.export.gltf.document import GltfDocument, read_document
from viewer.export.gltf.options import PackedTextureOption, packed_options, remove_packs
from viewer.export.gltf.write import files_folder
from viewer.scene.gltf.buffers import Buffers
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.packed_textures import with_packed_images
from viewer.scene.images import ProgressReport
from viewer.scene.load import build_scene, open_container
from viewer.scene.model import Scene
from viewer.scene.scene_files import SCENE_SUFFIXES, scene_file
from viewer.state.pack_files import match_scene, same_place


@dataclass(frozen=True, eq=False)
class OpenedExport:
    """What an exporter of glTF works on."""

    file: GltfFile
    """As it was read; images that only a pack holds are entries too."""
    buffers: Buffers
    """Of `file`, each read once."""
    scene: Scene
    pack: Pack
    match: PackMatch
    document: GltfDocument
    """To be changed and written."""
    options: Mapping[int, list[PackedTextureOption]]
    """By texture entry of the file: the textures of the pack that stand for it."""


def check_out(out: Path, scene: Path) -> None:
    """Raises InputError for a file that is no glTF by its name, and for the scene itself."""
    if out.suffix.lower() not in SCENE_SUFFIXES:
        raise InputError(f"--out {out}: name a {' or '.join(SCENE_SUFFIXES)} file")
    if out.is_dir() or (files_folder(out).exists() and not files_folder(out).is_dir()):
        raise InputError(
            f"--out {out}: is a folder, or {files_folder(out).name} beside it is a file; name another file"
        )
    if out.exists() and same_place(out, scene):
        raise InputError(f"--out {out}: is the scene itself; name another file")


def open_export(scene_path: Path, pack_path: Path, out: Path, report: ProgressReport | None = None) -> OpenedExport:
    """Open the scene at `scene_path` with the pack at `pack_path`, to be written to `out`.

    Raises InputError for what cannot be read, for a pack of another scene and for an `out` that will not do; what `report` raises.
    """
    scene_path = scene_file(scene_path)
    check_out(out, scene_path)
    file = open_container(scene_path)
    pack = read_pack(pack_path)
    scene = build_scene(file, scene_path.stem, scene_path, report=report)
    match = match_scene(pack, scene)
    require_match(pack, match, scene.name)
    buffers = Buffers(file)
    document = read_document(file, buffers)
    remove_packs(document)
    file = with_packed_images(file)
    options = packed_options(file, scene, pack, match.texture_index)
    return OpenedExport(file, buffers, scene, pack, match, document, options)
