"""Writing the files of an export: for the command line, and for a helper of the window."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from ntc.codec.quality import mse_of_psnr, psnr_of_mse
from ntc.errors import InputError
from ntc.io import write_text
from ntc.pack.file import read_pack
from viewer.export import ExportRequest, ImageFormat, ShaderLanguage
from viewer.export.gltf.export import ExportedScene, export_gltf
from viewer.export.images import Compressor
from viewer.export.web.export import export_page
from viewer.gl.context import create_headless_context
from viewer.render.resources.block_compressor import ImageCompressor
from viewer.render.resources.pack_buffers import scene_programs
from viewer.scene.images import ProgressReport
from viewer.scene.json_text import counted
from viewer.scene.text_table import Column, Table

LOSS_COLUMNS = (
    Column("name", "image"),
    Column("width", "width"),
    Column("height", "height"),
    Column("decoded_db", "decoded dB"),
    Column("stored_db", "format alone dB"),
    Column("both_db", "both dB"),
    Column("file_bytes", "bytes"),
)


def export_files(request: ExportRequest, report: ProgressReport | None = None) -> list[str]:
    """Write the files, and return lines that tell what was written. Raises InputError, and what `report` raises."""
    scene, pack, out = request.scene, request.packs[0], request.out
    if request.shader is not None:
        return _export_decoder(pack, request.shader, out)
    if request.page:
        return _export_page(request, report)
    if request.image_format is not None:
        return _export_textures(scene, pack, out, request.image_format, report)
    return result_lines(export_gltf(scene, pack, out, request.fallback, report))


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


def _export_decoder(pack_path: Path, language: ShaderLanguage, folder: Path) -> list[str]:
    """Write the decoder, and return what to tell. Raises InputError."""
    try:
        from viewer.export.shader.export import export_decoder
    except ImportError as error:
        problem = f"shaders are read by pcpp and tree-sitter ({error}); pip install 'ntc-viewer[export]'"
        raise InputError(f"--shader {language}: {problem}") from error
    exported = export_decoder(read_pack(pack_path), language, folder)
    return [f"wrote {folder / name} ({counted(size, 'byte')})" for name, size in exported.files.items()]


def _export_page(request: ExportRequest, report: ProgressReport | None) -> list[str]:
    """Write the page, and return what to tell. Raises InputError."""
    folder = request.out
    page = export_page(request.scene, request.packs, folder, request.fallback != "none", report)
    parts = f"packs {page.pack_bytes / 1e6:.2f} MB, original images {page.image_bytes / 1e6:.2f} MB"
    return [
        *(f"note: {line}" for line in page.missing),
        f"wrote {folder} ({counted(page.files, 'file')}, {page.total_bytes / 1e6:.2f} MB: {parts})",
        f"serve it by any file server: python3 -m http.server --directory {folder}",
    ]


def _export_textures(
    scene: Path, pack: Path, out: Path, image_format: ImageFormat, report: ProgressReport | None
) -> list[str]:
    """Write the scene with decoded images, and what they lost as CSV beside it; returns what to tell. Raises InputError."""
    # Decoding them takes torch, which takes a second to import.
    from viewer.export.textures import export_textures

    losses = out.with_name(f"{out.stem}.losses.csv")
    if losses.exists() and not losses.is_file():
        raise InputError(
            f"{losses}: is no file, and what images lose is written there; remove it, or name another --out"
        )
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
    """PSNR in dB of the mean of the squared errors of images, whose PSNR are `values`; all images have equal weight."""
    known = [value for value in values if value is not None]
    if not known:
        return "-"
    error = sum(map(mse_of_psnr, known)) / len(known)
    return f"{psnr_of_mse(error):.2f} dB" if error > 0.0 else "without loss"
