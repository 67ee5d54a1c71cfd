"""From argument strings to options; bad arguments become one line instead of tyro's box."""

import contextlib
import io
import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import tyro

from lab.commands.bench_options import BenchOptions
from lab.commands.study_options import (
    AblationStudyOptions,
    ClusterStudyOptions,
    FilteringStudyOptions,
    FreezingStudyOptions,
    MipStudyOptions,
    MlpSizeStudyOptions,
    PaperScenesOptions,
    PaperStudyOptions,
    RecipeStudyOptions,
    StabilityStudyOptions,
)
from ntc.errors import InputError
from viewer.cli.options import (
    DecodeOptions,
    DoctorOptions,
    EncodeOptions,
    InfoOptions,
    RenderOptions,
    ViewOptions,
)
from viewer.state.pack_files import PACK_SUFFIX

StudyOptions = (
    ClusterStudyOptions
    | FilteringStudyOptions
    | StabilityStudyOptions
    | RecipeStudyOptions
    | PaperStudyOptions
    | PaperScenesOptions
)
Options = (
    ViewOptions
    | RenderOptions
    | EncodeOptions
    | DecodeOptions
    | InfoOptions
    | BenchOptions
    | DoctorOptions
    | StudyOptions
)

_Subcommands = (
    Annotated[ViewOptions, tyro.conf.subcommand("view", prefix_name=False)]
    | Annotated[RenderOptions, tyro.conf.subcommand("render", prefix_name=False)]
    | Annotated[EncodeOptions, tyro.conf.subcommand("encode", prefix_name=False)]
    | Annotated[DecodeOptions, tyro.conf.subcommand("decode", prefix_name=False)]
    | Annotated[InfoOptions, tyro.conf.subcommand("info", prefix_name=False)]
    | Annotated[BenchOptions, tyro.conf.subcommand("bench", prefix_name=False)]
    | Annotated[DoctorOptions, tyro.conf.subcommand("doctor", prefix_name=False)]
)
SUBCOMMANDS = ("view", "render", "encode", "decode", "info", "bench", "doctor")
STUDIES: dict[str, type[StudyOptions]] = {
    "clusters": ClusterStudyOptions,
    "filtering": FilteringStudyOptions,
    "paper-textures": PaperStudyOptions,
    "paper-scenes": PaperScenesOptions,
    "freezing": FreezingStudyOptions,
    "mlp-size": MlpSizeStudyOptions,
    "mips": MipStudyOptions,
    "ablation": AblationStudyOptions,
    "stability": StabilityStudyOptions,
}
"""Options by the name of the study: each has settings of its own."""
DESCRIPTION = (
    "See how a glTF scene looks, and what it costs, when its textures are decoded from neural latents. "
    "Measurements over many settings: ntc-viewer study NAME (see ntc-viewer study --help)."
)


def _with_subcommand(arguments: list[str]) -> list[str]:
    if arguments and (arguments[0] in SUBCOMMANDS or arguments[0] in ("-h", "--help", "study")):
        return arguments
    return ["view", *arguments]


def _with_packs_merged(arguments: list[str]) -> list[str]:
    """Gather the values of repeated --pack options behind one, so that `--pack a --pack b` means `--pack a b`."""
    packs: list[str] = []
    rest: list[str] = []
    collecting = False
    for argument in arguments:
        if argument == "--pack":
            collecting = True
        elif argument.startswith("--pack="):
            packs.append(argument.removeprefix("--pack="))
        elif collecting and not argument.startswith("-"):
            packs.append(argument)
        else:
            collecting = False
            rest.append(argument)
    return [*rest, "--pack", *packs] if packs else rest


def _one_line(box: str) -> str:
    """The message of tyro's error box: the lines above its inner rule, on one line."""
    text = re.sub(r"\x1b\[[0-9;]*m", "", box)
    lines: list[str] = []
    for line in text.splitlines():
        stripped = line.strip().strip("│").strip()
        if stripped.startswith(("╭", "╰")) or not stripped:
            continue
        if set(stripped) == {"─"}:
            break
        lines.append(stripped)
    return " ".join(lines) or "the arguments could not be read"


def parse_arguments(arguments: Sequence[str]) -> Options:
    """Options for `arguments` (without the program name). Without a subcommand, `view` is meant.

    Raises InputError with one line for bad arguments, SystemExit(0) after printing help.
    """
    complaint = io.StringIO()
    words = _with_packs_merged(_with_subcommand(list(arguments)))
    try:
        with contextlib.redirect_stderr(complaint):
            options: Options
            if words[0] == "study":
                options = tyro.cli(_study(words), prog=f"ntc-viewer study {words[1]}", args=words[2:])
            else:
                options = tyro.cli(_Subcommands, prog="ntc-viewer", description=DESCRIPTION, args=words)
    except SystemExit as stopped:
        if stopped.code in (0, None):
            raise
        raise InputError(f"{_one_line(complaint.getvalue())} (see ntc-viewer --help)") from None
    return _with_scene_found(options)


def _study(words: list[str]) -> type[StudyOptions]:
    """Options of the study that is named. Raises InputError for none and for one that there is not."""
    name = words[1] if len(words) > 1 else ""
    if name in ("-h", "--help"):
        summaries = (f"  {study:15} {(options.__doc__ or '').strip()}" for study, options in STUDIES.items())
        sys.stdout.write("\n".join(["usage: ntc-viewer study NAME ...; each has --help", *summaries]) + "\n")
        raise SystemExit(0)
    if name not in STUDIES:
        raise InputError(f"study {name}: no such study (there are: {', '.join(STUDIES)})")
    return STUDIES[name]


def _with_scene_found(options: Options) -> Options:
    """A scene written behind `--pack F ...` was read as a pack: take it back."""
    if (
        not isinstance(
            options,
            ViewOptions
            | RenderOptions
            | BenchOptions
            | ClusterStudyOptions
            | FilteringStudyOptions
            | StabilityStudyOptions,
        )
        or options.scene is not None
    ):
        return options
    scenes = [path for path in options.pack if path.suffix.lower() != PACK_SUFFIX]
    if len(scenes) != 1:
        return options
    return replace(options, scene=scenes[0], pack=tuple(path for path in options.pack if path != scenes[0]))
