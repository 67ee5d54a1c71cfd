"""`ntc-viewer info`: prints the content of a scene, a pack or a folder."""

import json
import os
import sys
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, cast

from ntc.codec.codec import SAMPLED_TEXELS, CertifiedError
from ntc.codec.config import Precision
from ntc.codec.model import CodecSettings, Pack
from ntc.codec.quality import finite_or_none
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from ntc.io import is_partial
from ntc.library.index import is_library
from ntc.metrics.metrics import psnr_table
from ntc.pack.file import read_pack
from ntc.pack.other_formats import beginning_of, other_format, read_ntex
from viewer.cli.library import library_lines
from viewer.cli.options import InfoOptions
from viewer.cli.sources import load_with_progress
from viewer.locations import named_scene
from viewer.scene.json_text import counted, printable
from viewer.scene.load import load_scene
from viewer.scene.report import report_json, report_lines
from viewer.scene.scene_files import PACK_SUFFIX
from viewer.scene.text_table import Column, Table

KINDS = {".gltf": "glTF", ".glb": "GLB", PACK_SUFFIX: "pack"}
"""Kind of file by suffix; other files are skipped."""
LISTS = ("honoured", "ignored", "missing", "repaired")
"""Lists of the load report with a column in the table of files."""

Outcome = Literal["read", "refused", "crashed"]


@dataclass(frozen=True)
class FileInfo:
    """Result of reading one file."""

    file: str
    """Path below the folder."""
    kind: str
    outcome: Outcome
    message: str = ""
    """Reason why the file was not read, one line; "" where it was read."""
    triangles: int | None = None
    textures: int | None = None
    honoured: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    repaired: tuple[str, ...] = ()

    def row(self) -> dict[str, str | int | None]:
        """Return the file as a row of the table."""
        return {
            "file": self.file,
            "kind": self.kind,
            "result": self.outcome if not self.message else f"{self.outcome}: {self.message}",
            "triangles": self.triangles,
            "textures": self.textures,
            **{key: "; ".join(getattr(self, key)) or None for key in LISTS},
        }


COLUMNS = tuple(Column(key, key) for key in ("file", "kind", "result", "triangles", "textures", *LISTS))


def files_below(folder: Path) -> list[Path]:
    """Return every scene and pack below `folder`, sorted by path; links are not followed. Raises InputError."""

    def refuse(error: OSError) -> None:
        if isinstance(error, FileNotFoundError) and Path(error.filename) != folder:
            # The folder was deleted after its parent was listed.
            return
        raise InputError(f"{error.filename}: cannot be listed ({error.strerror}); check the path") from error

    files: list[Path] = []
    for place, _, names in os.walk(folder, onerror=refuse):
        paths = (Path(place, name) for name in names)
        files.extend(
            path
            for path in paths
            if path.suffix.lower() in KINDS and not is_partial(path) and path.is_file() and not path.is_symlink()
        )
    return sorted(files)


def describe_file(path: Path, name: str) -> FileInfo:
    """Return the result of reading the file at `path`, called `name` in the table. Errors become part of the result."""
    kind = KINDS[path.suffix.lower()]
    name = printable(name)
    try:
        if kind == "pack":
            pack = read_pack(path)
            facts = (f"grouping {printable(pack.grouping.name)}, {counted(len(pack.decoders), 'decoder')}",)
            return FileInfo(name, kind, "read", textures=len(pack.textures), honoured=facts)
        scene = load_scene(path)
    except InputError as error:
        # The table names the file already.
        return FileInfo(name, kind, "refused", str(error).removeprefix(f"{path}: "))
    except Exception as error:  # noqa: BLE001  A crash on one file becomes a row; the other files are still read.
        return FileInfo(name, kind, "crashed", printable(f"{type(error).__name__}: {error}"))
    report = scene.report
    return FileInfo(
        file=name,
        kind=kind,
        outcome="read",
        triangles=report.used["triangles"],
        textures=report.used["textures"],
        honoured=report.honoured,
        ignored=report.ignored,
        missing=report.missing,
        repaired=report.repaired,
    )


def describe_all(folder: Path) -> Iterator[FileInfo]:
    """Yield the results of all scenes and packs below `folder`, with progress on a terminal. Raises InputError for a bad folder."""
    paths = files_below(folder)
    on_terminal = sys.stderr.isatty()
    for number, path in enumerate(paths, 1):
        name = path.relative_to(folder).as_posix()
        if on_terminal:
            sys.stderr.write(f"\r\x1b[K{number} of {len(paths)}: {printable(name)[:60]}")
            sys.stderr.flush()
        yield describe_file(path, name)
    if on_terminal and paths:
        sys.stderr.write("\r\x1b[K")


def info_all(folder: Path, as_json: bool) -> int:
    """Run `ntc-viewer info --all`. The exit status is 0 even where files are refused. Raises InputError for a bad folder."""
    if not folder.is_dir():
        raise InputError(f"{folder}: not a folder; info FILE describes one file")
    files = list(describe_all(folder))
    counts = {outcome: sum(file.outcome == outcome for file in files) for outcome in ("read", "refused", "crashed")}
    if as_json:
        content: dict[str, Any] = {"folder": str(folder), **counts, "files": [asdict(file) for file in files]}
        sys.stdout.write(json.dumps(content, indent=2) + "\n")
        return 0
    if files:
        sys.stdout.write(Table(COLUMNS, [file.row() for file in files]).markdown() + "\n")
    sys.stdout.write(
        f"{counted(len(files), 'file')}: " + ", ".join(f"{count} {what}" for what, count in counts.items()) + "\n"
    )
    return 0


BOUND_COLUMNS = (
    Column("precision", "precision"),
    Column("error", "any texel"),
    Column("sampled", f"at {SAMPLED_TEXELS} texels"),
    Column("sum", "largest sum"),
    Column("overflow", "overflow"),
)


def bounds_json(bounds: Mapping[Precision, CertifiedError]) -> dict[str, Any]:
    """Return certified error bounds by precision, the worst of all textures (docs/explanation/accuracy.md). `largest_sum` is null
    where it exceeds fp32."""
    return {
        precision: {
            "error": bound.error,
            "sampled_texels_error": bound.sampled,
            "largest_sum": finite_or_none(bound.largest_sum),
            "may_overflow": bound.overflows,
        }
        for precision, bound in bounds.items()
    }


def bounds_lines(bounds: Mapping[Precision, CertifiedError]) -> list[str]:
    """Return `bounds_json` as lines of text."""
    rows = [
        {
            "precision": precision,
            "error": f"{bound.error:.1e}" if bound.error < 1.0 else "1 (nothing)",
            "sampled": f"{bound.sampled:.1e}",
            "sum": f"{bound.largest_sum:.1e}",
            "overflow": "may" if bound.overflows else "never",
        }
        for precision, bound in bounds.items()
    ]
    title = "certified largest error against exact decoding, in [0, 1] (half an 8-bit step is 2.0e-03):"
    return [title, *Table(BOUND_COLUMNS, rows).text().splitlines()]


def codec_json(settings: CodecSettings) -> dict[str, Any]:
    """Return the name and settings of a codec, and the cost of a decode, as JSON values."""
    fields = asdict(cast(Any, settings))
    further = codec_of(settings).settings_json(settings)
    return {"kind": settings.kind, **fields, "multiply_adds": settings.multiply_adds, **further}


def pack_json(pack: Pack) -> dict[str, Any]:
    """Return the content of `info F.ntc --json`."""
    bounds = codec_of(pack.config).certified_errors(pack)
    return {
        "file": str(pack.path),
        "grouping": pack.grouping.name,
        "parameters": dict(pack.grouping.parameters),
        "decoders": len(pack.decoders),
        "training": dict(pack.training),
        "codec": codec_json(pack.config),
        **psnr_table(pack).json(),
        "certified_error": bounds_json(bounds) if bounds else None,
    }


def pack_lines(pack: Pack) -> list[str]:
    """Return the lines of `info F.ntc`."""
    codec = codec_of(pack.config)
    bounds, shape = codec.certified_errors(pack), codec.decoder_text(pack.config)
    training = ", ".join(f"{key} {value}" for key, value in pack.training.items())
    return [
        f"{pack.path}: {counted(len(pack.textures), 'texture')}, {counted(len(pack.decoders), 'decoder')}{shape}, "
        f"grouping {printable(pack.grouping.name)}",
        *codec.settings_lines(pack.config),
        f"training: {printable(training)}",
        *psnr_table(pack).lines(),
        *(bounds_lines(bounds) if bounds else [codec.uncertified]),
    ]


def _ntc_file(path: Path) -> tuple[dict[str, Any], list[str]]:
    """Return (JSON, lines) of a pack, or of a texture set of NVIDIA's NTC, whose suffix is .ntc too. Raises InputError."""
    if other_format(beginning_of(path)) == "ntex":
        texture_set = read_ntex(path)
        return texture_set.json(), texture_set.lines()
    pack = read_pack(path)
    return pack_json(pack), pack_lines(pack)


def info(options: InfoOptions) -> int:
    """Run `ntc-viewer info`. Raises InputError for bad input."""
    if (options.file is None) == (options.all is None):
        raise InputError("info: name one file, or a folder with --all DIR")
    if options.all is not None:
        return info_all(options.all, options.json)
    assert options.file is not None
    if is_library(options.file):
        sys.stdout.write("\n".join(library_lines(options.file, options.json)) + "\n")
        return 0
    if options.file.suffix.lower() == PACK_SUFFIX:
        content, lines = _ntc_file(options.file)
    else:
        scene = load_with_progress(named_scene(options.file))
        content = report_json(scene)
        lines = report_lines(scene)
    sys.stdout.write(json.dumps(content, indent=2) + "\n" if options.json else "\n".join(lines) + "\n")
    return 0
