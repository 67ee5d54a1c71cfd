"""`ntc-viewer encode`: encodes textures into a pack in this process, or by jobs into a library or a pack."""

import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import FrameType

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from ntc.codec.codec import Codec
from ntc.codec.config import GroupingName
from ntc.codec.encoding import PRESETS, BitsTarget, CancelQuestion, EncodingChoices, QualityTarget, SizeTarget, Target
from ntc.codec.maps import BASE_ALONE, MAP_WEIGHTS, MapWeightsName
from ntc.codec.model import Pack
from ntc.codec.registry import chosen_codec, codec_named
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError, TrainingCancelledError
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from ntc.grouping.category import read_labels
from ntc.io import numbered_path
from ntc.library.index import Library
from ntc.library.joining import in_order, joined_textures
from ntc.metrics.metrics import bits_with_mips, psnr_table
from ntc.pack.file import read_metadata, write_pack
from ntc.threads import usable_cores
from ntc.training.compiling import CompilingAhead
from ntc.training.encode import chosen_request, encode_request
from ntc.training.messages import TrainingProgress
from viewer.cli.options import EncodeOptions
from viewer.cli.progress import TerminalProgress
from viewer.cli.sources import load_with_progress
from viewer.encoding.report import report_lines
from viewer.encoding.whole_run import EncodeRequest, RunProgress, RunResult, encode_to_library
from viewer.encoding.work import LIST_SUFFIX, ReadOptions, WorkJob, WorkResult, texture_refs, work
from viewer.jobs.executor import Workers, local_workers, ray_workers
from viewer.locations import cache_folder, named_scene, packs_folder
from viewer.scene.images import folder_textures
from viewer.scene.json_text import counted
from viewer.scene.model import Scene
from viewer.scene.scene_files import PACK_SUFFIX, scene_file
from viewer.scene.source_textures import MapChoice, reduce_texture, source_textures

JOBS_SUFFIX = ".jobs"
"""Suffix of the library beside a pack that holds finished jobs until the pack is written."""
SET_BY_DECODERS = (
    "bits",
    "quality",
    "size",
    "preset",
    "grouping",
    "clusters",
    "labels",
    "codec",
    "recipe",
    "steps",
    "epochs",
    "levels",
)
"""Options that the pack of --decoders sets."""
UNFINISHED = 1
"""Exit status where textures are missing."""


def is_by_jobs(options: EncodeOptions) -> bool:
    """Return whether jobs encode the textures: an option asks for jobs, or the source or output needs them."""
    asked = any(each is not None for each in (options.workers, options.ray, options.decoders))
    return asked or options.out.suffix != PACK_SUFFIX or options.source.suffix.lower() == LIST_SUFFIX


def _check_jobs(options: EncodeOptions) -> None:
    if options.ray is not None and options.workers is not None:
        raise InputError("--workers and --ray exclude each other: a cluster has as many workers as it has cores")
    if options.gpus_per_job < 0.0:
        raise InputError(f"--gpus-per-job {options.gpus_per_job:g}: must be 0 or more")
    for name in ("state", "views", "sampled_views"):
        if getattr(options, name) is not None:
            raise InputError(
                f"--{name.replace('_', '-')}: is not for jobs; leave it out, or leave --workers and --ray out"
            )
    for name in SET_BY_DECODERS if options.decoders is not None else ():
        if getattr(options, name) != getattr(EncodeOptions, name):
            raise InputError(f"--{name}: is set by the pack of --decoders {options.decoders}; leave one of them out")


def _encode_request(options: EncodeOptions, codec: str, maps: MapChoice) -> EncodeRequest:
    choices = encoding_choices(options)
    if choices.target is not None and not isinstance(choices.target, BitsTarget):
        name = "quality" if options.quality is not None else "size"
        raise InputError(f"--{name}: needs all textures at once; ask for --bits, or leave --workers and --ray out")
    reading = ReadOptions(options.texture_size, maps, options.map_weights)
    one_pack = options.out.suffix == PACK_SUFFIX
    grouping = options.grouping_config()
    # Workers may run in another folder.
    decoders = options.decoders.absolute() if options.decoders is not None else None
    return EncodeRequest(reading, grouping, codec, choices, options.labels, one_pack, decoders)


def _workers(options: EncodeOptions) -> AbstractContextManager[Workers[WorkJob, WorkResult]]:
    if options.ray is not None:
        return ray_workers(work, options.ray, options.gpus_per_job)
    return local_workers(work, usable_cores() if options.workers is None else options.workers)


def encode_by_jobs(options: EncodeOptions, codec: str, maps: MapChoice) -> int:
    """Run `ntc-viewer encode` by jobs. Raises InputError for bad input, KeyboardInterrupt after Ctrl-C.

    The exit status is 1 where textures could not be encoded; they are listed.
    """
    _check_jobs(options)
    request = _encode_request(options, codec, maps)
    refs = texture_refs(options.source, maps)
    console = Console(stderr=True, soft_wrap=True)
    folder = options.out.with_name(f"{options.out.name}{JOBS_SUFFIX}") if request.one_pack else options.out
    with _workers(options) as workers:
        how = f"codec {codec}, {options.grouping}" if options.decoders is None else f"decoders of {options.decoders}"
        console.print(f"{counted(len(refs), 'texture')}, {workers.slots()} at a time, {how}", highlight=False)
        with _EncodingProgress() as report, deferred_interrupt() as interrupted:
            result = encode_to_library(request, refs, workers, folder, report.of_jobs, interrupted)
    if result.stopped:
        console.print(
            f"stopped: {counted(len(result.stored), 'texture')} saved in {folder}; the same command resumes",
            highlight=False,
        )
        raise KeyboardInterrupt
    return _finish(options, folder, result)


def _finish(options: EncodeOptions, folder: Path, result: RunResult) -> int:
    if not result.stored and not result.failed:
        raise InputError(
            f"{options.source}: holds no texture to encode (constant images are factors and need no encoding)"
        )
    if folder != options.out and result.stored:
        _write_joined(options.out, folder, result)
        if not result.failed:
            shutil.rmtree(folder, ignore_errors=True)
    lines = report_lines(result)
    if result.stored:
        lines.append(f"wrote {options.out}")
    sys.stdout.write("\n".join(lines) + "\n")
    return UNFINISHED if result.failed else 0


def _write_joined(out: Path, folder: Path, result: RunResult) -> None:
    """Write one pack of all textures that the jobs stored, in the order of the textures."""
    places = {each.texture.pixel_hash: number for number, each in enumerate(result.stored)}
    (settings,) = result.settings
    packs = Library(folder).packs_with(places)[settings]
    # Packs in the order of their textures, not in the order in which jobs ended.
    first = sorted(packs, key=lambda name: min(map(places.__getitem__, packs[name])))
    write_pack(out, in_order(joined_textures(folder, {name: packs[name] for name in first}), places))


MOST_NAMES = 5
"""Most textures that a message names where a quality was not reached."""
BITS_TOLERANCE = 0.02
"""Share of the target bitrate that it may be exceeded by."""
LEAST_WEIGHT = 0.1
"""Weight of a texture that no view shows, as a share of the mean."""


def given_targets(options: EncodeOptions) -> dict[str, str]:
    """Return the target options that are given, by name."""
    numbers = {"bits": options.bits, "size": options.size}
    given = {name: f"{value:g}" for name, value in numbers.items() if value is not None}
    if options.quality is not None:
        given["quality"] = str(options.quality)
    return given if options.preset is None else {**given, "preset": options.preset}


def asked_target(options: EncodeOptions) -> Target | None:
    """Return the target that the options name. Raises InputError for two targets, and for one that can never be reached."""
    given = list(given_targets(options))
    if len(given) > 1:
        raise InputError(f"{' and '.join(f'--{name}' for name in given)} exclude each other: give one of them")
    if options.quality is not None:
        return QualityTarget(options.quality.value)
    if options.size is not None:
        return SizeTarget(options.size)
    if options.preset is not None:
        return PRESETS[options.preset]
    return None if options.bits is None else BitsTarget(options.bits)


def encoding_choices(options: EncodeOptions) -> EncodingChoices:
    """Return the options of the codec. Raises InputError as `asked_target` does."""
    return EncodingChoices(
        options.recipe,
        options.steps,
        options.epochs,
        options.device,
        options.state,
        asked_target(options),
        options.levels,
        options.seed,
    )


def screen_weights(views: Sequence[NDArray[np.int32]], texels: Sequence[int]) -> tuple[float, ...]:
    """Return the weight of errors in each texture: its pixels per texel in `views`, over the mean of all textures.

    `views`: [H, W] texture ids, -1 for none. `texels`: number of texels, by texture. Weights are at least LEAST_WEIGHT.
    """
    pixels = np.zeros(len(texels))
    for view in views:
        pixels += np.bincount(view[view >= 0].reshape(-1), minlength=len(texels))[: len(texels)]
    shown = pixels / np.array(texels, np.float64)
    weights = np.maximum(shown / max(float(shown.mean()), 1e-12), LEAST_WEIGHT)
    return tuple(weights.tolist())


def result_lines(target: Target, pack: Pack, out: Path) -> list[str]:
    """Return lines that compare the target with `pack`, written to `out`."""
    if isinstance(target, BitsTarget):
        more = bits_with_mips(pack) > target.bits * (1.0 + BITS_TOLERANCE)
        why = "; not reached: so few or so small textures need more" if more else ""
        return [f"target: {target.bits:g} bits per texel of mip 0{why}"]
    if isinstance(target, SizeTarget):
        return [f"file: {out.stat().st_size / 1e6:.3f} MB, asked for at most {target.megabytes:g}"]
    short = [each for each in pack.textures if each.psnr_db is not None and each.psnr_db < target.psnr_db]
    reached = len(pack.textures) - len(short)
    lines = [
        f"quality: {reached} of {counted(len(pack.textures), 'texture')} have at least {target.psnr_db:g} dB, as asked"
    ]
    if short:
        short.sort(key=lambda each: each.psnr_db or 0.0)
        names = ", ".join(f"{each.name} ({each.psnr_db:.2f} dB)" for each in short[:MOST_NAMES])
        others = f" and {len(short) - MOST_NAMES} more" if len(short) > MOST_NAMES else ""
        lines.append(f"not reached: {names}{others}")
    return lines


@contextmanager
def deferred_interrupt() -> Iterator[Callable[[], bool]]:
    """Yield a function that returns whether Ctrl-C was pressed in the block; a second Ctrl-C interrupts at once.

    Off the main thread, where Python delivers no signals, it always returns False.
    """
    pressed = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield pressed.is_set
        return
    before = signal.getsignal(signal.SIGINT)

    def handle(_number: int, _frame: FrameType | None) -> None:
        if pressed.is_set():
            raise KeyboardInterrupt
        pressed.set()

    signal.signal(signal.SIGINT, handle)
    try:
        yield pressed.is_set
    finally:
        signal.signal(signal.SIGINT, before)


BUILTIN_BITS = 2.8
"""Target of the packs of the built-in scene, in bits per texel of mip 0 (assets/build/packs.sh)."""


def _check(options: EncodeOptions) -> None:
    if options.out.suffix == PACK_SUFFIX and options.out.is_dir():
        raise InputError(f"--out {options.out}: is a folder; name a file")
    if options.out.suffix not in ("", PACK_SUFFIX) and not options.out.is_dir():
        raise InputError(
            f"--out {options.out}: a pack's name ends in {PACK_SUFFIX}, that of a library's folder in nothing"
        )
    if options.steps is not None and options.epochs is not None:
        raise InputError("--steps and --epochs exclude each other: give one of them")
    for name, value in (("steps", options.steps), ("epochs", options.epochs), ("texture-size", options.texture_size)):
        if value is not None and value <= 0:
            raise InputError(f"--{name} {value}: must be positive")
    if options.views is not None and options.grouping != "covisible" and options.size is None:
        raise InputError(f"--views {options.views}: only --grouping covisible and --size take it")
    for option, given, grouping in (
        ("sampled-views", options.sampled_views, "covisible"),
        ("labels", options.labels, "category"),
    ):
        if given is not None and options.grouping != grouping:
            raise InputError(f"--{option} {given}: only --grouping {grouping} takes it")
    _check_codec(options)
    if options.levels is not None and not 1 <= options.levels <= 16:
        raise InputError(f"--levels {options.levels}: must be 1 to 16")


def _check_codec(options: EncodeOptions) -> None:
    """Refuse options that the codec does not have. Raises InputError."""
    choices = encoding_choices(options)
    for refusal in codec_named(_codec_name(options)).refusals(choices):
        raise InputError(refusal)


def _maps(options: EncodeOptions) -> MapChoice:
    """Return the maps that the options name, else those of the pack with the decoders or the default of the codec."""
    if options.maps is None and options.decoders is not None:
        return "base" if read_metadata(options.decoders).codec.maps == BASE_ALONE else "all"
    return options.maps or codec_named(_codec_name(options)).default_maps


def _codec_name(options: EncodeOptions) -> str:
    """Return the codec that the options name, else the first codec that has all given options."""
    return options.codec or chosen_codec(encoding_choices(options))


@dataclass(frozen=True)
class Source:
    """The textures to encode."""

    textures: tuple[SourceTexture, ...]
    scene: Scene | None
    """Scene that holds the textures; None for a folder of images."""


def read_source(
    source: Path,
    texture_size: int | None,
    maps: MapChoice = "base",
    weights: MapWeightsName = EncodeOptions.map_weights,
) -> Source:
    """Return the textures of a scene file or of a folder of images, reduced to `texture_size` texels a side: base colours, or whole
    material sets with the weights `weights` of errors in their maps. Raises InputError."""
    scene = None
    if source.is_dir():
        textures = folder_textures(source)
        if texture_size is not None:
            textures = tuple(reduce_texture(texture, texture_size) for texture in textures)
    else:
        scene = load_with_progress(named_scene(source))
        chosen = MAP_WEIGHTS[weights]
        textures = tuple(replace(each, map_weights=chosen) for each in source_textures(scene, texture_size, maps))
    if not textures:
        raise InputError(f"{source}: holds no texture to encode (constant images are factors and need no encoding)")
    return Source(textures, scene)


def grouping_inputs(source: Source, options: EncodeOptions) -> GroupingInputs:
    """Return the inputs of the grouping, without the textures. Raises InputError for files that cannot be read."""
    labels = read_labels(options.labels, source.textures) if options.labels is not None else {}
    features = FeatureOptions(cache=cache_folder("features"), clip_weights=options.clip_weights)
    if options.grouping != "covisible":
        return GroupingInputs(labels=labels, features=features)
    return GroupingInputs(_views(source, options), labels, features)


def _views(source: Source, options: EncodeOptions) -> tuple[NDArray[np.int32], ...]:
    """Return the texture ids [H, W] of the views that the options name. Raises InputError where there are none."""
    if source.scene is None:
        option = f"--views {options.views}" if options.grouping != "covisible" else "--grouping covisible"
        raise InputError(f"{option}: a folder of images has no viewpoints; encode a scene")
    # Imported late, because nothing else here needs OpenGL.
    from viewer.viewpoints.scene_views import ViewSource, scene_views

    views = scene_views(source.scene, ViewSource(options.views, options.sampled_views, options.seed))
    if views.note:
        sys.stderr.write(f"note: {views.note}\n")
    return views.all_then_release(len(source.textures))


class _EncodingProgress(TerminalProgress):
    """Progress of an encoding."""

    def __init__(self) -> None:
        super().__init__("encoding", lines=True)

    def of_training(self, progress: TrainingProgress) -> None:
        """Show the progress of an encoding in this process."""
        if not progress.steps:
            self.show(progress.share, progress.work)
            return
        quality = f"  PSNR {progress.mean_psnr_db:.2f} dB" if progress.psnr_db else ""
        rate = f"{progress.ktexels_per_second / 1e3:.2f} Mtexel/s"
        if progress.note:
            self.print(progress.note)
        if self.console.is_terminal or not progress.note:
            self.show(progress.share, f"{progress.phase}{quality}  {rate}")

    def of_jobs(self, progress: RunProgress) -> None:
        """Show the progress over all jobs."""
        if progress.note:
            self.print(f"tried again: {progress.note}")
            return
        speed = progress.texels_per_second
        rate = f"{speed / 1e6:.2f} Mtexel/s" if progress.phase == "encoding" else f"{speed:.1f} images/s"
        failed = f", {progress.failures} failed" if progress.failures else ""
        status = f"{progress.done}/{progress.of} textures{failed}  {rate}"
        self.show(progress.share, status, progress.phase)


def encode(options: EncodeOptions) -> int:
    """Run `ntc-viewer encode`. Raises InputError for bad input."""
    if options.out == Path():
        options = replace(options, out=default_out(options))
    _check(options)
    if options.quality is not None and options.quality.unit == "JOD":
        # Imported late, because it draws and needs OpenGL.
        from viewer.cli.encode_to_jod import encode_to_jod

        return encode_to_jod(options, options.quality.value, _encode)
    if is_by_jobs(options):
        return encode_by_jobs(options, _codec_name(options), _maps(options))
    codec, choices, pack, seconds = _encode(options)
    target = choices.target or codec.target_of(pack.config.maps)
    lines = [
        *psnr_table(pack).lines(),
        *codec.settings_lines(pack.config),
        *([] if target is None else result_lines(target, pack, options.out)),
        _effort(pack, seconds) if codec.trains else f"encoding: {seconds:.1f} s on cpu",
        f"wrote {options.out}",
    ]
    sys.stdout.write("\n".join(lines) + "\n")
    return 0


def encode_builtin(scene_path: Path, grouping: GroupingName) -> Path:
    """Encode a built-in scene in a grouping that is not installed, into the user's data folder, and return the path of the pack.

    Settings are those of the installed packs. Raises InputError, and KeyboardInterrupt after Ctrl-C.
    """
    out = packs_folder(scene_path) / f"{scene_path.stem}.{grouping}{PACK_SUFFIX}"
    sys.stderr.write(f"note: grouping {grouping} of {scene_path.stem} is encoded once and kept in {out}\n")
    _encode(EncodeOptions(scene_path, out, grouping=grouping, codec="block", bits=BUILTIN_BITS))
    return out


def default_out(options: EncodeOptions) -> Path:
    """Return the path of the pack where --out is left out: a new file beside the scene or folder, as in the window.

    Raises InputError for a list of images.
    """
    source = options.source
    if source.suffix.lower() == LIST_SUFFIX:
        raise InputError(f"{source}: a list of images has no folder for the pack; name a pack or a library with --out")
    if source.is_dir():
        return numbered_path(source.absolute().parent / f"{source.absolute().name}.{options.grouping}{PACK_SUFFIX}")
    scene = scene_file(named_scene(source))
    return numbered_path(packs_folder(scene) / f"{scene.stem}.{options.grouping}{PACK_SUFFIX}")


def _encode(options: EncodeOptions) -> tuple[Codec, EncodingChoices, Pack, float]:
    """Encode the textures that `options` name, and write the pack. Returns (codec, its options, pack, seconds).

    Raises InputError for bad input and for a target that cannot be reached, KeyboardInterrupt after Ctrl-C.
    """
    # The codec compiles while the scene is read.
    with CompilingAhead(codec_named(_codec_name(options))) as compiling:
        return _encode_compiled(options, compiling)


def _encode_compiled(options: EncodeOptions, compiling: CompilingAhead) -> tuple[Codec, EncodingChoices, Pack, float]:
    """Do the work of `_encode` with the codec that `compiling` compiles."""
    name = _codec_name(options)
    console = Console(stderr=True, soft_wrap=True)
    source = read_source(options.source, options.texture_size, _maps(options), options.map_weights)
    textures = source.textures
    inputs = grouping_inputs(source, options)
    grouping = make_grouping(options.grouping_config(), textures, inputs)
    choices = encoding_choices(options)
    if isinstance(choices.target, SizeTarget) and options.views is not None:
        texels = [width * height for width, height in (texture.size for texture in textures)]
        views = inputs.views or _views(source, options)
        choices = replace(choices, target=replace(choices.target, worth=screen_weights(views, texels)))
    # An option may select another codec than the usual one. The user should know, because it takes much longer.
    usual = chosen_codec(EncodingChoices())
    if options.codec is None and name != usual and choices.recipe == EncodingChoices().recipe:
        given = ", ".join(refusal.split()[0] for refusal in codec_named(usual).refusals(choices))
        console.print(f"note: {given}: trains codec {name}; without, codec {usual} encodes in seconds", highlight=False)
    codec = codec_named(name)
    how = f"recipe {choices.recipe}" if codec.trains else f"codec {name}"
    decoders = counted(grouping.group_count, "decoder")
    console.print(f"{counted(len(textures), 'texture')}, {decoders} ({grouping.name}), {how}", highlight=False)
    # The trainer writes this file if the training diverges to NaN.
    rescued_state = options.out.with_name(f"{options.out.name}.state")
    request = chosen_request(textures, grouping, codec, choices)
    with _EncodingProgress() as report, deferred_interrupt() as interrupted:
        try:
            compiling.wait(report.of_training, partial(_check_interrupt, interrupted))
            began = time.monotonic()
            pack = encode_request(request, report.of_training, interrupted, choices.state, rescued_state)
        except TrainingCancelledError:
            # The exit status of Ctrl-C that shells expect.
            raise KeyboardInterrupt from None
        stopped = interrupted() and not codec.trains
    seconds = time.monotonic() - began
    write_or_rescue(options.out, pack)
    if stopped:
        console.print("note: stopped by Ctrl-C: not all textures have been refined", highlight=False)
    return codec, choices, pack, seconds


def _check_interrupt(interrupted: CancelQuestion) -> None:
    if interrupted():
        raise TrainingCancelledError


def write_or_rescue(out: Path, pack: Pack) -> None:
    """Write `pack` to `out`. On failure it is written to a temporary folder, because it may have taken hours. Raises InputError
    in both cases."""
    try:
        write_pack(out, pack)
    except InputError as error:
        spare = Path(tempfile.mkdtemp(prefix="ntc-viewer-")) / out.name
        try:
            write_pack(spare, pack)
        except InputError:
            raise error from None
        raise InputError(f"{error}; the pack is in {spare} instead") from error


def _effort(pack: Pack, seconds: float) -> str:
    import torch

    from ntc.torch_device import peak_memory_bytes

    device = str(pack.training["device"])
    peak = peak_memory_bytes(torch.device(device))
    memory = f", at most {peak / 1e9:.2f} GB of memory" if peak is not None else ""
    return f"training: {counted(int(pack.training['steps']), 'step')} in {seconds:.0f} s on {device}{memory}"
