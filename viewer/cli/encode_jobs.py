"""`ntc-viewer encode` by jobs: into a library or a pack, on the cores of this machine or on a cluster."""

import shutil
import sys
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

from ntc.codec.encoding import BitsTarget
from ntc.errors import InputError
from ntc.library.index import is_library, read_index
from ntc.library.reading import in_order, read_shards
from ntc.pack.file import write_pack
from ntc.threads import usable_cores
from viewer.cli.encode_target import encoding_choices
from viewer.cli.interrupts import deferred_interrupt
from viewer.cli.options import EncodeOptions
from viewer.encoding.report import report_lines, write_report
from viewer.encoding.whole_run import Asked, RunProgress, RunResult, encode_to_library
from viewer.encoding.work import LIST_SUFFIX, Reading, WorkJob, WorkResult, texture_refs, work
from viewer.jobs.executor import Executor, LocalExecutor, RayExecutor
from viewer.scene.json_text import counted
from viewer.scene.scene_files import PACK_SUFFIX
from viewer.scene.source_textures import MapChoice

LINES_PER_PHASE = 20
"""Progress lines of each phase where standard error is no terminal."""
KEPT_SUFFIX = ".jobs"
"""Suffix of the library that keeps finished jobs beside a pack until the pack is finished."""
REPORT_SUFFIX = ".report"
UNFINISHED = 1
"""Exit status where textures are missing."""


def is_by_jobs(options: EncodeOptions) -> bool:
    """Return whether jobs encode the textures: the options ask for it, or there is no other way."""
    asked = options.workers is not None or options.ray is not None
    return asked or options.out.suffix != PACK_SUFFIX or options.source.suffix.lower() == LIST_SUFFIX


def _check(options: EncodeOptions) -> None:
    if options.ray is not None and options.workers is not None:
        raise InputError("--workers and --ray exclude each other: a cluster has as many workers as it has cores")
    if options.gpus_per_job < 0.0:
        raise InputError(f"--gpus-per-job {options.gpus_per_job:g}: must be 0 or more")
    for name in ("state", "views", "sampled_views"):
        if getattr(options, name) is not None:
            raise InputError(
                f"--{name.replace('_', '-')}: is not for jobs; leave it out, or leave --workers and --ray out"
            )
    if options.out.suffix == PACK_SUFFIX:
        if options.out.is_dir():
            raise InputError(f"--out {options.out}: is a folder; name a file")
    elif options.out.is_dir() and any(options.out.iterdir()) and not is_library(options.out):
        raise InputError(
            f"--out {options.out}: holds other files and no library; name a new folder, or a pack ({PACK_SUFFIX})"
        )


def _asked(options: EncodeOptions, codec: str, maps: MapChoice) -> Asked:
    choices = encoding_choices(options)
    if choices.target is not None and not isinstance(choices.target, BitsTarget):
        name = "quality" if options.quality is not None else "size"
        raise InputError(f"--{name}: needs all textures at once; ask for --bits, or leave --workers and --ray out")
    reading = Reading(options.texture_size, maps, options.map_weights)
    one_pack = options.out.suffix == PACK_SUFFIX
    grouping = options.grouping_config()
    return Asked(reading, grouping, codec, choices, options.labels, one_pack)


def _executor(options: EncodeOptions) -> Executor[WorkJob, WorkResult]:
    if options.ray is not None:
        return RayExecutor(work, options.ray, options.gpus_per_job)
    return LocalExecutor(work, usable_cores() if options.workers is None else options.workers)


class _ProgressReport:
    """Progress over all jobs: a live bar on a terminal, else some lines."""

    def __init__(self, console: Console) -> None:
        self._console, self._last = console, ("", -1)
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("{task.fields[status]}"),
            console=console,
            transient=True,
        )
        self._task = self._bar.add_task("encoding", total=1.0, status="")

    def __enter__(self) -> "_ProgressReport":
        if self._console.is_terminal:
            self._bar.start()
        return self

    def __exit__(self, *_exception: object) -> None:
        self._bar.stop()

    def __call__(self, progress: RunProgress) -> None:
        if progress.note:
            self._console.print(f"tried again: {progress.note}", highlight=False, markup=False)
            return
        unit = f"{progress.texels_per_second / 1e6:.2f} Mtexel/s"
        rate = unit if progress.phase == "encoding" else f"{progress.texels_per_second:.1f} images/s"
        failed = f", {progress.failures} failed" if progress.failures else ""
        status = f"{progress.done}/{progress.of} textures{failed}  {rate}  {progress.seconds_left:.0f} s left"
        if self._console.is_terminal:
            self._bar.update(self._task, description=progress.phase, completed=progress.share, status=status)
            return
        step = (progress.phase, int(progress.share * LINES_PER_PHASE))
        if step != self._last:
            self._last = step
            self._console.print(f"{progress.phase} {progress.share:4.0%}  {status}", highlight=False, markup=False)


def encode_by_jobs(options: EncodeOptions, codec: str, maps: MapChoice) -> int:
    """Encode the textures that `options` name. Raises InputError for bad input, KeyboardInterrupt after Ctrl-C.

    The exit status is 1 where textures are missing: they are named.
    """
    _check(options)
    asked = _asked(options, codec, maps)
    refs = texture_refs(options.source, maps)
    console = Console(stderr=True, soft_wrap=True)
    folder = options.out.with_name(f"{options.out.name}{KEPT_SUFFIX}") if asked.one_pack else options.out
    executor = _executor(options)
    console.print(
        f"{counted(len(refs), 'texture')}, {executor.slots} at a time, codec {codec}, {options.grouping}",
        highlight=False,
    )
    try:
        with _ProgressReport(console) as report, deferred_interrupt() as interrupted:
            result = encode_to_library(asked, refs, executor, folder, report, interrupted)
    finally:
        executor.close()
    if result.stopped:
        console.print(
            f"stopped: {counted(len(result.stored), 'texture')} kept in {folder}; the same command resumes",
            highlight=False,
        )
        raise KeyboardInterrupt
    return _finish(options, folder, result, maps)


def _finish(options: EncodeOptions, folder: Path, result: RunResult, maps: MapChoice) -> int:
    if not result.stored and not result.failed:
        raise InputError(
            f"{options.source}: holds no texture to encode (constant images are factors and need no encoding)"
        )
    report = options.report or options.out.with_name(f"{options.out.name}{REPORT_SUFFIX}")
    write_report(report, result, folder, Reading(options.texture_size, maps, options.map_weights))
    if folder != options.out and result.stored:
        _write_joined(options.out, folder, result)
        if not result.failed:
            shutil.rmtree(folder, ignore_errors=True)
    lines = [*report_lines(result), f"report: {report / 'index.html'}"]
    if result.stored:
        lines.append(f"wrote {options.out}")
    sys.stdout.write("\n".join(lines) + "\n")
    return UNFINISHED if result.failed else 0


def _write_joined(out: Path, folder: Path, result: RunResult) -> None:
    """Write one pack of all that is stored, in the order of the textures."""
    index = read_index(folder)
    places = {each.texture.pixel_hash: number for number, each in enumerate(result.stored)}
    (settings,) = result.settings
    # In the order of the textures, whichever job ended first.
    shards = sorted(index.shards_with(places)[settings], key=lambda shard: min(map(places.__getitem__, shard[1])))
    pack = in_order(read_shards(index, shards), places)
    write_pack(out, pack)
