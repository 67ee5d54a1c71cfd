"""Counted instructions for estimates of times on a GPU, from records of compiled shaders: a file of the viewer, and tables of docs.

Those of codec `block` are fits: once for a pixel, for each plane, and for each coefficient of a code, all planes together.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from scipy.optimize import nnls

from lab.benchmarks.shaders.decoding_programs import CODECS
from lab.documentation.report_tables import Row, record, table
from ntc.codec.grid.model import GridConfig
from ntc.codec.registry import codec_of
from viewer.inspect.gpu_estimate import ESTIMATED_GPU, INSTRUCTIONS_FILE, PAGE_TEXELS, PIXELS, milliseconds_of

GPU: Final = "navi32"
LOD: Final = 0.5
"""Lod of the pixels that are counted: they read two mips."""
BLOCK_ROWS: Final[Mapping[str, tuple[str, int, float]]] = {
    "deferred": ("deferred", 1, LOD),
    "deferred, stochastic": ("deferred, stochastic", 1, LOD),
    "forward": ("deferred", 0, LOD),
    "forward, stochastic": ("deferred, stochastic", 0, LOD),
    "binned": ("deferred", 0, LOD),
    "binned, stochastic": ("deferred, stochastic", 0, LOD),
    "cached": ("cached, a texel of a tile", 1, 0.0),
}
"""Path, `together` and lod of the rows that each path is estimated from. By `forward` and `binned` each pixel decodes for itself."""
MOVING: Final = ("cached_motion_courtyard_llvmpipe", "cached_motion_courtyard_4k_llvmpipe")
"""Records of a moving camera for each of PIXELS: whole materials of codec `block`."""
MOTIONS: Final = (*MOVING, "cached_motion_bistro_1080p_llvmpipe")
"""All records of moving cameras whose packs have codec `block`."""
TERMS: Final = ("once", "plane", "coefficient")


def _block_rows(path: str) -> Iterator[Row]:
    """Rows of the record for a path, one for each pack."""
    for row in record("shaders/block")["rows"]:
        if (row["gpu"], row["path"], row["together"], row["lod"]) == (GPU, *BLOCK_ROWS[path]):
            yield row


def _block_points(path: str) -> Iterator[tuple[tuple[float, float, float], float]]:
    """(1, planes, coefficients) and instructions of what was counted for a path: base alone, and all planes."""
    for row in _block_rows(path):
        if "coefficients" not in row:
            raise KeyError(
                "shaders/block.json has no coefficients: count again with lab.benchmarks.shaders.block_counts"
            )
        yield (1.0, 1.0, row["base coefficients"]), row["base"]
        if row["planes"] > 1:
            yield (1.0, row["planes"], row["coefficients"]), row["all planes"]


def block_fit(path: str) -> tuple[dict[str, float], float]:
    """Instructions of a path by TERMS, and the largest share by which they are off the counts.

    Least squares of these shares; no term is below 0.
    """
    terms, counts = (np.array(part, np.float64) for part in zip(*_block_points(path), strict=True))
    fit, _ = nnls(terms / counts[:, None], np.ones(len(counts)))
    rounded = [round(float(value), 1) for value in fit]
    return dict(zip(TERMS, rounded, strict=True)), float(np.abs(terms @ rounded / counts - 1.0).max())


def _shapes() -> dict[str, str]:
    """Shape of the decoder of each codec `grid` that is counted."""
    return {
        name: codec_of(config).gpu_tables(config).shape_text()
        for name, config in CODECS.items()
        if isinstance(config, GridConfig)
    }


def grid_instructions() -> dict[str, dict[str, dict[str, int]]]:
    """Instructions of codec `grid` by shape of the decoder, path and precision."""
    shapes = _shapes()
    found: dict[str, dict[str, dict[str, int]]] = {}
    for row in record("shaders/after")["rows"]:
        if row["gpu"] == GPU and row["codec"] in shapes:
            own = found.setdefault(shapes[row["codec"]], {}).setdefault(row["path"], {})
            own[row["precision"]] = row["vector instructions a texel"]
    return found


def gpu_instructions() -> str:
    """Content of `viewer.inspect.gpu_estimate.INSTRUCTIONS_FILE`."""
    content = {"block": {path: block_fit(path)[0] for path in BLOCK_ROWS}, "grid": grid_instructions()}
    return json.dumps(content, indent=1) + "\n"


GENERATED: Final[Mapping[Path, Callable[[], str]]] = {INSTRUCTIONS_FILE: gpu_instructions}
"""Files of the program that are made from records."""


COUNTED_PACK: Final = "courtyard"
"""Pack of codec `block` whose estimates docs show."""
COUNTED_GRID: Final = "grid of best"
"""Codec whose estimates docs show beside it, with one decoder."""


def _times(instructions: float | None) -> str:
    """Estimated ms at each size, or `-`."""
    if instructions is None:
        return "-"
    return ", ".join(f"{milliseconds_of(instructions * pixels):.1f}" for pixels in PIXELS.values())


def estimates(*paths: str, moving: bool = False) -> str:
    """Estimated ms at each size by path: codec `block` with whole materials, and codec `grid` with base colours.

    `moving`: the most that tiles of a frame take while a camera moves, too.
    """
    grid = grid_instructions()[_shapes()[COUNTED_GRID]]
    rows = []
    for path in paths:
        (block,) = (row["all planes"] for row in _block_rows(path) if row["pack"] == COUNTED_PACK)
        own = grid.get("deferred, shared" if path == "deferred" else path)
        rows.append({"path": f"`{path}`", "block": _times(block), "grid": _times(own["fp32"] if own else None)})
    if moving:
        times = [max(row["most tiles"] for row in own["rows"]) * _tile_ms(own) for own in map(record, MOVING)]
        texts = [f"{own:.2f}" if own >= 0.01 else "under 0.01" for own in times]
        rows.append({"path": "`cached`, moving", "block": ", ".join(texts), "grid": "-"})
    sizes = ", ".join(PIXELS)
    heading = f"**estimated** ms, {ESTIMATED_GPU}, {sizes}"
    return table(rows, f"path={heading}", "block=`block`, materials", "grid=`grid`, colours")


def _tile_ms(motion: Row) -> float:
    """Estimated ms of a tile of the pack of a record of `lab.benchmarks.cached_motion`, by today's counts."""
    fit, _ = block_fit("cached")
    terms = (1.0, motion["planes"], motion["coefficients"])
    own = sum(value * fit[name] for name, value in zip(TERMS, terms, strict=True))
    return milliseconds_of(own * PAGE_TEXELS) / float(motion["planes"])


def tiles_of_motions() -> str:
    """Tiles that frames of a moving camera decode, and their estimated times."""
    rows = []
    for name in MOTIONS:
        motion = record(name)
        tile_us = 1e3 * _tile_ms(motion)
        rows += [
            {
                **{key: row[key] for key in ("camera", "motion")},
                "scene": f"{motion['scene']}, {motion['size'][0]}x{motion['size'][1]}",
                "tiles": float(row["tiles a frame"]),
                "most": float(row["most tiles"]),
                "texels": float(row["tiles a frame"] * PAGE_TEXELS),
                "us": row["tiles a frame"] * tile_us,
                "most us": row["most tiles"] * tile_us,
            }
            for row in motion["rows"]
        ]
    return table(
        rows,
        "scene",
        "camera",
        "motion",
        "tiles=tiles per frame=0",
        "most=at most=0",
        "texels=texels per frame=0",
        "us=**estimated** µs=1",
        "most us=at most, µs=1",
    )


def fit_table() -> str:
    """The fits of codec `block`, and how far they are off."""
    rows = []
    for path in BLOCK_ROWS:
        fit, off = block_fit(path)
        rows.append({"path": f"`{path}`", **fit, "off": 100.0 * off})
    return table(
        rows,
        "path",
        "once=once=0",
        "plane=for each plane=0",
        "coefficient=for each coefficient=1",
        "off=most off the counts, %=0",
    )


ESTIMATE_PARTS: Final[Mapping[str, Callable[[], str]]] = {
    "estimate-fits": fit_table,
    "tiles-of-motions": tiles_of_motions,
    "estimates": partial(estimates, *(path for path in BLOCK_ROWS if path != "cached")),
    "estimates-in-short": partial(estimates, "deferred", "deferred, stochastic", moving=True),
}
"""Tables by the name in the marks of a page."""
