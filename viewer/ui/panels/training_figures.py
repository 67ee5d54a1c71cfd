"""The figures of a training in words: every PSNR says of what it is, and what it was before."""

from ntc.codec.registry import codec_named
from viewer.training.active_run import ActiveRun
from viewer.training.run_log import Run, mean_of_psnr
from viewer.ui.widgets import counted

LINES_SHOWN = 3
"""Groups whose outcome is told beside the question whether to keep a run; the log has all of them."""


def psnr_before(run: ActiveRun) -> float | None:
    """PSNR in dB of mip 0, of the mean square error of the textures that are trained, in the pack that the run goes on from; None
    where there is none, or it is not known."""
    start, progress = run.request.start if run.request is not None else None, run.progress
    if start is None or progress is None:
        return None
    known = [start.textures[index].psnr_db for index in progress.psnr_db if index < len(start.textures)]
    decibels = [value for value in known if value is not None]
    return mean_of_psnr(decibels) if decibels and len(decibels) == len(known) else None


def figures_under_way(run: ActiveRun) -> tuple[str, ...]:
    """What is known of a run while it trains, one figure a line."""
    progress = run.progress
    if progress is None:
        return ()
    before, now = psnr_before(run), f"{run.curves.mean_db[-1]:.2f} dB" if run.curves.mean_db else "not yet known"
    trained = f", {counted(len(progress.psnr_db), 'texture')}" if progress.psnr_db else ""
    if run.codec_kind is not None and not codec_named(run.codec_kind).trains:
        # Both are of mip 0, so that one can be set against the other.
        change = now if before is None else f"{before:.2f} -> {now}"
        lines = [f"PSNR of mip 0{trained}: {change}"]
    else:
        lines = [f"PSNR of samples of all mips: {now}"]
        if before is not None:
            lines.append(f"PSNR of mip 0 before: {before:.2f} dB")
        lines.append(f"decoders still free to change: {100.0 * progress.freezing_scale:.0f} %")
    return (*lines, f"speed: {progress.ktexels_per_second:,.0f} thousand texels/s")


def psnr_of_run(run: Run) -> str:
    """The PSNR of an ended run, by its name."""
    if run.psnr_db is None:
        return "PSNR not known"
    textures = run.pack.textures if run.pack is not None else ()
    measured = bool(textures) and all(texture.psnr_db is not None for texture in textures)
    of = (
        f"mip 0, {counted(len(textures), 'texture')}" if measured else "samples of all mips" if textures else "the pack"
    )
    return f"PSNR of {of}: {run.psnr_db:.2f} dB"


def figures_of_run(run: Run) -> tuple[str, ...]:
    """What a run has come to, one figure a line: the whole pack, then group by group with what each was before."""
    more = len(run.lines) - LINES_SHOWN
    rest = (f"and {more} more: rest the mouse on the run in the list",) if more > 0 else ()
    return (psnr_of_run(run), *run.lines[:LINES_SHOWN], *rest)
