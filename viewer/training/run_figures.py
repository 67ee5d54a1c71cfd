"""Figures of training runs as lines of text, for the window."""

import numpy as np

from ntc.codec.registry import codec_named
from viewer.scene.json_text import counted
from viewer.training.run_log import ActiveRun, Curves, Run, mean_of_psnr

LINES_SHOWN = 3
"""Number of groups whose result is shown above the list of runs, which has all."""


def psnr_before(run: ActiveRun) -> float | None:
    """Return the PSNR in dB of mip 0 of the trained textures in the pack that the run continues, of their mean square error; None
    without such a pack, and where it is unknown."""
    start, progress = run.request.start if run.request is not None else None, run.progress
    if start is None or progress is None:
        return None
    known = [start.textures[index].psnr_db for index in progress.psnr_db if index < len(start.textures)]
    decibels = [value for value in known if value is not None]
    return mean_of_psnr(decibels) if decibels and len(decibels) == len(known) else None


def figures_under_way(run: ActiveRun) -> tuple[str, ...]:
    """Return the figures of a run under way, one a line."""
    progress = run.progress
    if progress is None:
        return ()
    before, now = psnr_before(run), f"{run.curves.mean_db[-1]:.2f} dB" if run.curves.mean_db else "not yet measured"
    trained = f", {counted(len(progress.psnr_db), 'texture')}" if progress.psnr_db else ""
    if run.codec_kind is not None and not codec_named(run.codec_kind).trains:
        # Both are of mip 0, so that they can be compared.
        change = now if before is None else f"{before:.2f} -> {now}"
        lines = [f"PSNR of mip 0{trained}: {change}"]
    else:
        lines = [f"PSNR of samples of all mips: {now}"]
        if before is not None:
            lines.append(f"PSNR of mip 0 before: {before:.2f} dB")
        lines.append(f"learning rate of the decoders: {100.0 * progress.freezing_scale:.0f} %")
    return (*lines, f"speed: {progress.ktexels_per_second:,.0f} thousand texels/s")


def psnr_of_run(run: Run) -> str:
    """Return the PSNR of an ended run, and what it is measured on."""
    if run.psnr_db is None:
        return "PSNR unknown"
    textures = run.pack.textures if run.pack is not None else ()
    measured = bool(textures) and all(texture.psnr_db is not None for texture in textures)
    of = (
        f"mip 0, {counted(len(textures), 'texture')}" if measured else "samples of all mips" if textures else "the pack"
    )
    return f"PSNR of {of}: {run.psnr_db:.2f} dB"


def figures_of_run(run: Run) -> tuple[str, ...]:
    """Return the figures of an ended run, one a line: the whole pack, then each group with its PSNR before."""
    more = len(run.lines) - LINES_SHOWN
    rest = (f"and {more} more: point at the run in the list below",) if more > 0 else ()
    return (psnr_of_run(run), *run.lines[:LINES_SHOWN], *rest)


def loss_ticks(curves: Curves) -> list[float]:
    """Return ticks at 1, 2 and 5 of each decade of the losses: the plot itself labels only whole decades."""
    values = np.concatenate([curves.array(curve) for curve in curves.losses.values()])
    values = values[np.isfinite(values) & (values > 0.0)]
    if not len(values):
        return [1.0]
    decades = range(int(np.floor(np.log10(values.min()))), int(np.ceil(np.log10(values.max()))) + 1)
    ticks = [digit * 10.0**decade for decade in decades for digit in ((1, 2, 5) if len(decades) < 3 else (1,))]
    return [tick for tick in ticks if 0.5 * values.min() <= tick <= 2.0 * values.max()] or [float(values.max())]


def psnr_ends(curves: Curves, texture: int | None) -> tuple[float, float]:
    """Return the range in dB that the curve of the mean and that of `texture` need, with a margin: the plot's own range is that of the
    frame before."""
    drawn = [curves.mean_db, *([curves.psnr_db[texture]] if texture is not None else [])]
    values = np.concatenate([curves.array(curve) for curve in drawn])
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    margin = max(0.05 * (high - low), 0.05)
    return low - margin, high + margin
