"""Tables of docs/reports, made from the committed records of lab/benchmarks/results."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from viewer.scene.text_table import Column, Table

RESULTS = Path(__file__).resolve().parents[1] / "benchmarks" / "results"
Row = Mapping[str, Any]


def record(name: str) -> Any:
    """Return the JSON of a committed record; `name` is its path below lab/benchmarks/results without suffix."""
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))


def table(rows: Iterable[Row], *columns: str) -> str:
    """Return `rows` as a Markdown table. Each column is "key", "key=heading" or "key=heading=digits after the point"."""
    parts = [[*column.split("="), "", ""] for column in columns]
    made = [Column(key, heading or key.replace("_", " "), int(digits or 2)) for key, heading, digits, *_ in parts]
    return Table(made, list(rows)).markdown()


def rows_of(name: str, *columns: str, **equal: Any) -> str:
    """Return the table of the rows of a record whose fields have one of the values of `equal`."""
    rows = record(name)["rows"]
    return table([row for row in rows if all(row.get(key) in allowed for key, allowed in equal.items())], *columns)


def sizes_of_files() -> str:
    """Return the table of bits of files with all mips, by mean PSNR."""
    rows = [
        {"set": name, "wanted": row["mean_db"], **{key: row.get(curve) for key, curve in DISK_CURVES.items()}}
        for name in DISK_SETS
        for row in record(f"studies/study_{name}_rate")["disk"]
    ]
    return table(rows, "set", "wanted=mean, dB=0", *(f"{key}={title}" for key, title in DISK_TITLES.items()))


DISK_SETS = ("polyhaven", "bistro", "large")
"""Sets of textures whose files were compared."""
DISK_CURVES = {
    "block": "block 8x8, single",
    "jpeg": "JPEG 4:2:0",
    "etc1s": "ETC1S",
    "xuastc": "XUASTC",
    "jxl": "JPEG XL",
}
"""Curves of study rate by their key in the table of files."""
DISK_TITLES = {"block": "`block`", "jpeg": "JPEG 4:2:0", "etc1s": "ETC1S", "xuastc": "XUASTC 6x6", "jxl": "JPEG XL"}


QUALITY = (
    "variant=recipe",
    "grouping",
    "groups=decoders",
    "mean_db=mean, dB",
    "of_mean_mse_db=of mean MSE, dB",
    "worst_share_db=worst 5 %, dB",
    "ssim=SSIM=3",
    "flip=FLIP=4",
    "bits_per_texel=bits per texel",
)
"""Columns of the studies of recipes."""


def stability() -> str:
    """Return the table of the largest errors against float64, by path and precision."""
    rows: dict[str, dict[str, Any]] = {}
    for row in record("studies/stability_llvmpipe")["worst"]:
        rows.setdefault(row["path"], {"path": row["path"], "nan": 0})[row["precision"]] = row["largest"]
        rows[row["path"]]["nan"] += row["not_finite"]
    precisions = ("fp32", "fp16", "fp16-arithmetic", "fp16-accumulate")
    return table(rows.values(), "path", *precisions, "nan=NaN, infinity")


def trained_packs(name: str) -> str:
    """Return the table of losses of trained packs by precision."""
    rows = [row | {"error": f"{row['largest_error']:.1e}"} for row in record(f"studies/{name}")["trained"]]
    return table(rows, "pack", "precision", "error=largest error", "largest_loss_db=largest loss of a texture, dB=4")


def scene_bench(scene: str) -> str:
    """Return the table of time and error of every pack, path and precision in a scene."""
    rows = [
        row | {"path": row["path"] or "-", "precision": row["precision"] or "-"}
        for row in record(f"bench/bench_{scene}_llvmpipe")["scene"]["table"]
    ]
    return table(
        rows,
        "source=pack",
        "path",
        "precision",
        "decode_ms=decode, ms=0",
        "frame_ms=frame, ms=0",
        "to_deferred=of deferred fp32",
        "psnr_db=PSNR, dB",
        "float64_millionths=largest error, millionths=1",
    )


def worst_case() -> str:
    """Return the table of the worst case, with all decoders in every block, at 512x512."""
    rows = [row for row in record("bench/worst_case_llvmpipe")["worst_case"]["rows"] if row["width"] == 512]
    return table(
        rows,
        "decoders=decoders in a block",
        "path",
        "precision",
        "median_ms=ms=0",
        "to_shared=of the shared decoder",
        "gigaflops=GFLOP/s=1",
    )


def shader_statistics() -> str:
    """Return the table of registers, spills and instructions of compiled decoding programs of codec grid (best) and codec block."""
    rows = [
        row
        for row in record("shaders/after")["rows"]
        if row["codec"] in {"grid of best", "block"} and row["path"] in {"deferred", "deferred, shared", "cached"}
    ]
    return table(
        rows,
        "gpu=GPU",
        "codec",
        "path",
        "precision",
        "registers",
        "spills",
        "waves",
        "vector instructions a texel=vector instructions per texel",
    )


def block_counts() -> str:
    """Return the table of vector instructions of codec block: machine code times trip counts of packs, with estimated times."""
    decoded = ("by each pixel", "by work groups")
    rows = [{**row, "decoded": decoded[row["together"]]} for row in record("shaders/block")["rows"]]
    return table(
        rows,
        "gpu=GPU",
        "pack",
        "path",
        "lod=lod=1",
        "decoded",
        "base",
        "all planes",
        "floor ms, 1080p=estimated floor at 1080p, ms=1",
        "floor ms, 4K=at 4K, ms=1",
    )


def fuzzing() -> str:
    """Return the table of fuzzed files, summed by reader."""
    sums: dict[str, dict[str, Any]] = {}
    for run in record("fuzz_readers")["readers"]:
        total = sums.setdefault(
            run["reader"], {"reader": run["reader"], "files": 0, "seconds": 0.0, "found": 0, "mb": 0}
        )
        total["files"] += run["executions"]
        total["seconds"] += run["seconds"]
        total["found"] += len(run["findings"])
        total["mb"] = max(total["mb"], run["peak_rss_mb"])
    return table(sums.values(), "reader", "files", "seconds=seconds=0", "found=findings", "mb=peak memory, MB")


TEXTURE_STUDIES: Sequence[tuple[str, str]] = (
    ("recipes-bistro", "study_bistro_paper_scenes"),
    ("recipes-polyhaven", "study_polyhaven_paper_textures"),
    ("recipes-large", "study_large_paper_textures"),
)
REPORT_PARTS: Mapping[str, Callable[[], str]] = {
    "disk": sizes_of_files,
    "rate": partial(
        rows_of,
        "studies/study_polyhaven_rate",
        "curve=format",
        "setting",
        "bits_per_texel=bits per texel",
        "mean_db=mean, dB=1",
        "of_mean_mse_db=of mean MSE, dB=1",
        "ssim=SSIM=3",
        "flip=FLIP=3",
        "ssimulacra2=SSIMULACRA2=1",
    ),
    **{name: partial(rows_of, f"studies/{file}", *QUALITY) for name, file in TEXTURE_STUDIES},
    "recipes-rendered": partial(
        rows_of,
        "studies/study_bistro_paper_scenes_rendered",
        "recipe",
        "grouping",
        "decoders",
        "rendered_db=rendered, dB",
        "worst_db=worst view, dB",
        "excess",
        "cut_percent=cut, %=1",
    ),
    "stability": stability,
    "stability-trained": partial(trained_packs, "stability_llvmpipe"),
    "stability-block": partial(trained_packs, "stability_block_llvmpipe"),
    "bench-bistro": partial(scene_bench, "bistro"),
    "worst-case": worst_case,
    "shaders": shader_statistics,
    "block-counts": block_counts,
    "fuzzing": fuzzing,
}
"""Tables by the name in the marks of a page."""
