"""`ntc-viewer study rate`: rate and distortion of this program's codecs beside the formats that users have today."""

from itertools import count

from rich.console import Console

from lab.commands.options import RateStudyOptions
from lab.commands.rate_points import Found, points_by_jobs, rate_study
from lab.runner import StudyOutput, do_steps, write_figure
from lab.studies.rate import RateStudy
from lab.studies.rate_table import RatePoint, disk_figure, disk_rows, rate_figure, rate_table
from ntc.errors import InputError

DISK_DECIBELS = tuple(float(each) for each in range(32, 46))
"""Mean PSNR at which sizes of files are compared."""


def _check(options: RateStudyOptions) -> None:
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
    output = StudyOutput(options.out)
    study = rate_study(options)
    textures, clusters = study.textures, min(options.clusters, len(study.textures))
    points = _points(study) if options.workers is None and options.ray is None else _points_by_jobs(study, options)
    side = max(max(texture.size) for texture in textures)
    title = f"{options.source.stem}: {len(textures)} textures of at most {side} texels, {clusters} clusters"
    if options.grid_steps:
        title += f", codec grid after {options.grid_steps} steps"
    table = rate_table(points)
    facts = {
        "textures": [texture.name for texture in textures],
        "grid_steps": options.grid_steps,
        "flip_every": options.flip_every,
        "disk": disk_rows(points, DISK_DECIBELS),
    }
    output.write("rate", title, table, rate_figure({title: points}), facts)
    if any(point.quality.file_bits_per_texel is not None for point in points):
        write_figure(options.out / "rate_disk.png", disk_figure({title: points}))
    output.end()
    return 0


def _points(study: RateStudy) -> list[RatePoint]:
    """Every point that can be had, with progress and ETA on standard error. Raises InputError where there is none."""
    points = do_steps(study.steps(), _line, skipped=True)
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
