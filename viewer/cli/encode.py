"""`ntc-viewer encode`: encode textures, show progress, write a pack and a PSNR table."""

import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

from ntc.codec.codec import Codec
from ntc.codec.config import UNIVERSAL, GroupingName
from ntc.codec.encoding import EncodingChoices, SizeTarget
from ntc.codec.maps import MAP_WEIGHTS, MapWeightsName
from ntc.codec.model import Pack
from ntc.codec.registry import chosen_codec, codec_named
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError, TrainingCancelledError
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from ntc.grouping.category import read_labels
from ntc.metrics.metrics import psnr_table
from ntc.pack.file import write_pack
from ntc.torch_device import peak_memory_bytes
from ntc.training.encode import encode_chosen
from ntc.training.messages import TrainingProgress
from viewer.cli.encode_jobs import encode_by_jobs, is_by_jobs
from viewer.cli.encode_target import encoding_choices, result_lines, worth_on_screen
from viewer.cli.interrupts import deferred_interrupt
from viewer.cli.options import EncodeOptions
from viewer.cli.sources import load_with_progress
from viewer.locations import features_cache, named_scene, packs_folder
from viewer.scene.images import folder_textures
from viewer.scene.json_text import counted
from viewer.scene.model import Scene
from viewer.scene.scene_files import PACK_SUFFIX
from viewer.scene.source_textures import MapChoice, reduce_texture, source_textures

BUILTIN_BITS = 2.1
"""Target of the packs of the built-in scene, in bits per texel of all mips (assets/build/packs.sh)."""
LINES_PER_RUN = 20
"""Progress lines of a whole run where standard error is no terminal."""


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
    """Raises InputError for options that the codec does not have."""
    choices = encoding_choices(options)
    for refusal in codec_named(_codec_name(options)).refusals(choices):
        raise InputError(refusal)


def _maps(options: EncodeOptions) -> MapChoice:
    """Return the maps that the options name, else the default of codec and grouping."""
    if options.maps is not None:
        return options.maps
    return codec_named(_codec_name(options)).default_maps if options.grouping != UNIVERSAL else "base"


def _codec_name(options: EncodeOptions) -> str:
    """Return the codec that the options name, else the first one that has all other options."""
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
    """Return the textures of a scene file or of a folder of images, reduced to `texture_size` texels: base colours, or whole
    material sets whose errors are worth `weights`. Raises InputError."""
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
    """Return the inputs of the grouping besides the textures. Raises InputError for files that cannot be read."""
    labels = read_labels(options.labels, source.textures) if options.labels is not None else {}
    features = FeatureOptions(cache=features_cache(), clip_weights=options.clip_weights)
    if options.grouping != "covisible":
        return GroupingInputs(labels=labels, features=features)
    return GroupingInputs(_views(source, options), labels, features)


def _views(source: Source, options: EncodeOptions) -> tuple[NDArray[np.int32], ...]:
    """Texture ids [H, W] of the views that are named. Raises InputError where there are none."""
    if source.scene is None:
        option = f"--views {options.views}" if options.grouping != "covisible" else "--grouping covisible"
        raise InputError(f"{option}: a folder of images has no viewpoints; encode a scene")
    # Nothing else here needs OpenGL.
    from viewer.viewpoints.scene_views import ViewSource, scene_views

    views = scene_views(source.scene, ViewSource(options.views, options.sampled_views, options.seed))
    if views.note:
        sys.stderr.write(f"note: {views.note}\n")
    # Textures without a base colour, which have the last ids, may be left out.
    return tuple(np.where(view < len(source.textures), view, -1) for view in views.all_then_release())


class _ProgressReport:
    """Progress with ETA: a live bar on a terminal, else about twenty lines in all."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._last_line = -1
        self._bar = Progress(
            TextColumn("encoding"),
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

    def __call__(self, progress: TrainingProgress) -> None:
        parts = [f"{progress.work} {progress.step}/{progress.steps}"]
        if progress.psnr_db:
            parts.append(f"PSNR {progress.mean_psnr_db:.2f} dB")
        status = "  ".join(
            [*parts, f"{progress.ktexels_per_second / 1e3:.2f} Mtexel/s  {progress.seconds_left:.0f} s left"]
        )
        if progress.note:
            self._console.print(progress.note, highlight=False)
        if self._console.is_terminal or not progress.note:
            self._show(progress.share, status)

    def _show(self, share: float, status: str) -> None:
        if self._console.is_terminal:
            self._bar.update(self._task, completed=share, status=status)
        elif int(share * LINES_PER_RUN) > self._last_line:
            self._last_line = int(share * LINES_PER_RUN)
            self._console.print(f"{share:4.0%}  {status}", highlight=False)


def encode(options: EncodeOptions) -> int:
    """Run `ntc-viewer encode`. Raises InputError for bad input."""
    _check(options)
    if is_by_jobs(options):
        return encode_by_jobs(options, _codec_name(options), _maps(options))
    codec, choices, pack, seconds = _encode(options)
    target = choices.target or codec.default_target
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
    """Encode a built-in scene in a grouping that does not ship, as those that do, and keep the pack in the user's data folder.

    Returns the path of the pack. Raises InputError, and KeyboardInterrupt after Ctrl-C.
    """
    out = packs_folder(scene_path) / f"{scene_path.stem}.{grouping}{PACK_SUFFIX}"
    sys.stderr.write(f"note: grouping {grouping} of {scene_path.stem} is encoded once and kept in {out}\n")
    _encode(EncodeOptions(scene_path, out, grouping=grouping, codec="block", bits=BUILTIN_BITS))
    return out


def _encode(options: EncodeOptions) -> tuple[Codec, EncodingChoices, Pack, float]:
    """Encode as `options` ask, and write the pack. Returns it with its codec, the choices and the seconds that it took.

    Raises InputError for bad input and for a target that cannot be reached, KeyboardInterrupt after Ctrl-C.
    """
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
        choices = replace(choices, target=replace(choices.target, worth=worth_on_screen(views, texels)))
    # Options that no codec but a later one has, with none named: the user may not know that it is another one.
    usual = chosen_codec(EncodingChoices())
    if options.codec is None and name != usual and choices.recipe == EncodingChoices().recipe:
        given = ", ".join(refusal.split()[0] for refusal in codec_named(usual).refusals(choices))
        console.print(f"note: {given}: trains codec {name}; without, codec {usual} encodes in seconds", highlight=False)
    codec = codec_named(name)
    how = f"recipe {choices.recipe}" if codec.trains else f"codec {name}"
    decoders = counted(grouping.group_count, "decoder")
    console.print(f"{counted(len(textures), 'texture')}, {decoders} ({grouping.name}), {how}", highlight=False)
    # Written where a training diverges to NaN.
    rescued_state = options.out.with_name(f"{options.out.name}.state")
    with _ProgressReport(console) as report:
        began = time.monotonic()
        with deferred_interrupt() as interrupted:
            try:
                pack = encode_chosen(textures, grouping, codec, choices, report, interrupted, rescued_state)
            except TrainingCancelledError:
                # What a shell expects of Ctrl-C.
                raise KeyboardInterrupt from None
            stopped = interrupted() and not codec.trains
    seconds = time.monotonic() - began
    write_or_rescue(options.out, pack)
    if stopped:
        console.print("note: stopped by Ctrl-C: textures are as they stand, not all corrected", highlight=False)
    return codec, choices, pack, seconds


def write_or_rescue(out: Path, pack: Pack) -> None:
    """Write `pack`; on failure write it to a temporary folder, as it may have taken hours. Raises InputError for both."""
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
    device = str(pack.training["device"])
    peak = peak_memory_bytes(torch.device(device))
    memory = f", at most {peak / 1e9:.2f} GB of memory" if peak is not None else ""
    return f"training: {counted(int(pack.training['steps']), 'step')} in {seconds:.0f} s on {device}{memory}"
