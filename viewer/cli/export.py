"""`ntc-viewer export`: a scene and its pack for other programs."""

import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from ntc.codec.quality import mse_of_psnr, psnr_of_mse
from ntc.errors import InputError
from ntc.io import write_text
from ntc.pack.file import read_pack
from viewer.cli.options import ExportOptions
from viewer.cli.progress import TerminalProgress
from viewer.cli.table import Column, Table
from viewer.export import Fallback, ImageFormat, ShaderLanguage
from viewer.export.gltf.export import ExportedScene, export_gltf
from viewer.export.images import Compressor
from viewer.export.web.export import export_page
from viewer.gl.context import create_headless_context
from viewer.locations import builtin_scene_path, named_scene
from viewer.render.passes.compress import ImageCompressor
from viewer.render.resources.pack_buffers import scene_programs
from viewer.scene.json_text import counted
from viewer.scene.scene_files import PACK_SUFFIX, scene_file
from viewer.state.pack_files import PREFERRED_GROUPING, packs_beside

LOSS_COLUMNS = (
    Column("name", "image"),
    Column("width", "width"),
    Column("height", "height"),
    Column("decoded_db", "decoded dB"),
    Column("stored_db", "format alone dB"),
    Column("both_db", "both dB"),
    Column("file_bytes", "bytes"),
)


def _packs(options: ExportOptions, scene: Path) -> tuple[Path, ...]:
    """Return the packs that are named, else the one that lies beside the scene. Raises InputError for none, and for several that are
    not for a page."""
    if len(options.pack) > 1 and options.web is None:
        raise InputError(
            f"--pack {' '.join(map(str, options.pack))}: one pack is exported with a scene, several with --web; name one"
        )
    beside = packs_beside(scene)
    preferred = [path for path in beside if path.name.endswith(f".{PREFERRED_GROUPING}{PACK_SUFFIX}")]
    found = tuple(options.pack or preferred[:1] or beside[:1])
    if not found:
        raise InputError(
            f"{scene}: no pack lies beside it; name one by --pack F.ntc, or make one: "
            f"ntc-viewer encode {scene} --grouping clustered --out {scene.stem}.clustered.ntc"
        )
    return found


def result_lines(exported: ExportedScene) -> list[str]:
    """Return lines that tell what was written."""
    lines = [f"note: {line}" for line in exported.missing]
    lines.append(
        f"{exported.textures} of {counted(exported.of_textures, 'texture')} in the pack"
        + (f"; {counted(exported.replaced, 'image')} replaced or left out" if exported.replaced else "")
    )
    lines.append(f"wrote {exported.out} ({exported.scene_bytes / 1e6:.2f} MB with its files)")
    lines.append(f"wrote {exported.pack} ({exported.pack_bytes / 1e6:.2f} MB)")
    return lines


def export(options: ExportOptions) -> int:
    """Run `ntc-viewer export`. Raises InputError for bad input."""
    if (options.out is None) == (options.web is None):
        raise InputError(
            "export: name what to write: --out G.gltf, --out G.glb, --web DIR, or --shader LANGUAGE --out DIR"
        )
    if options.shader is not None and (options.out is None or options.image_format is not None):
        raise InputError(f"--shader {options.shader}: is written into the folder --out, without --web and --as")
    lines: list[str] = []
    scene = scene_file(named_scene(options.scene) if options.scene is not None else builtin_scene_path())
    packs = _packs(options, scene)
    pack = packs[0]
    if options.shader is not None and options.out is not None:
        sys.stdout.write("\n".join(_export_decoder(pack, options.shader, options.out)) + "\n")
        return 0
    if options.web is not None and options.image_format is not None:
        raise InputError(f"--as {options.image_format}: a page decodes by itself; leave it out, or write a glTF file")
    if options.web is not None:
        lines = _export_page(scene, packs, options.web, options.fallback)
    elif options.out is not None and options.image_format is not None:
        lines = _export_textures(scene, pack, options.out, options.image_format)
    elif options.out is not None:
        lines = result_lines(export_gltf(scene, pack, options.out, options.fallback))
    sys.stdout.write("\n".join(lines) + "\n")
    return 0


def _export_decoder(pack_path: Path, language: ShaderLanguage, folder: Path) -> list[str]:
    """Write the decoder, and return what to tell. Raises InputError."""
    try:
        from viewer.export.shader.export import export_decoder
    except ImportError as error:
        problem = f"shaders are read by pcpp and tree-sitter ({error}); pip install 'ntc-viewer[export]'"
        raise InputError(f"--shader {language}: {problem}") from error
    exported = export_decoder(read_pack(pack_path), language, folder)
    return [f"wrote {folder / name} ({counted(size, 'byte')})" for name, size in exported.files.items()]


def _export_page(scene: Path, packs: tuple[Path, ...], folder: Path, fallback: Fallback) -> list[str]:
    """Write the page, and return what to tell. Raises InputError."""
    with TerminalProgress(f"opening {scene.name}", "images") as report:
        page = export_page(scene, packs, folder, fallback != "none", report)
    parts = f"packs {page.pack_bytes / 1e6:.2f} MB, original images {page.image_bytes / 1e6:.2f} MB"
    return [
        *(f"note: {line}" for line in page.missing),
        f"wrote {folder} ({counted(page.files, 'file')}, {page.total_bytes / 1e6:.2f} MB: {parts})",
        f"serve it by any file server: python3 -m http.server --directory {folder}",
    ]


def _export_textures(scene: Path, pack: Path, out: Path, image_format: ImageFormat) -> list[str]:
    """Write the scene with decoded images, and what they lost as CSV beside it; returns what to tell. Raises InputError."""
    # Decoding them takes torch, which takes a second to import.
    from viewer.export.textures import export_textures

    losses = out.with_name(f"{out.stem}.losses.csv")
    if losses.exists() and not losses.is_file():
        raise InputError(
            f"{losses}: is no file, and what images lose is written there; remove it, or name another --out"
        )
    with TerminalProgress("images", lines=True) as report:
        compressor = _compressor() if image_format in ("bc7", "bc1") else None
        exported = export_textures(scene, pack, out, image_format, report, compressor)
    rows = [asdict(loss) for loss in exported.losses]
    table = Table(LOSS_COLUMNS, rows)
    write_text(losses, table.csv())
    lines = [f"note: {line}" for line in exported.missing]
    if exported.kept:
        lines.append(f"note: {counted(exported.kept, 'image')} not in the pack: kept as in the scene")
    lines += table.text().splitlines()
    mean = {key: _mean_db([row[key] for row in rows]) for key in ("decoded_db", "stored_db", "both_db")}
    parts = f"the pack {mean['decoded_db']}, {image_format} alone {mean['stored_db']}, both {mean['both_db']}"
    lines.append(f"PSNR of the mean square error over these images: {parts}")
    return [*lines, f"wrote {out} ({exported.scene_bytes / 1e6:.2f} MB with its files)", f"wrote {losses}"]


def _compressor() -> Compressor | None:
    """Return what compresses images to BC7 with OpenGL 4.3; None without, where the encoder of the extra `lab` does."""
    try:
        context = create_headless_context()
    except InputError:
        return None
    if not context.features.compute:
        return None
    compressor = ImageCompressor(context, scene_programs(context))
    return lambda rgba: compressor.blocks(rgba, "bc7")


def _mean_db(values: Sequence[float | None]) -> str:
    """PSNR in dB of the mean of the square errors that `values` stand for; images count alike."""
    known = [value for value in values if value is not None]
    if not known:
        return "-"
    error = sum(map(mse_of_psnr, known)) / len(known)
    return f"{psnr_of_mse(error):.2f} dB" if error > 0.0 else "without loss"
