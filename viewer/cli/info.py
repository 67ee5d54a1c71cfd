"""`ntc-viewer info`: what is in a scene or pack."""

import json
import sys
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast

from ntc.codec.codec import SAMPLED_TEXELS, CertifiedError
from ntc.codec.config import Precision
from ntc.codec.model import CodecSettings, Pack
from ntc.codec.quality import finite_or_none
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from ntc.library.index import is_library
from ntc.metrics.metrics import psnr_table
from ntc.pack.file import read_pack
from ntc.pack.other_formats import beginning_of, other_format, read_ntex
from viewer.cli.info_all import info_all
from viewer.cli.library_list import library_lines
from viewer.cli.options import InfoOptions
from viewer.cli.sources import load_with_progress
from viewer.cli.table import Column, Table
from viewer.locations import named_scene
from viewer.scene.json_text import counted, printable
from viewer.scene.report import report_json, report_lines
from viewer.scene.scene_files import PACK_SUFFIX

BOUND_COLUMNS = (
    Column("precision", "precision"),
    Column("error", "any texel"),
    Column("sampled", f"at {SAMPLED_TEXELS} texels"),
    Column("sum", "largest sum"),
    Column("overflow", "overflow"),
)


def bounds_json(bounds: Mapping[Precision, CertifiedError]) -> dict[str, Any]:
    """Certified bounds by precision, the worst of all textures (docs/explanation/accuracy.md). `largest_sum` is null beyond fp32."""
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
    """`bounds_json` as lines of text."""
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
    """The codec's settings, what it is called, and what a decode costs."""
    fields = asdict(cast(Any, settings))
    own = codec_of(settings).settings_json(settings)
    return {"kind": settings.kind, **fields, "multiply_adds": settings.multiply_adds, **own}


def pack_json(pack: Pack) -> dict[str, Any]:
    """What `info F.ntc --json` prints."""
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
    """What `info F.ntc` prints."""
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
    """(JSON, lines) of a pack, or of NVIDIA's file of that suffix. Raises InputError."""
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
