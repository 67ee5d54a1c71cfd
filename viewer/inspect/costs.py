"""Cost bars of A, B and the block formats: bytes on disk and in memory, time per frame, and PSNR."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ntc.metrics.block_compression import BLOCK_FORMATS, BlockFormat, missing_packages
from ntc.metrics.compressed_textures import CompressedTextures
from viewer.inspect.measured_figures import SIDES
from viewer.state.session import SlotMeasurement
from viewer.state.view_state import Side


@dataclass(frozen=True)
class CostBar:
    """Cost of one source."""

    source: str
    value: float
    share: float
    """Share of the largest value of its kind, 0 to 1."""


@dataclass(frozen=True)
class _Cost:
    source: str
    values: tuple[float | None, float | None, float | None, float | None]


KINDS = ("on disk, MB", "in memory, MB", "a frame, ms", "PSNR, dB")


def cost_bars(
    measured: Mapping[Side, SlotMeasurement], formats: Mapping[BlockFormat, CompressedTextures]
) -> dict[str, tuple[CostBar, ...]]:
    """Return bars by kind of cost: those of A and B as measured, then those of encoded block formats that are in neither slot.

    The PSNR of A and B is that of the picture; the PSNR of other formats is that of their textures.
    """
    costs = [
        _Cost(
            f"{side.upper()}: {measurement.source}",
            (_mega(measurement.file_bytes), _mega(measurement.gpu_bytes), measurement.draw_ms, measurement.psnr_db),
        )
        for side in SIDES
        if (measurement := measured.get(side)) is not None
    ]
    shown = {measurement.source for measurement in measured.values()}
    for name, blocks in formats.items():
        if name not in shown:
            size, quality = _mega(blocks.stored_bytes), blocks.psnr
            costs.append(_Cost(name, (size, size, None, quality.of_mean_mse_db if quality is not None else None)))
    bars: dict[str, tuple[CostBar, ...]] = {}
    for number, kind in enumerate(KINDS):
        values = [(cost.source, cost.values[number]) for cost in costs]
        known = [(source, value) for source, value in values if value is not None and value < float("inf")]
        largest = max((value for _, value in known), default=0.0)
        bars[kind] = tuple(CostBar(source, value, value / largest if largest else 0.0) for source, value in known)
    return {kind: group for kind, group in bars.items() if group}


def _mega(count: int | None) -> float | None:
    return None if count is None else count / 1e6


def absent_formats() -> tuple[str, ...]:
    """Return lines that name the block formats without an installed encoder, and the command that installs it."""
    lines: dict[str, list[str]] = {}
    for name in BLOCK_FORMATS:
        lines.setdefault(missing_packages(name), []).append(name)
    return tuple(f"{', '.join(names)}: {missing}" for missing, names in lines.items() if missing)


def costs_png(bars: Mapping[str, Sequence[CostBar]]) -> bytes:
    """Return the bars as a PNG, one chart for each kind of cost."""
    # Imported where a chart is saved: windows open half a second sooner.
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 0.5 + sum(0.55 + 0.3 * len(group) for group in bars.values())), layout="constrained")
    axes = figure.subplots(len(bars), 1, squeeze=False, height_ratios=[len(group) + 1 for group in bars.values()])
    for axis, (kind, group) in zip(axes[:, 0], bars.items(), strict=True):
        drawn = axis.barh([bar.source for bar in group], [bar.value for bar in group], color="#4c78a8")
        axis.bar_label(drawn, [f"{bar.value:.2f}" for bar in group], padding=3)
        axis.set_title(kind, loc="left", fontsize=10)
        axis.invert_yaxis()
        axis.set_xlim(0.0, 1.15 * max(bar.value for bar in group) or 1.0)
        axis.spines[["top", "right"]].set_visible(False)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=120)
    return buffer.getvalue()
