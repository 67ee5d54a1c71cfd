"""`ntc-viewer study rate`: rate and distortion of this program's codecs beside the formats that users have today."""

import sys
import time
from itertools import count
from typing import Any

from rich.console import Console
from rich.progress import Progress, TimeRemainingColumn

from lab.bench.record import write_figure
from lab.commands.options import RateStudyOptions
from lab.commands.rate_points import Found, points_by_jobs, rate_study
from lab.commands.study_output import check_output, machine, write_study
from lab.studies.rate import RateStudy
from lab.studies.rate_table import RatePoint, disk_figure, disk_rows, rate_figure, rate_table
from ntc.errors import InputError

DISK_DECIBELS = tuple(float(each) for each in range(32, 46))
"""Mean PSNR at which sizes of files are compared."""


def _check(options: RateStudyOptions) -> None:
    check_output(options.out)
    if options.workers is not None and options.ray is not None:
        raise InputError("--workers and --ray exclude each other: a cluster has as many workers as it has cores")
    at_least_one = {
        "texture-size": options.texture_size,
        "most": options.most,
        "clusters": options.clusters,
        "flip-every": options.flip_every,
    }
    for name, value in at_least_one.items():
        if value < 1:
            raise InputError(f"--{name} {value}: must be at least 1")
    if options.grid_steps < 0:
        raise InputError(f"--grid-steps {options.grid_steps}: must be at least 1, or 0 for no codec grid")
    for bits in options.bits:
        if not bits > 0.0:
            raise InputError(f"--bits {bits:g}: must be above 0")
    if not options.groupings:
        raise InputError("--groupings: name at least one")


def study_rate(options: RateStudyOptions) -> int:
    """Run `ntc-viewer study rate`. Raises InputError for bad input."""
    _check(options)
    began = time.monotonic()
    study = rate_study(options)
    textures, clusters = study.textures, min(options.clusters, len(study.textures))
    points = _points(study) if options.workers is None and options.ray is None else _points_by_jobs(study, options)
    side = max(max(texture.size) for texture in textures)
    title = f"{options.source.stem}: {len(textures)} textures of at most {side} texels, {clusters} clusters"
    if options.grid_steps:
        title += f", codec grid after {options.grid_steps} steps"
    table = rate_table(points)
    record: dict[str, Any] = {
        "study": "rate",
        "what": title,
        "textures": [texture.name for texture in textures],
        "grid_steps": options.grid_steps,
        "flip_every": options.flip_every,
        "machine": machine(),
        "seconds": time.monotonic() - began,
        "rows": [dict(row) for row in table.rows],
        "disk": disk_rows(points, DISK_DECIBELS),
    }
    write_study(options.out, "rate", title, table, rate_figure({title: points}), record)
    if any(point.quality.file_bits_per_texel is not None for point in points):
        write_figure(options.out / "rate_disk.png", disk_figure({title: points}))
    sys.stdout.write(f"{title}\n{table.text()}wrote {options.out}\n")
    return 0


def _points(study: RateStudy) -> list[RatePoint]:
    """Every point that can be had, with progress and ETA on standard error. Raises InputError where there is none."""
    points: list[RatePoint] = []
    steps = study.steps()
    console = Console(stderr=True, soft_wrap=True)
    with Progress(*Progress.get_default_columns()[:-1], TimeRemainingColumn(), console=console, transient=True) as bar:
        whole = bar.add_task("", total=len(steps))
        for number, (name, step) in enumerate(steps):
            bar.update(whole, description=name)

            def report(done: int, of: int, before: int = number) -> None:
                bar.update(whole, completed=before + done / max(1, of))

            try:
                points.append(step(report))
            except InputError as error:
                line = f"left out: {error}"
            else:
                line = _line(points[-1])
            bar.update(whole, completed=number + 1)
            console.print(f"{number + 1}/{len(steps)} {name}: {line}", highlight=False)
    if not points:
        raise InputError("study rate: no codec could be measured; the lines above say why")
    return points


def _points_by_jobs(study: RateStudy, options: RateStudyOptions) -> list[RatePoint]:
    """The same, measured side by side."""
    console, steps = Console(stderr=True, soft_wrap=True), study.steps()
    done = count(1)

    def tell(number: int, point: Found) -> None:
        line = f"left out: {point}" if isinstance(point, str) else _line(point)
        console.print(f"{next(done)}/{len(steps)} {steps[number][0]}: {line}", highlight=False)

    points = points_by_jobs(options, tell)
    if not points:
        raise InputError("study rate: no codec could be measured; the lines above say why")
    return points


def _line(point: RatePoint) -> str:
    return f"{point.quality.bits_per_texel:.2f} bits, {point.quality.mean_db:.2f} dB"
