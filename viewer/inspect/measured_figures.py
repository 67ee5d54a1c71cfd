"""Figures of slots A and B side by side: as rows of a table, as Markdown and as JSON."""

import json
from collections.abc import Callable, Mapping

from ntc.codec.quality import finite_or_none
from viewer.state.session import SlotMeasurement
from viewer.state.view_state import Side

DASH = "-"
SIDES: tuple[Side, ...] = ("a", "b")


def figure_rows(measured: Mapping[Side, SlotMeasurement]) -> dict[str, tuple[str, str]]:
    """Return (A, B) by the name of the figure; a dash where a figure does not exist."""
    found = [measured.get(side) for side in SIDES]

    def row(text: Callable[[SlotMeasurement], str | None]) -> tuple[str, str]:
        first, second = (DASH if each is None else text(each) or DASH for each in found)
        return first, second

    rows = {
        "shows": row(lambda own: own.source),
        "PSNR seen dB": row(lambda own: _number(own.psnr_db, 2)),
        "bits per texel": row(lambda own: _number(own.bits, 2)),
        "file MB": row(lambda own: _number(own.file_bytes, 2, 1e6)),
        "GPU MB": row(lambda own: _number(own.gpu_bytes, 2, 1e6)),
        "decode ms": row(lambda own: _number(own.draw_ms, 2)),
        "path": row(lambda own: own.path),
        "divergence score": row(lambda own: f"{own.divergence.score:.4f}" if own.divergence else None),
        "excess": row(lambda own: str(own.divergence.excess) if own.divergence else None),
    }
    further = {
        "compression dB": row(lambda own: _number(own.compression_db, 2)),
        "load Mtexel/s": row(lambda own: _number(own.load_rate, 1, 1e6)),
    }
    rows |= {name: both for name, both in further.items() if both != (DASH, DASH)}
    by_map = [each.psnr_by_map if each is not None else {} for each in found]
    for name in dict.fromkeys(name for maps in by_map for name in maps):
        a, b = (_decibels(maps[name]) if name in maps else DASH for maps in by_map)
        rows[f"{name} alone dB"] = (a, b)
    return rows


def _number(value: float | None, digits: int, unit: float = 1.0) -> str | None:
    if value is None:
        return None
    return f"{value / unit:.{digits}f}" if abs(value) < float("inf") else "equal"


def _decibels(value: float | None) -> str:
    return _number(value, 2) or "equal"


def figures_markdown(measured: Mapping[Side, SlotMeasurement]) -> str:
    """Return the rows as a table in Markdown."""
    lines = ["| figure | A | B |", "|---|--:|--:|"]
    return "\n".join([*lines, *(f"| {name} | {a} | {b} |" for name, (a, b) in figure_rows(measured).items())]) + "\n"


def figures_json(measured: Mapping[Side, SlotMeasurement]) -> str:
    """Return the figures as JSON: numbers without rounding, null where a figure does not exist or pictures are equal."""
    found = {
        side: {
            "source": own.source,
            "psnr_db": _finite(own.psnr_db),
            "bits_per_texel": own.bits,
            "file_bytes": own.file_bytes,
            "gpu_bytes": own.gpu_bytes,
            "decode_ms": own.draw_ms,
            "path": own.path or None,
            "compression_psnr_db": None if own.compression_db is None else _finite(own.compression_db),
            "load_texels_per_second": own.load_rate,
            "divergence_score": own.divergence.score if own.divergence else None,
            "excess": own.divergence.excess if own.divergence else None,
            "psnr_db_by_map": {name: _finite(value) for name, value in own.psnr_by_map.items()},
        }
        for side, own in measured.items()
    }
    return json.dumps(found, indent=2) + "\n"


def _finite(value: float | None) -> float | None:
    return None if value is None else finite_or_none(float(value))
