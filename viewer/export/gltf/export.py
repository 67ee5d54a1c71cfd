"""`ntc-viewer export SCENE --pack F --out G.gltf`: the scene with its pack."""

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.io import read_file, write_bytes
from ntc.pack.file import read_pack
from ntc.pack.match import require_match
from viewer.export.gltf.document import read_document
from viewer.export.gltf.fallback import Fallback, apply_fallback
from viewer.export.gltf.options import add_options, held_whole, packed_options, remove_packs
from viewer.export.gltf.write import files_folder, write_gltf
from viewer.scene.gltf.packed_textures import SWIZZLE, with_packed_images
from viewer.scene.images import ProgressReport
from viewer.scene.load import build_scene, open_container
from viewer.scene.scene_files import PACK_SUFFIX, SCENE_SUFFIXES, scene_file
from viewer.state.pack_files import match_scene, same_place


@dataclass(frozen=True)
class ExportedScene:
    """What was written."""

    out: Path
    pack: Path
    scene_bytes: int
    """The glTF file with its buffers and images."""
    pack_bytes: int
    textures: int
    """Textures of the scene that the pack holds."""
    of_textures: int
    replaced: int
    """Images that were replaced or left out."""
    missing: tuple[str, ...]
    """Images that could not be read."""


def exported_pack_path(out: Path, pack: Pack) -> Path:
    """Where the pack of an exported scene lies: beside it, so that it is also found by its name."""
    return out.with_name(f"{out.stem}.{pack.grouping.name}{PACK_SUFFIX}")


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


def export_gltf(
    scene_path: Path, pack_path: Path, out: Path, fallback: Fallback, report: ProgressReport | None = None
) -> ExportedScene:
    """Write the scene at `scene_path` to `out`, its textures also naming the pack at `pack_path`, which is put beside it.

    Raises InputError, and what `report` raises; then no file is there that was not there before.
    """
    scene_path = scene_file(scene_path)
    check_out(out, scene_path)
    file = open_container(scene_path)
    pack = read_pack(pack_path)
    scene = build_scene(file, scene_path.stem, scene_path, report=report)
    match = match_scene(pack, scene)
    require_match(pack, match, scene.name)
    document = read_document(file)
    remove_packs(document)
    with_packed = with_packed_images(file)
    options = packed_options(with_packed, scene, pack, match.texture_index)
    whole = held_whole(with_packed, scene, options)
    replaced = apply_fallback(document, file, whole, fallback)
    # Where it lies beside the new file already, it is not copied.
    beside = same_place(pack_path.parent, out.parent) and pack_path.exists()
    target = pack_path if beside else exported_pack_path(out, pack)
    add_options(document, options, pack, quote(target.name))
    if fallback == "none" and replaced:
        document.use_extension(SWIZZLE, required=True)
    existed = target.exists()
    data = read_file(pack_path)
    if not beside:
        write_bytes(target, data)
    try:
        written = write_gltf(out, document)
    except BaseException:
        if not existed:
            target.unlink(missing_ok=True)
        raise
    return ExportedScene(
        out,
        target,
        written,
        len(data),
        match.matched,
        len(scene.textures),
        replaced,
        tuple(document.missing),
    )
