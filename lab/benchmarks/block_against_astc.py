"""Codec `block` in every grouping beside ASTC (astcenc, thorough): the same images, at ASTC's rates, mips and tables counted.

python -m lab.benchmarks.block_against_astc SCENE|FOLDER ... --most 100 --json lab/benchmarks/results/studies/block_against_astc.json
"""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.commands.rate_points import read_textures
from lab.runner import write_figure
from lab.studies.block_codec import measured_block_codec
from lab.studies.hardware_formats import FormatStudy
from lab.studies.rate_table import RatePoint, rate_figure, rate_table
from lab.studies.set_quality import PictureQuality
from ntc.codec.config import GroupingConfig, GroupingName
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from ntc.io import write_text
from ntc.metrics.block_compression import BlockFormat
from viewer.cli.table import Cell, Column, Table
from viewer.locations import blocks_cache, features_cache

FORMATS: tuple[BlockFormat, ...] = ("astc-12x10", "astc-8x8", "astc-6x5")
"""About 1, 2 and 4 bits a texel."""
GROUPINGS: tuple[GroupingName, ...] = ("clustered", "single", "baseline")
ASTC = "ASTC"
MIPS = 4
"""Mips whose PSNR is compared, from mip 0 on."""
Measured = tuple[Sequence[PictureQuality], RatePoint]
DIFFERENCES = (
    Column("grouping", "grouping"),
    Column("format", "beside"),
    Column("bits_per_texel", "bits/texel, more", 3),
    Column("mean_db", "mean dB, more"),
    Column("mip_1_db", "of mip 1"),
    Column("mip_2_db", "of mip 2"),
    Column("mip_3_db", "of mip 3"),
    Column("of_mean_mse_db", "dB of mean MSE, more"),
    Column("ssim", "SSIM, more", 4),
    Column("flip", "FLIP, more", 4),
    Column("largest_loss_db", "most a texture loses, dB"),
    Column("largest_loss_texture", "which"),
    Column("worse_by_over_1_db", "textures worse by over 1 dB"),
)


@dataclass(frozen=True)
class Comparison:
    """One set of textures."""

    name: str
    textures: int
    points: tuple[RatePoint, ...]
    differences: Table
    """Codec `block` less ASTC, for each grouping and rate."""
    worse: tuple[Mapping[str, Cell], ...]
    """Textures that lose more than 1 dB at mip 0, by grouping and rate."""

    def record(self) -> dict[str, Any]:
        """Everything as JSON values."""
        rows = [dict(row) for row in self.differences.rows]
        return {
            "source": self.name,
            "textures": self.textures,
            "points": [p.row() for p in self.points],
            "differences": rows,
            "worse_by_over_1_db": [dict(row) for row in self.worse],
        }

    def text(self) -> str:
        """Both tables as Markdown."""
        heading = f"## {self.name}: {self.textures} textures\n\n"
        return f"{heading}{rate_table(self.points).markdown()}\n{self.differences.markdown()}"


def _losses(own: Measured, other: Measured) -> NDArray[np.float64]:
    """[textures] dB that codec `block` is below ASTC at mip 0."""
    return np.array([b.psnr_db - a.psnr_db for a, b in zip(own[0], other[0], strict=True)])


def _coarse_db(measured: Measured, mip: int) -> float:
    """Mean PSNR of mip `mip` over the textures that have it."""
    return float(np.mean([each.coarse_db[mip - 1] for each in measured[0] if len(each.coarse_db) >= mip]))


def _difference(
    grouping: str,
    names: Sequence[str],
    own: Measured,
    other: Measured,
) -> dict[str, Cell]:
    mine, theirs = own[1].row(), other[1].row()
    losses = _losses(own, other)
    keys = ("bits_per_texel", "mean_db", "of_mean_mse_db", "ssim", "flip")
    return {
        "grouping": grouping,
        "format": other[1].setting,
        **{key: float(mine[key] or 0.0) - float(theirs[key] or 0.0) for key in keys},
        **{f"astc_mip_{mip}_db": _coarse_db(other, mip) for mip in range(1, MIPS)},
        **{f"mip_{mip}_db": _coarse_db(own, mip) - _coarse_db(other, mip) for mip in range(1, MIPS)},
        "largest_loss_db": float(max(0.0, losses.max())),
        "largest_loss_texture": names[int(losses.argmax())] if losses.max() > 0.0 else None,
        "worse_by_over_1_db": int((losses > 1.0).sum()),
    }


def compare(
    name: str,
    textures: Sequence[SourceTexture],
    clusters: int,
    groupings: Sequence[GroupingName],
    cache: Path,
    flip_every: int,
) -> Comparison:
    """Every format of ASTC, and codec `block` in every grouping at its bits; FLIP of every so many textures. Raises InputError."""
    study, inputs = FormatStudy(cache, mips=MIPS), GroupingInputs(features=FeatureOptions(cache=features_cache()))
    astc = {}
    for block_format in FORMATS:
        pictures, quality = study.measure_all(textures, block_format, flip_every=flip_every)
        astc[block_format] = (pictures, RatePoint(ASTC, block_format, quality))
        print(f"{name}: {json.dumps(astc[block_format][1].row())}", flush=True)
    points, rows, worse = [point for _, point in astc.values()], [], list[Mapping[str, Cell]]()
    for grouping_name in groupings:
        grouping = make_grouping(GroupingConfig(grouping_name, min(clusters, len(textures))), textures, inputs)
        for block_format, other in astc.items():
            bits = other[1].quality.bits_per_texel
            pictures, quality = measured_block_codec(textures, grouping, bits, flip_every, mips=MIPS)
            point = RatePoint(f"block, {grouping_name}", f"as {block_format}", quality)
            points.append(point)
            rows.append(_difference(grouping_name, [t.name for t in textures], (pictures, point), other))
            losses = _losses((pictures, point), other)
            for index in np.nonzero(losses > 1.0)[0].tolist():
                lost = {"texture": textures[index].name, "astc_db": other[0][index].psnr_db, "loss_db": losses[index]}
                worse.append({"grouping": grouping_name, "format": block_format, **lost})
            print(f"{name}: {json.dumps(rows[-1])}", flush=True)
    return Comparison(name, len(textures), tuple(points), Table(DIFFERENCES, rows), tuple(worse))


def _write(path: Path, settings: Mapping[str, int], compared: Sequence[Comparison]) -> None:
    """Write the record, and table and plot beside it, of the sets that are done."""
    record = {**settings, "sets": [each.record() for each in compared]}
    write_text(path, json.dumps(record, indent=1) + "\n")
    text = "\n".join(each.text() for each in compared)
    write_text(path.with_suffix(".md"), f"# Codec block beside ASTC\n\n{text}")
    panels = {f"{each.name}: {each.textures} textures": each.points for each in compared}
    write_figure(path.with_suffix(".png"), rate_figure(panels))


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare, print, and write the record, a table (.md) and a plot (.png) beside it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sources", type=Path, nargs="+", help="scenes, or folders of images without alpha")
    parser.add_argument("--texture-size", type=int, default=512)
    parser.add_argument("--most", type=int, default=1000, help="textures of each source")
    parser.add_argument(
        "--flip-every", type=int, default=1, help="measure FLIP, which takes longest, of every so many textures"
    )
    parser.add_argument("--clusters", type=int, default=4)
    parser.add_argument("--groupings", nargs="*", default=GROUPINGS, help="none: ASTC alone, to be kept for later runs")
    parser.add_argument("--cache", type=Path, default=blocks_cache(), help="folder that keeps ASTC's figures")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(arguments)
    settings = {"texture_size": options.texture_size, "clusters": options.clusters, "flip_every": options.flip_every}
    try:
        compared: list[Comparison] = []
        for source in options.sources:
            textures = read_textures(source, options.texture_size, options.most)
            compared.append(
                compare(source.stem, textures, options.clusters, options.groupings, options.cache, options.flip_every)
            )
            if options.json:
                _write(options.json, settings, compared)
    except InputError as error:
        sys.stderr.write(f"error: {error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
