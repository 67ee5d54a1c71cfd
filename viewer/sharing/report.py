"""Report of a comparison of groupings: sentences and a figure."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from viewer.sharing.measurement import SharingRow

REFERENCE_GROUPING = "baseline"
"""Grouping that others are compared with: a decoder for each texture."""
SMALLEST_CHANGE = 0.05
"""Smallest relative change of excess or bytes, and smallest difference in dB, that a sentence names."""


@dataclass(frozen=True)
class SharingPoint:
    """Results of a grouping over all of its seeds."""

    name: str
    rows: tuple[SharingRow, ...]

    @property
    def psnr_db(self) -> float:
        """Mean over seeds of the mean PSNR in dB; infinite where all textures are exact."""
        return float(np.mean(self._psnrs))

    @property
    def spread_db(self) -> float:
        """Largest difference in dB between two seeds; 0 with one."""
        return max(self._psnrs) - min(self._psnrs) if len(self.rows) > 1 else 0.0

    @property
    def excess(self) -> int | None:
        """Excess in the views that no grouping was optimised for, the same for all seeds; None without views."""
        held_out = self.rows[0].held_out
        return None if held_out is None else held_out.excess

    @property
    def bytes(self) -> int:
        """Bytes of codes, decoders and constants of textures."""
        return self.rows[0].bytes

    @property
    def _psnrs(self) -> list[float]:
        return [np.inf if row.psnr_db is None else row.psnr_db for row in self.rows]


def sharing_points(rows: Sequence[SharingRow]) -> list[SharingPoint]:
    """Return the rows by grouping, in the order of their first rows."""
    names = list(dict.fromkeys(row.name for row in rows))
    return [SharingPoint(name, tuple(row for row in rows if row.name == name)) for name in names]


def sentences(rows: Sequence[SharingRow]) -> list[str]:
    """Return a sentence for each grouping that shares decoders, which compares it with a decoder per texture.

    Differences in dB below the spread of seeds count as equal. Empty without `baseline`.
    """
    points = sharing_points(rows)
    reference = next((point for point in points if point.name == REFERENCE_GROUPING), None)
    if reference is None:
        return []
    return [_sentence(point, reference) for point in points if point is not reference]


def _sentence(point: SharingPoint, reference: SharingPoint) -> str:
    decoders = point.rows[0].decoders
    name = f"{point.rows[0].grouping} with {decoders} decoder{'s' if decoders != 1 else ''}"
    parts = [_quality(point, reference), _excess(point, reference), _bytes(point, reference)]
    return f"{name}: {', '.join(part for part in parts if part)}."


def _quality(point: SharingPoint, reference: SharingPoint) -> str:
    difference = point.psnr_db - reference.psnr_db
    noise = max(point.spread_db, reference.spread_db, SMALLEST_CHANGE)
    if not np.isfinite(difference) or abs(difference) <= noise:
        return "as good as a decoder per texture"
    return f"{abs(difference):.1f} dB {'above' if difference > 0 else 'below'} a decoder per texture"


def _excess(point: SharingPoint, reference: SharingPoint) -> str:
    if point.excess is None or not reference.excess:
        return ""
    if point.excess == 0:
        return "no divergence"
    ratio = point.excess / reference.excess
    if abs(ratio - 1.0) < SMALLEST_CHANGE:
        return "the same divergence"
    return f"{100.0 * ratio:.0f} % of its divergence"


def _bytes(point: SharingPoint, reference: SharingPoint) -> str:
    ratio = point.bytes / reference.bytes
    if abs(ratio - 1.0) < SMALLEST_CHANGE:
        return "the same size"
    return f"{100.0 * ratio:.0f} % of its bytes"


def sharing_figure(rows: Sequence[SharingRow], title: str) -> Figure:
    """Return a figure of PSNR over excess, a point for each grouping with a bar for the spread of its seeds, and training curves."""
    figure = Figure(figsize=(11, 4.5), layout="constrained")
    figure.suptitle(title, fontsize=10)
    scatter, curves = figure.subplots(1, 2)
    points = sharing_points(rows)
    for number, point in enumerate(points):
        _draw_point(scatter, point, f"C{number}")
        for row in point.rows:
            label = point.name if row is point.rows[0] else None
            steps, quality = [each.step for each in row.curve], [each.psnr_db for each in row.curve]
            curves.plot(steps, quality, color=f"C{number}", label=label, linewidth=1.2)
    has_views = points[0].excess is not None
    scatter.set_xlabel("excess in views that no grouping was chosen for" if has_views else "decoders")
    scatter.set_ylabel("PSNR of textures, mip 0, mean, dB")
    curves.set_xlabel("steps" if len(points[0].rows[0].curve) > 1 else "textures")
    curves.set_ylabel("PSNR on a fixed sample of texels, mean, dB")
    curves.legend(fontsize=8)
    # Room for the names beside the points.
    scatter.margins(x=0.2, y=0.1)
    for axes in (scatter, curves):
        axes.grid(alpha=0.3)
    return figure


def _draw_point(axes: Axes, point: SharingPoint, color: str) -> None:
    across = point.rows[0].decoders if point.excess is None else point.excess
    if not np.isfinite(point.psnr_db):
        return
    axes.errorbar(across, point.psnr_db, yerr=point.spread_db / 2.0, fmt="o", color=color, capsize=3)
    axes.annotate(point.name, (across, point.psnr_db), textcoords="offset points", xytext=(6, 4), fontsize=8)
