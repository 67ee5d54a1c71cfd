"""Study of rate and distortion (`ntc-viewer study rate`): this program's codecs beside the formats in use today."""

from pathlib import Path

from lab.commands.options import RateStudyOptions
from lab.runner import StudyOutput, do_steps, write_figure
from lab.studies.rate import RateStudy
from lab.studies.rate_table import RatePoint, disk_figure, disk_rows, rate_figure, rate_table
from ntc.codec.config import GroupingConfig
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from viewer.cli.encode import read_source
from viewer.locations import cache_folder

DISK_DECIBELS = tuple(float(each) for each in range(32, 46))
"""Mean PSNR at which sizes of files are compared."""


def _textures(source: Path, side: int, most: int) -> tuple[SourceTexture, ...]:
    """Return at most `most` RGB textures of a scene or folder, evenly chosen, reduced to `side` texels. Raises InputError."""
    textures = [texture for texture in read_source(source, side).textures if texture.pixels.shape[2] == 3]
    if not textures:
        raise InputError(f"{source}: has no texture with three channels")
    if len(textures) > most:
        textures = [textures[index * len(textures) // most] for index in range(most)]
    return tuple(textures)


def _study(options: RateStudyOptions) -> RateStudy:
    """Return the study that `options` describe, with its textures. Raises InputError."""
    textures = _textures(options.source, options.texture_size, options.most)
    inputs = GroupingInputs(features=FeatureOptions(cache=cache_folder("features")))
    clusters = min(options.clusters, len(textures))
    groupings = [make_grouping(GroupingConfig(name, clusters), textures, inputs) for name in options.groupings]
    return RateStudy(
        textures,
        groupings,
        options.sides,
        options.bits,
        options.formats,
        options.grid_steps,
        options.disk_formats,
        options.jpeg_xl,
        options.flip_every,
        options.out / "runs",
        cache_folder("blocks"),
    )


def _check(options: RateStudyOptions) -> None:
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
    study = _study(options)
    textures, clusters = study.textures, min(options.clusters, len(study.textures))
    points = _points(study)
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
    output.write("rate", title, table, rate_figure(points, title), facts)
    if any(point.quality.file_bits_per_texel is not None for point in points):
        write_figure(options.out / "rate_disk.png", disk_figure(points, title))
    output.end()
    return 0


def _points(study: RateStudy) -> list[RatePoint]:
    """Return every point that can be measured, with progress on standard error. Raises InputError where there is none."""
    points = do_steps(study.steps(), _line, skipped=True)
    if not points:
        raise InputError("study rate: no codec could be measured; the lines above say why")
    return points


def _line(point: RatePoint) -> str:
    return f"{point.quality.bits_per_texel:.2f} bits, {point.quality.mean_db:.2f} dB"
