"""`ntc-viewer share`: compares groupings: what sharing decoders costs in quality, and saves in divergence, bytes and time."""

import io
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from ntc.codec.encoding import CancelQuestion
from ntc.codec.registry import codec_named
from ntc.errors import InputError, TrainingCancelledError
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs
from ntc.io import write_bytes, write_text
from ntc.pack.file import write_pack
from ntc.training.turns import SampledTexels
from viewer.cli.encode import Source, deferred_interrupt, read_source
from viewer.cli.options import ShareOptions
from viewer.cli.progress import TerminalProgress
from viewer.gl.context import create_headless_context
from viewer.locations import cache_folder
from viewer.scene.model import Camera
from viewer.scene.scene_files import PACK_SUFFIX
from viewer.scene.text_table import Cell, Column, Table
from viewer.sharing.candidates import (
    Candidate,
    CandidateTraining,
    candidates,
    compared_groupings,
    train_in_turns,
)
from viewer.sharing.measurement import PathTimer, SharingRow, SplitViews, measured_row
from viewer.sharing.report import sentences, sharing_figure
from viewer.sharing.settings import SharingSettings
from viewer.state.view_state import DecodePath
from viewer.viewpoints.scene_views import ViewSource, scene_views

COLUMNS = (
    Column("name", "grouping"),
    Column("seed", "seed"),
    Column("decoders", "decoders"),
    Column("psnr_db", "PSNR dB"),
    Column("worst_db", "worst dB"),
    Column("worst_texture", "worst texture"),
    Column("excess", "excess"),
    Column("score", "score", 3),
    Column("divergent_blocks", "divergent blocks"),
    Column("bytes", "bytes"),
    Column("steps", "steps"),
    Column("seconds", "s", 1),
)


@dataclass(frozen=True, eq=False)
class _Inputs:
    """Textures, views and camera of the comparison."""

    source: Source
    views: SplitViews | None
    camera: Camera | None


def share(options: ShareOptions) -> int:
    """Run `ntc-viewer share`. Raises InputError for bad input, and KeyboardInterrupt after Ctrl-C: the same command resumes."""
    settings = options.settings()
    if options.out.exists() and not options.out.is_dir():
        raise InputError(f"--out {options.out}: is a file; name a folder")
    inputs = _inputs(options, settings)
    features = FeatureOptions(cache=cache_folder("features"))
    seen = GroupingInputs(() if inputs.views is None else inputs.views.optimised, {}, features)
    textures = inputs.source.textures
    compared = candidates(settings, textures, compared_groupings(settings, textures, seen))
    with TerminalProgress("training", lines=True) as progress, deferred_interrupt() as cancelled:
        trainings = _trained(compared, options.out, progress, cancelled)
        rows = _measured(trainings, inputs, options, progress)
    _write(rows, options, settings, inputs)
    for each in trainings:
        if each.state is not None:
            each.state.unlink(missing_ok=True)
    return 0


def _inputs(options: ShareOptions, settings: SharingSettings) -> _Inputs:
    source = read_source(options.scene, options.texture_size, codec_named(settings.codec).default_maps)
    if source.scene is None:
        if "covisible" in settings.groupings:
            raise InputError("--groupings covisible: a folder of images has no viewpoints; name a scene")
        return _Inputs(source, None, None)
    all_views = scene_views(source.scene, ViewSource(options.views, None, settings.seeds[0]))
    camera = (*all_views.cameras, *all_views.sampled)[0]
    return _Inputs(source, SplitViews.of(all_views.all_then_release(len(source.textures))), camera)


def _trained(
    compared: Sequence[Candidate], out: Path, progress: TerminalProgress, cancelled: CancelQuestion
) -> list[CandidateTraining]:
    """Train all candidates in turns. After Ctrl-C their states are written to `out`, and the same command resumes."""
    sample = SampledTexels.of(compared[0].request.textures)
    keeps = codec_named(compared[0].request.codec.kind).trains
    trainings = [
        CandidateTraining(each, sample, cancelled, _file(out, each, ".state") if keeps else None) for each in compared
    ]
    try:
        for each in train_in_turns(trainings):
            share = sum(training.share for training in trainings) / len(trainings)
            curve = each.training.curve
            quality = f" {curve[-1].psnr_db:.2f} dB" if curve else ""
            progress.show(share, f"{each.candidate.name}{quality}")
    except TrainingCancelledError:
        for each in trainings:
            if each.state is not None:
                each.training.save(each.state)
        raise KeyboardInterrupt from None
    return trainings


def _file(out: Path, candidate: Candidate, suffix: str) -> Path:
    return out / f"{candidate.name}.seed-{candidate.seed}{suffix}"


def _measured(
    trainings: Sequence[CandidateTraining], inputs: _Inputs, options: ShareOptions, progress: TerminalProgress
) -> list[SharingRow]:
    """Write the pack of each training, and return the results. Only packs of the first seed are timed: seeds do not change times."""
    rows: list[SharingRow] = []
    timer = None
    scene, camera = inputs.source.scene, inputs.camera
    if scene is not None and camera is not None:
        timer = PathTimer(create_headless_context(options.gpu), scene, camera, options.size)
    times: dict[str, Mapping[DecodePath, float]] = {}
    for number, each in enumerate(trainings):
        candidate, training = each.candidate, each.training
        progress.show(number / len(trainings), candidate.name, "measuring")
        pack = training.pack()
        write_pack(_file(options.out, candidate, PACK_SUFFIX), pack)
        if timer is not None and candidate.name not in times:
            times[candidate.name] = timer.ms(pack)
        samples = 0 if training.latest is None else training.latest.texels
        row = measured_row(candidate.name, candidate.seed, pack, samples, training.curve, inputs.views)
        rows.append(replace(row, ms=times.get(candidate.name, {})))
    if timer is not None:
        timer.release()
    return rows


def _cells(row: SharingRow) -> dict[str, Cell]:
    """Return the results of a row as the cells of a table."""
    cells: dict[str, Cell] = {key: value for key, value in vars(row).items() if isinstance(value, Cell)}
    for name, figures in (("", row.held_out), ("optimised_", row.optimised)):
        if figures is not None:
            cells.update({f"{name}{key}": value for key, value in vars(figures).items()})
    return cells | {f"{path}_ms": value for path, value in row.ms.items()}


def _write(rows: Sequence[SharingRow], options: ShareOptions, settings: SharingSettings, inputs: _Inputs) -> None:
    """Write the files of the comparison, and print its table and sentences."""
    paths = list(dict.fromkeys(path for row in rows for path in row.ms))
    columns = (*COLUMNS, *(Column(f"{path}_ms", f"{path} ms", 1) for path in paths))
    conclusions = sentences(rows)
    record = {
        "scene": str(options.scene),
        "settings": asdict(settings),
        "textures": len(inputs.source.textures),
        "views": "every second view is held out: no grouping was chosen for it",
        "sentences": conclusions,
        "rows": [asdict(row) for row in rows],
    }
    cells = [_cells(row) for row in rows]
    every = [Column(key, key) for key in dict.fromkeys(key for each in cells for key in each)]
    title = options.scene.stem if inputs.source.scene is None else inputs.source.scene.title
    steps = f"{settings.steps} steps each" if codec_named(settings.codec).trains else "encoded"
    figure = sharing_figure(rows, f"{title}: codec {settings.codec}, {steps}")
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=120)
    write_bytes(options.out / "share.png", picture.getvalue())
    write_text(options.out / "share.csv", Table(every, cells).csv())
    write_text(options.out / "share.json", json.dumps(record, indent=1, allow_nan=False) + "\n")
    table = Table(columns, cells).text()
    sys.stdout.write("\n".join([table, *conclusions, f"wrote {options.out}", ""]))
