"""`ntc-viewer export SCENE --pack F --out G.gltf`: the scene with its pack."""

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from ntc.codec.model import Pack
from ntc.io import read_file, write_bytes
from viewer.export import Fallback
from viewer.export.gltf.fallback import apply_fallback
from viewer.export.gltf.opened import open_export
from viewer.export.gltf.options import add_options, held_whole
from viewer.export.gltf.write import write_gltf
from viewer.scene.gltf.packed_textures import SWIZZLE
from viewer.scene.images import ProgressReport
from viewer.scene.scene_files import PACK_SUFFIX
from viewer.state.pack_files import same_place


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


def export_gltf(
    scene_path: Path, pack_path: Path, out: Path, fallback: Fallback, report: ProgressReport | None = None
) -> ExportedScene:
    """Write the scene at `scene_path` to `out`, its textures also naming the pack at `pack_path`, which is put beside it.

    Raises InputError, and what `report` raises; then no file is there that was not there before.
    """
    opened = open_export(scene_path, pack_path, out, report)
    pack, document, options = opened.pack, opened.document, opened.options
    whole = held_whole(opened.file, opened.scene, options)
    replaced = apply_fallback(opened, whole, fallback)
    # Where it lies beside the new file already, it is not copied.
    beside = same_place(pack_path.parent, out.parent) and pack_path.exists()
    target = pack_path if beside else exported_pack_path(out, pack)
    add_options(document, options, pack, quote(target.name))
    if fallback == "none" and replaced:
        document.use_extension(SWIZZLE, required=True)
    existed = target.exists()
    if not beside:
        write_bytes(target, read_file(pack_path))
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
        target.stat().st_size,
        opened.match.matched,
        len(opened.scene.textures),
        replaced,
        tuple(document.missing),
    )
