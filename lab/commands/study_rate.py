"""`ntc-viewer study rate`: rate and distortion of this program's codecs beside the formats that users have today."""

import sys
import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress, TimeRemainingColumn

from lab.commands.options import RateStudyOptions
from lab.commands.study_output import check_output, machine, write_study
from lab.studies.rate import RateStudy
from lab.studies.rate_table import RatePoint, rate_figure, rate_table
from ntc.codec.config import GroupingConfig
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from viewer.cli.encode import read_source
from viewer.locations import blocks_cache, features_cache


def _check(options: RateStudyOptions) -> None:
    check_output(options.out)
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


def read_textures(source: Path, side: int, most: int) -> tuple[SourceTexture, ...]:
    """At most `most` RGB textures of a scene or folder, evenly among all of them, at most `side` texels large. Raises InputError."""
    textures = [texture for texture in read_source(source, side).textures if texture.pixels.shape[2] == 3]
    if not textures:
        raise InputError(f"{source}: holds no texture of three channels")
    if len(textures) > most:
        textures = [textures[index * len(textures) // most] for index in range(most)]
    return tuple(textures)


def study_rate(options: RateStudyOptions) -> int:
    """Run `ntc-viewer study rate`. Raises InputError for bad input."""
    _check(options)
    began = time.monotonic()
    textures = read_textures(options.source, options.texture_size, options.most)
    inputs = GroupingInputs(features=FeatureOptions(cache=features_cache()))
    clusters = min(options.clusters, len(textures))
    groupings = [make_grouping(GroupingConfig(name, clusters), textures, inputs) for name in options.groupings]
    study = RateStudy(
        textures,
        groupings,
        options.sides,
        options.bits,
        options.formats,
        options.grid_steps,
        options.jpeg_xl,
        options.flip_every,
        options.out / "runs",
        blocks_cache(),
    )
    points = _points(study)
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
    }
    write_study(options.out, "rate", title, table, rate_figure({title: points}), record)
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
                quality = points[-1].quality
                line = f"{quality.bits_per_texel:.2f} bits, {quality.mean_db:.2f} dB"
            bar.update(whole, completed=number + 1)
            console.print(f"{number + 1}/{len(steps)} {name}: {line}", highlight=False)
    if not points:
        raise InputError("study rate: no codec could be measured; the lines above say why")
    return points
