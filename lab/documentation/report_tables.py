"""Tables of docs/reports, from the committed records of lab/benchmarks/results. The pages around them are written by hand."""

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from viewer.cli.table import Column, Table

RESULTS = Path(__file__).resolve().parents[1] / "benchmarks" / "results"
Row = Mapping[str, Any]


def record(name: str) -> Any:
    """The JSON of a committed record, by its path below lab/benchmarks/results without suffix."""
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))


def table(rows: Iterable[Row], *columns: str) -> str:
    """Markdown of `rows` under `columns`, each "key", "key=heading" or "key=heading=digits after the point"."""
    parts = [[*column.split("="), "", ""] for column in columns]
    made = [Column(key, heading or key.replace("_", " "), int(digits or 2)) for key, heading, digits, *_ in parts]
    return Table(made, list(rows)).markdown()


def rows_of(name: str, *columns: str, **equal: Any) -> str:
    """The table of a record's rows, those alone whose fields are one of `equal`."""
    rows = record(name)["rows"]
    return table([row for row in rows if all(row.get(key) in allowed for key, allowed in equal.items())], *columns)


MIP_GAINS = ("mip_1_db", "mip_2_db", "mip_3_db")
"""Fields of what codec block gains at coarse mips."""


def beside_astc() -> str:
    """Codec block less ASTC at equal bits, on three sets of textures."""
    rows = []
    for own in record("studies/block_against_astc")["sets"]:
        astc = {point["setting"]: point for point in own["points"] if point["curve"] == "ASTC"}
        rows += [
            {
                "textures": f"{own['source']}, {own['textures']}",
                "grouping": f"`{row['grouping']}`",
                "bits": astc[row["format"]]["bits_per_texel"],
                "astc": astc[row["format"]]["mean_db"],
                "block": astc[row["format"]]["mean_db"] + row["mean_db"],
                **{key: row[key] for key in ("mean_db", *MIP_GAINS, "ssim", "flip", "largest_loss_db")},
                "worse": row["worse_by_over_1_db"],
            }
            for row in own["differences"]
        ]
    return table(
        rows,
        "textures",
        "grouping",
        "bits=bits per texel",
        "astc=ASTC, dB",
        "block=`block`, dB",
        "mean_db=gain, dB",
        *(f"{key}=at mip {mip}" for mip, key in enumerate(MIP_GAINS, 1)),
        "ssim=SSIM change=4",
        "flip=FLIP change=4",
        "largest_loss_db=largest loss, dB=1",
        "worse=worse by over 1 dB",
    )


def textures_below_astc() -> str:
    """Textures that lose over 1 dB at mip 0 beside ASTC."""
    rows = [
        {"set": own["source"], **{key: f"`{row[key]}`" for key in ("texture", "grouping", "format")}, **_losses(row)}
        for own in record("studies/block_against_astc")["sets"]
        for row in own["worse_by_over_1_db"]
    ]
    return table(rows, "set", "texture", "grouping", "format=compared with", "astc=ASTC, dB=1", "loss=loss, dB=1")


def _losses(row: Row) -> Row:
    return {"astc": row["astc_db"], "loss": row["loss_db"]}


def sizes_of_files() -> str:
    """Bits of files with all mips, by the mean PSNR that they reach."""
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


def neural_codec() -> str:
    """Codec block beside a neural codec that was trained to convergence."""
    rows = [
        {
            "material": row["material"],
            "texels": row["texels"],
            "steps": row["steps"],
            "minutes": row["neural"]["processor_minutes"],
            "codes": row["code_bits_per_texel"],
            "neural": row["neural"]["psnr_db"],
            "block": row["block"]["psnr_db"],
            "four": row["block_of_four_mips"]["psnr_db"],
            "whole": row["neural"]["bits_per_texel"],
            "equal": row["block_of_equal_bytes"]["psnr_db"],
            "seconds": row["block"]["seconds"],
        }
        for row in record("neural_codec")["rows"]
    ]
    return table(
        rows,
        "material",
        "texels=texels a side",
        "codes=bits per texel of grids or codes",
        "neural=neural codec, mip 0 alone, dB",
        "block=`block`, all mips, dB",
        "four=`block`, four mips a code, dB",
        "whole=bits per texel with the network",
        "equal=`block` with tables in these bits, dB",
        "steps",
        "minutes=processor minutes of training=1",
        "seconds=processor seconds of `block`=1",
    )


def unseen_textures() -> str:
    """Grouping universal on textures that its tables were not fitted to, beside ASTC."""
    rows = []
    for row in record("studies/universal_unseen")["rows"]:
        astc = next(value for key, value in row.items() if key.startswith("astc"))
        rows.append(row | {"astc": astc["mean_db"], "own": row["universal"]["mean_db"]})
    return table(
        rows,
        "bits_per_texel=bits per texel",
        "unseen=textures",
        "fitted_to=fitted to",
        "astc=ASTC, dB",
        "own=`universal`, dB",
        "worse_by_over_1_db=textures worse by over 1 dB",
    )


def unseen_materials() -> str:
    """Grouping universal on whole materials that its tables were not fitted to, beside tables of their own."""
    rows = []
    for row in record("studies/universal_sets_unseen")["rows"]:
        own, shipped = row["clustered"], row["universal"]
        angles = [each["normal_degrees"] for each in (own, shipped)]
        rows.append(
            row
            | {
                "pack": "single" if row["a_pack_each"] else "scene",
                "own": own["mean_db"],
                "shipped": shipped["mean_db"],
            }
            | {"angles": " / ".join("-" if angle is None else f"{angle:.2f}" for angle in angles)}
            | {"kilobytes": f"{own['file_bytes'] / 1000:.0f} / {shipped['file_bytes'] / 1000:.0f}"}
        )
    return table(
        rows,
        "materials_of=materials of",
        "pack=packs",
        "materials=materials",
        "size=texels a side=0",
        "bits_per_texel=bits per texel=0",
        "own=`clustered`, dB",
        "shipped=`universal`, dB",
        "gain_db=gain, dB",
        "least_gain_db=least gain, dB",
        "angles=normals, degrees",
        "kilobytes=files, kB",
    )


def lit_pictures() -> str:
    """Lit pictures of whole materials beside ASTC and BC7 with BC5."""
    return rows_of(
        "studies/lit_pictures",
        "scene",
        "format=compared with",
        "bits_per_texel=bits per texel, all maps",
        "hardware_db=its PSNR, dB",
        "block_db=`block`, dB",
        "more_db=gain, dB",
        "hardware_flip=its FLIP=4",
        "block_flip=FLIP of `block`=4",
    )


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


def clusters(scene: str) -> str:
    """Groupings of a scene in 10 groups (jungle: 5), with what they cut on seen and on held-out views."""
    rows = record(f"studies/clusters_{scene}_llvmpipe")["rows"]
    groups = 5 if scene == "jungle" else 10
    kept = [row for row in rows if row["groups"] == groups or row["grouping"] == "category"]
    return table(
        kept,
        "grouping",
        "features",
        "largest_group=largest group",
        "seen_cut_percent=cut on seen views, %=1",
        "held_out_cut_percent=cut on held-out views, %=1",
        "spread_percent=spread, %=1",
    )


def filtering() -> str:
    """Means of the study of filtering: magnified, minified, straight on, tilted, moving, and flicker."""
    rows = record("studies/study_courtyard_filtering")["rows"]
    ways = dict.fromkeys(row["way"] for row in rows)

    def mean(way: str, sweep: str, key: str, wanted: Callable[[float], bool]) -> float:
        own = [row[key] for row in rows if row["way"] == way and row["sweep"] == sweep and wanted(row["value"])]
        own = [value for value in own if value is not None]
        return float(sum(own) / len(own))

    return table(
        [
            {
                "way": way,
                "magnified": mean(way, "shrinking", "psnr_db", lambda value: value < 1),
                "minified": mean(way, "shrinking", "psnr_db", lambda value: value > 1),
                "straight": mean(way, "tilting", "psnr_db", lambda value: value == 0),
                "tilted": mean(way, "tilting", "psnr_db", lambda value: value == 82),
                "moving": mean(way, "moving", "psnr_db", math.isfinite),
                "flicker": mean(way, "moving", "flicker", math.isfinite),
            }
            for way in ways
        ],
        "way",
        "magnified=magnified, dB=1",
        "minified=minified, dB=1",
        "straight=straight on, dB=1",
        "tilted=82 degrees, dB=1",
        "moving=moving, dB=1",
        "flicker=flicker, 8-bit steps=1",
    )


def stability() -> str:
    """Largest errors against float64 by path, a column for each precision."""
    rows: dict[str, dict[str, Any]] = {}
    for row in record("studies/stability_llvmpipe")["worst"]:
        rows.setdefault(row["path"], {"path": row["path"], "nan": 0})[row["precision"]] = row["largest"]
        rows[row["path"]]["nan"] += row["not_finite"]
    precisions = ("fp32", "fp16", "fp16-arithmetic", "fp16-accumulate")
    return table(rows.values(), "path", *precisions, "nan=NaN, infinity")


def trained_packs(name: str) -> str:
    """What trained packs lose in each precision."""
    kept = [row | {"error": f"{row['largest_error']:.1e}"} for row in record(f"studies/{name}")["trained"]]
    return table(kept, "pack", "precision", "error=largest error", "largest_loss_db=largest loss of a texture, dB=4")


def scene_bench(scene: str) -> str:
    """Every pack, path and precision of a scene: time and error."""
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
    """All decoders in every block, 512x512."""
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
    """Registers, spills and instructions of compiled decoding programs of codec grid, recipe best, and of codec block."""
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
    """Vector instructions of codec block: machine code times the trip counts of packs, with estimated times."""
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


def compiling() -> str:
    """Processor time of compiling the programs of the first picture."""
    rows = [
        {"scene": found["scene"], **row}
        for found in (record(f"first_picture_{name}_llvmpipe") for name in ("courtyard", "ship"))
        for row in found["rows"]
    ]
    return table(
        rows,
        "scene",
        "path",
        "decode ms=decoding, ms=0",
        "visibility=visibility, ms=0",
        "latents=latents, ms=0",
        "reference=originals, ms=0",
        "shade=shading, ms=0",
        "shadow=shadow, ms=0",
        "composite=composite, ms=0",
        "all ms=all, ms=0",
    )


def coarse_mips() -> str:
    """Coefficients of a code that its coarse mips need, by pack."""
    return table(
        record("coarse_mips")["rows"],
        "pack",
        "mip of the code",
        "coefficients=coefficients of a code=1",
        "needed=needed, certified=1",
        "needed on average=needed on average=1",
    )


def fuzzing() -> str:
    """Files that the readers were fuzzed with, sums by reader."""
    sums: dict[str, dict[str, Any]] = {}
    for run in record("fuzz_readers")["readers"]:
        own = sums.setdefault(run["reader"], {"reader": run["reader"], "files": 0, "seconds": 0.0, "found": 0, "mb": 0})
        own["files"] += run["executions"]
        own["seconds"] += run["seconds"]
        own["found"] += len(run["findings"])
        own["mb"] = max(own["mb"], run["peak_rss_mb"])
    return table(sums.values(), "reader", "files", "seconds=seconds=0", "found=findings", "mb=peak memory, MB")


def window_training() -> str:
    """Frame times of a window that trains."""
    kept = ("without training", "encoding", "retraining")
    return rows_of(
        "window_training_bistro_llvmpipe",
        "phase",
        "frames",
        "p50 ms=median, ms=1",
        "p99 ms=99th percentile, ms=1",
        "longest ms=longest, ms=0",
        "over 50 ms",
        "over 100 ms",
        phase=kept,
    )


def first_pictures() -> str:
    """Seconds until a window shows the first decoded picture of a scene without a pack."""
    rows = [
        row | {"accepted": "after 10 s" if row["looked for"] > 1 else "at once"}
        for row in record("window_first_picture_bistro_llvmpipe")["first_pictures"]
    ]
    return table(rows, "window", "accepted", "prepared", "first picture", "its tiles=all its tiles", "whole pack")


def time_left(clock: str) -> str:
    """Seconds that encodings were forecast to take, and seconds left that were shown, both with the truth."""
    moments, rows = ("25%", "50%", "75%"), []
    for row in record("time_left")["rows"]:
        if row["clock"] == clock:
            said = {at: "-" if row[f"said_{at}"] is None else f"{row[f'said_{at}']:.1f}" for at in moments}
            rows.append(row | {at: f"{said[at]} of {row[f'left_{at}']:.1f}" for at in moments})
    headings = [f"{at}=left at {at[:-1]} %, s" for at in moments]
    return table(rows, "scene", "what=", "offered_seconds=offered, s=1", "seconds=took, s=1", *headings)


PARTS_OF_ENCODING = {
    "tables, %": ("basis", "classes", "modes", "fitting"),
    "edge parts, %": ("edge modes",),
    "sampling, sharing, %": ("sampling", "curves", "sharing"),
    "choices, %": ("choices",),
    "codes, %": ("codes", "kinds"),
    "measure, %": ("measuring", "texture"),
}
"""Parts of encodings by the column that counts their processor time."""


def encoding_work() -> str:
    """Processor time of encodings, and how much of it each part takes."""
    rows = []
    for row in record("encoding_work")["rows"]:
        seconds = {name: part["seconds"] for name, part in row["parts"].items()}
        again = sum(own for name, own in seconds.items() if name.startswith("again: "))
        shares = {title: sum(seconds.get(name, 0.0) for name in names) for title, names in PARTS_OF_ENCODING.items()}
        rows.append(
            row | {title: 100.0 * own / row["seconds"] for title, own in (shares | {"again, %": again}).items()}
        )
    columns = [f"{title}={title}=0" for title in (*PARTS_OF_ENCODING, "again, %")]
    return table(rows, "scene", "textures", "groups", "seconds=s=1", *columns)


def encoding_by_jobs() -> str:
    """One worker, two workers and a Ray cluster."""
    found = record("encoding_by_jobs")
    names = {
        "one_worker": "one worker",
        "two_workers": "two workers",
        "ray_two_machines": "Ray, two machines of one core",
    }
    return table(
        [
            found[key] | {"what": name, "up": found["one_worker"]["seconds"] / found[key]["seconds"]}
            for key, name in names.items()
        ],
        "what=",
        "seconds=seconds=1",
        "up=speed-up",
        "peak_mb=peak memory, MB=0",
    )


def tiny_textures() -> str:
    """Memory of the process that hands out jobs, over the number of textures."""
    found = record("encoding_by_jobs")["tiny_textures"]
    return table(
        [row | {"textures": int(count)} for count, row in found.items()],
        "textures",
        "peak_mb=peak memory, MB=0",
        "cpu_seconds=processor seconds=0",
    )


TEXTURE_STUDIES: Sequence[tuple[str, str]] = (
    ("recipes-bistro", "study_bistro_paper_scenes"),
    ("recipes-polyhaven", "study_polyhaven_paper_textures"),
    ("recipes-large", "study_large_paper_textures"),
)
REPORT_PARTS: Mapping[str, Callable[[], str]] = {
    "astc": beside_astc,
    "below-astc": textures_below_astc,
    "disk": sizes_of_files,
    "neural": neural_codec,
    "unseen": unseen_textures,
    "unseen-sets": unseen_materials,
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
    "materials": partial(
        rows_of,
        "studies/study_props_materials",
        "curve=encoding",
        "setting",
        "bits_per_texel=bits per texel, all maps",
        "mean_db=PSNR, all channels, dB",
        "base_db=base, dB",
        "normal_db=normal, dB",
        "linear_db=roughness, metalness, occlusion, dB",
        "degrees=angle of normals, degrees",
    ),
    "lit": lit_pictures,
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
    "ablation": partial(
        rows_of,
        "studies/study_bistro_ablation",
        "variant",
        "mean_db=mean, dB",
        "mean_gain_db=change, dB",
        "mse_gain_db=change of mean MSE, dB",
        "bits_per_texel=bits per texel",
        "multiply_adds=multiply-adds",
    ),
    "freezing": partial(
        rows_of, "studies/study_bistro_freezing", "variant", "mean_db=mean, dB", "of_mean_mse_db=of mean MSE, dB"
    ),
    "width": partial(
        rows_of,
        "studies/study_bistro_mlp_size",
        "variant",
        "grouping",
        "mean_db=mean, dB",
        "bits_per_texel=bits per texel",
        "multiply_adds=multiply-adds",
    ),
    "block-settings": partial(
        rows_of,
        "studies/study_polyhaven_ablation_block",
        "variant",
        "mean_db=mean, dB",
        "of_mean_mse_db=of mean MSE, dB",
        "minimum_db=worst, dB",
        "bits_per_texel=bits per texel",
        "multiply_adds=multiply-adds",
    ),
    **{f"clusters-{scene}": partial(clusters, scene) for scene in ("bistro", "courtyard", "jungle")},
    "filtering": filtering,
    "stability": stability,
    "stability-trained": partial(trained_packs, "stability_llvmpipe"),
    "stability-block": partial(trained_packs, "stability_block_llvmpipe"),
    "bench-bistro": partial(scene_bench, "bistro"),
    "worst-case": worst_case,
    "turns": partial(
        rows_of,
        "decode_in_turns_bistro_llvmpipe",
        "way=path",
        "pack=codec",
        "processor ms=processor time, ms=0",
        "microseconds each=µs per pixel or tile",
    ),
    "motion": partial(
        rows_of,
        "cached_motion_bistro_llvmpipe",
        "camera",
        "motion",
        "deferred ms=deferred, ms=0",
        "cached, from nothing ms=cached, empty, ms=0",
        "cached, still ms=cached, still, ms=0",
        "cached, moving ms=cached, moving, ms=0",
        "% of deferred=% of deferred=1",
        "tiles a frame=tiles per frame",
    ),
    "on-load-blocks": partial(
        rows_of,
        "on_load_llvmpipe",
        "texture",
        "map",
        "format",
        "shader dB=shader, dB=2",
        "offline dB=offline, dB=2",
        "difference dB=difference, dB=2",
        "shader Mtexel/s=shader, Mtexel/s=1",
        "offline Mtexel/s=offline, Mtexel/s=1",
    ),
    "shaders": shader_statistics,
    "block-counts": block_counts,
    "coarse-mips": coarse_mips,
    "compiling": compiling,
    "window-training": window_training,
    "first-pictures": first_pictures,
    "encoding-work": encoding_work,
    "time-left": partial(time_left, "wall"),
    "time-left-alone": partial(time_left, "processor"),
    "jobs": encoding_by_jobs,
    "measures": partial(
        rows_of,
        "measures_agree",
        "measure",
        "all pictures=all pictures=2",
        "textures at one rate=textures at one rate=2",
        "rates of one texture=rates of one texture=2",
    ),
    "tiny": tiny_textures,
    "fuzzing": fuzzing,
    "conformance": partial(
        rows_of, "conformance_llvmpipe", "file", "result", "triangles", "textures", "seconds=load and draw, s=1"
    ),
}
"""Tables by the name in the marks of a page."""
