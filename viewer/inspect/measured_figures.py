"""Figures of slots A and B side by side: as rows of a table, as Markdown and as JSON."""

import json
from collections.abc import Callable, Mapping

from ntc.codec.quality import finite_or_none
from viewer.state.session import SlotMeasurement
from viewer.state.view_state import Side

DASH = "-"
SIDES: tuple[Side, ...] = ("a", "b")


def figure_rows(measured: Mapping[Side, SlotMeasurement]) -> dict[str, tuple[str, str]]:
    """Return the texts (A, B) by name of the figure; a dash where a slot has no such figure."""
    measurements = [measured.get(side) for side in SIDES]

    def row(text: Callable[[SlotMeasurement], str | None]) -> tuple[str, str]:
        first, second = (DASH if slot is None else text(slot) or DASH for slot in measurements)
        return first, second

    rows = {
        "shows": row(lambda slot: slot.source),
        "PSNR seen dB": row(lambda slot: _number(slot.psnr_db, 2)),
        "bits per texel": row(lambda slot: _number(slot.bits, 2)),
        "file MB": row(lambda slot: _number(slot.file_bytes, 2, 1e6)),
        "GPU MB": row(lambda slot: _number(slot.gpu_bytes, 2, 1e6)),
        "decode ms": row(lambda slot: _number(slot.draw_ms, 2)),
        "path": row(lambda slot: slot.path),
        "divergence score": row(lambda slot: f"{slot.divergence.score:.4f}" if slot.divergence else None),
        "excess": row(lambda slot: str(slot.divergence.excess) if slot.divergence else None),
    }
    further = {
        "compression dB": row(lambda slot: _number(slot.compression_db, 2)),
        "load Mtexel/s": row(lambda slot: _number(slot.load_rate, 1, 1e6)),
    }
    rows |= {name: both for name, both in further.items() if both != (DASH, DASH)}
    by_map = [slot.psnr_by_map if slot is not None else {} for slot in measurements]
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
    """Return the figures as JSON: numbers without rounding, null where a slot has no such figure or pictures are equal."""
    figures = {
        side: {
            "source": slot.source,
            "psnr_db": _finite(slot.psnr_db),
            "bits_per_texel": slot.bits,
            "file_bytes": slot.file_bytes,
            "gpu_bytes": slot.gpu_bytes,
            "decode_ms": slot.draw_ms,
            "path": slot.path or None,
            "compression_psnr_db": None if slot.compression_db is None else _finite(slot.compression_db),
            "load_texels_per_second": slot.load_rate,
            "divergence_score": slot.divergence.score if slot.divergence else None,
            "excess": slot.divergence.excess if slot.divergence else None,
            "psnr_db_by_map": {name: _finite(value) for name, value in slot.psnr_by_map.items()},
        }
        for side, slot in measured.items()
    }
    return json.dumps(figures, indent=2) + "\n"


def _finite(value: float | None) -> float | None:
    return None if value is None else finite_or_none(float(value))
