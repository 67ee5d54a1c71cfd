"""Study of numerical stability (`ntc-viewer study stability`): errors of every path and precision against float64 and bounds."""

from collections.abc import Sequence
from dataclasses import asdict

from matplotlib.figure import Figure
from rich.console import Console

from lab.bench.stability import StabilityBench, StabilityRow, computed_precisions, scene_rows, stability_rows
from lab.bench.stability_block_cases import block_cases
from lab.bench.stability_cases import stability_cases, trained_case
from lab.bench.trained_loss import TrainedLoss, trained_loss
from lab.commands.options import StabilityStudyOptions
from lab.runner import StudyOutput
from lab.studies.bound_check import BoundCheck, check_bounds
from ntc.codec.grid.model import GridConfig
from ntc.codec.model import Pack
from ntc.errors import InputError
from viewer.cli.sources import open_scene, packs_for
from viewer.gl.context import create_headless_context
from viewer.scene.source_textures import source_textures
from viewer.scene.text_table import Cell, Column, Table
from viewer.state.framing import frame_all

TRAINED_SHARE = 16
"""Divisor of the checked texels that gives the number in trained packs. Their networks are larger and slower."""
COLUMNS = (
    Column("case", "case"),
    Column("path", "path"),
    Column("precision", "precision"),
    Column("texels", "texels"),
    Column("largest", "max error"),
    Column("rms", "RMS error"),
    Column("ulps", "max ulps", 0),
    Column("not_finite", "NaN, Inf"),
    Column("bound", "bound"),
    Column("holds", "holds"),
)


def _short(value: float | None) -> str | None:
    return None if value is None else f"{value:.1e}"


def stability_table(rows: Sequence[StabilityRow]) -> Table:
    """Return the table of all rows."""
    cells: list[dict[str, Cell]] = [
        {
            **{
                key: value
                for key, value in asdict(row).items()
                if key in ("case", "path", "precision", "texels", "ulps")
            },
            "largest": _short(row.largest),
            "rms": _short(row.rms),
            "not_finite": row.not_finite,
            "bound": _short(row.bound),
            "holds": None if row.holds is None else ("yes" if row.holds else "NO"),
        }
        for row in rows
    ]
    return Table(COLUMNS, cells)


def worst_table(rows: Sequence[StabilityRow]) -> Table:
    """Return the worst case of each path and precision, without cases whose numbers leave the range of the precision."""
    columns = (
        *COLUMNS[1:3],
        Column("cases", "cases"),
        *COLUMNS[4:5],
        Column("worst", "in"),
        *COLUMNS[7:8],
        *COLUMNS[9:],
    )
    cells: list[dict[str, Cell]] = []
    for path, precision in dict.fromkeys((row.path, row.precision) for row in rows):
        same_path = [row for row in rows if (row.path, row.precision) == (path, precision)]
        certain = [
            row
            for row in same_path
            if row.largest is not None and not (row.bound is not None and row.bound >= 1.0 and row.largest > 0.05)
        ]
        worst = max(certain, key=lambda row: row.largest or 0.0, default=None)
        cells.append(
            {
                "path": path,
                "precision": precision,
                "cases": len(same_path),
                "largest": _short(worst.largest) if worst else None,
                "worst": worst.case if worst else None,
                "not_finite": sum(row.not_finite for row in same_path),
                "holds": "yes" if all(row.holds is not False for row in same_path) else "NO",
            }
        )
    return Table(columns, cells)


def stability_figure(rows: Sequence[StabilityRow], title: str) -> Figure:
    """Return a plot of the texel decoder's largest error and bound by case, with a panel for each precision."""
    precisions = list(dict.fromkeys(row.precision for row in rows))
    figure = Figure(figsize=(4.6 * len(precisions), 7.0), layout="constrained")
    figure.suptitle(title)
    panels = figure.subplots(1, len(precisions), sharey=True, squeeze=False)[0]
    for panel, precision in zip(panels, precisions, strict=True):
        shown_rows = [row for row in rows if row.precision == precision and row.path == "texels"]
        places = list(range(len(shown_rows)))
        panel.plot([max(row.largest or 0.0, 1e-9) for row in shown_rows], places, "o", label="largest error")
        panel.plot([row.bound or 1.0 for row in shown_rows], places, "x", color="#d95f02", label="certified bound")
        panel.axvline(0.5 / 255.0, color="#888888", linewidth=0.8, label="half an 8-bit step")
        panel.set(xscale="log", xlabel="error in [0, 1]", title=precision)
        panel.set_yticks(places, [row.case for row in shown_rows])
    panels[0].legend(loc="lower left", fontsize=8)
    return figure


def _checks(options: StabilityStudyOptions, packs: dict[str, Pack], console: Console) -> list[BoundCheck]:
    packs = {name: pack for name, pack in packs.items() if isinstance(pack.config, GridConfig)}
    cases = {
        case.name: case.pack
        for case in stability_cases(1, options.seed)
        if case.rescale and "decoders" not in case.name
    }
    cheap = options.bound_texels - options.bound_texels // TRAINED_SHARE
    shares = [(name, pack, cheap // len(cases)) for name, pack in cases.items()]
    shares += [
        (f"trained: {name}", pack, (options.bound_texels - cheap) // max(1, len(packs))) for name, pack in packs.items()
    ]
    checks = []
    for name, pack, texels in shares:
        for precision in options.precisions:
            console.print(f"bounds: {name}, {precision}")
            checks.append(check_bounds(name, pack, precision, texels // len(options.precisions), options.seed))
    return checks


def _summary(checks: Sequence[BoundCheck], losses: Sequence[TrainedLoss]) -> str:
    lines = [
        f"certified bounds: {sum(check.texels for check in checks):,} texels, {sum(check.beyond for check in checks)} values beyond; "
        f"an error takes at most {max((check.largest_share for check in checks), default=0.0):.0%} of its bound"
    ]
    lines += [
        f"{loss.pack}, {loss.precision}: {loss.psnr_db:.2f} dB, loses {loss.mean_loss_db:.4f} dB, "
        f"at most {loss.largest_loss_db:.4f} dB (error {loss.largest_error:.1e})"
        for loss in losses
    ]
    return "\n".join(lines) + "\n"


def study_stability(options: StabilityStudyOptions) -> int:
    """Run `ntc-viewer study stability`. Raises InputError for bad input."""
    output = StudyOutput(options.out)
    if options.texels < 1:
        raise InputError(f"--texels {options.texels}: must be at least 1")
    if options.bound_texels < 0:
        raise InputError(f"--bound-texels {options.bound_texels}: must not be negative")
    if not options.precisions:
        raise InputError("--precisions: name at least one")
    console = Console(stderr=True, soft_wrap=True)
    scene = open_scene(options.scene)
    named = packs_for(scene, options.pack)
    packs = {
        name: pack
        for name, pack in named.items()
        if pack.path in options.pack or pack.grouping.name in options.grouping
    }
    if not packs:
        raise InputError(
            f"--grouping {' '.join(options.grouping)}: {scene.name} has no such pack; name one with --pack"
        )
    context = output.context = create_headless_context()
    with context.reset.watched():
        bench = StabilityBench(context)
        cases = [*stability_cases(options.texels, options.seed), *block_cases(options.texels, options.seed)]
        cases += [trained_case(name, pack, options.texels, options.seed) for name, pack in packs.items()]
        rows = stability_rows(bench, cases, options.precisions, console.print)
        images = (*source_textures(scene, None), *source_textures(scene, None, "all"))
        losses = [
            loss
            for name, pack in packs.items()
            for precision in computed_precisions(pack, options.precisions)
            if (loss := trained_loss(bench, name, pack, images, precision, options.texels)) is not None
        ]
        bench.release()
        camera = scene.cameras[0] if scene.cameras else frame_all(scene, 60.0)
        first = dict(list(packs.items())[:1])
        rows += scene_rows(context, scene, first, camera, options.size, options.precisions, console.print)
    checks = _checks(options, packs, console) if options.bound_texels else []
    title = f"Numerical stability: {len(cases)} cases, {scene.name}, {context.info.renderer}"
    facts = {
        "scene": scene.name,
        "settings": {"texels": options.texels, "bound_texels": options.bound_texels, "seed": options.seed},
        "worst": [dict(row) for row in worst_table(rows).rows],
        "trained": [asdict(loss) for loss in losses],
        "bounds": [asdict(check) for check in checks],
    }
    output.write(
        "stability",
        title,
        stability_table(rows),
        stability_figure(rows, title),
        facts,
        [asdict(row) for row in rows],
        worst_table(rows).text() + _summary(checks, losses),
    )
    output.end()
    return 0
