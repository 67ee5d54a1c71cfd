"""`ntc-viewer info`: what is in a scene or pack."""

import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ntc.accuracy.error_bound import ErrorBound, pack_bounds
from ntc.accuracy.precision_choice import sampled_bound
from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.config import CodecConfig, Precision
from ntc.codec.model import AnyCodec, Pack
from ntc.errors import InputError
from ntc.library.index import is_library
from ntc.metrics.metrics import finite_or_none, psnr_table
from ntc.pack.file import read_pack
from ntc.pack.other_formats import beginning_of, other_format, read_ntex
from viewer.cli.info_all import info_all
from viewer.cli.library_list import library_lines
from viewer.cli.options import InfoOptions
from viewer.cli.sources import load_with_progress
from viewer.cli.table import Column, Table
from viewer.locations import named_scene
from viewer.scene.json_text import printable
from viewer.scene.report import report_json, report_lines
from viewer.scene.scene_files import PACK_SUFFIX

SAMPLED_TEXELS = 2048


@dataclass(frozen=True)
class PackBound:
    """Certified error bounds of a pack at one precision, in [0, 1]."""

    whole: ErrorBound
    """For every possible texel."""
    sampled: float
    """The largest bound among SAMPLED_TEXELS sampled texels."""


def certified(pack: Pack) -> dict[Precision, PackBound]:
    """Error bounds by precision, computed from the pack alone: the same on every machine."""
    return {
        precision: PackBound(bound, sampled_bound(pack, precision, SAMPLED_TEXELS))
        for precision, bound in pack_bounds(pack).items()
    }


BOUND_COLUMNS = (
    Column("precision", "precision"),
    Column("error", "any texel"),
    Column("sampled", f"at {SAMPLED_TEXELS} texels"),
    Column("sum", "largest sum"),
    Column("overflow", "overflow"),
)


def bounds_json(bounds: dict[Precision, PackBound]) -> dict[str, Any]:
    """Certified bounds by precision, the worst of all textures (docs/accuracy.md). `largest_sum` is null beyond fp32."""
    return {
        precision: {
            "error": bound.whole.error,
            "sampled_texels_error": bound.sampled,
            "largest_sum": finite_or_none(max(bound.whole.activations)),
            "may_overflow": bound.whole.overflows,
        }
        for precision, bound in bounds.items()
    }


def bounds_lines(bounds: dict[Precision, PackBound]) -> list[str]:
    """`bounds_json` as lines of text."""
    rows = [
        {
            "precision": precision,
            "error": f"{bound.whole.error:.1e}" if bound.whole.error < 1.0 else "1 (nothing)",
            "sampled": f"{bound.sampled:.1e}",
            "sum": f"{max(bound.whole.activations):.1e}",
            "overflow": "may" if bound.whole.overflows else "never",
        }
        for precision, bound in bounds.items()
    ]
    title = "certified largest error against exact decoding, in [0, 1] (half an 8-bit step is 2.0e-03):"
    return [title, *Table(BOUND_COLUMNS, rows).text().splitlines()]


BOUNDS_ARE_FOR_GRID = (
    "certified bounds of the error: for codec grid alone; codec block decodes in fp32 at every precision"
)


def codec_json(config: AnyCodec) -> dict[str, Any]:
    """The codec's settings, what it is called, and what a decode costs."""
    content = {"kind": config.kind, **asdict(config), "multiply_adds": config.multiply_adds}
    if isinstance(config, BlockCodecConfig):
        content["bits_per_texel_of_codes"] = config.mean_words * 32.0 / config.block_texels
    return content


def block_lines(config: AnyCodec) -> list[str]:
    """A line about the settings of codec `block`; nothing for codec `grid`, whose shape stands with its decoders."""
    if not isinstance(config, BlockCodecConfig):
        return []
    side = config.block_side
    *others, last = map(str, config.block_words)
    sizes = f"{', '.join(others)} or {last}" if others else last
    return [
        f"codec block: blocks of {side}x{side} texels, codes of {sizes} words of 32 bits, "
        f"{config.mean_words * 32.0 / config.block_texels:.2f} bits a texel, "
        f"{config.coefficients} coefficients, {config.modes} modes, {config.multiply_adds} multiply-adds a texel at most"
    ]


def pack_json(pack: Pack) -> dict[str, Any]:
    """What `info F.ntc --json` prints."""
    return {
        "file": str(pack.path),
        "grouping": pack.grouping.name,
        "parameters": dict(pack.grouping.parameters),
        "decoders": len(pack.decoders),
        "training": dict(pack.training),
        "codec": codec_json(pack.config),
        **psnr_table(pack).json(),
        "certified_error": bounds_json(certified(pack)) if isinstance(pack.config, CodecConfig) else None,
    }


def pack_lines(pack: Pack) -> list[str]:
    """What `info F.ntc` prints."""
    config = pack.config
    if isinstance(config, CodecConfig):
        shape = " " + "-".join(
            str(side) for side in (config.decoder_inputs, *(rows for rows, _ in config.layer_shapes))
        )
        accuracy = bounds_lines(certified(pack))
    else:
        shape, accuracy = "", [BOUNDS_ARE_FOR_GRID]
    training = ", ".join(f"{key} {value}" for key, value in pack.training.items())
    return [
        f"{pack.path}: {len(pack.textures)} textures, {len(pack.decoders)} decoders{shape}, grouping {printable(pack.grouping.name)}",
        *block_lines(config),
        f"training: {printable(training)}",
        *psnr_table(pack).lines(),
        *accuracy,
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
