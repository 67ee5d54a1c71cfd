"""From argument strings to options; bad arguments become one line instead of tyro's box."""

import contextlib
import io
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import tyro

from ntc.errors import InputError
from viewer.commandline.options import (
    DecodeOptions,
    DoctorOptions,
    EncodeOptions,
    InfoOptions,
    RenderOptions,
    ViewOptions,
)
from viewer.pack_files import PACK_SUFFIX

Options = ViewOptions | RenderOptions | EncodeOptions | DecodeOptions | InfoOptions | DoctorOptions

_Subcommands = (
    Annotated[ViewOptions, tyro.conf.subcommand("view", prefix_name=False)]
    | Annotated[RenderOptions, tyro.conf.subcommand("render", prefix_name=False)]
    | Annotated[EncodeOptions, tyro.conf.subcommand("encode", prefix_name=False)]
    | Annotated[DecodeOptions, tyro.conf.subcommand("decode", prefix_name=False)]
    | Annotated[InfoOptions, tyro.conf.subcommand("info", prefix_name=False)]
    | Annotated[DoctorOptions, tyro.conf.subcommand("doctor", prefix_name=False)]
)
SUBCOMMANDS = ("view", "render", "encode", "decode", "info", "doctor")
DESCRIPTION = "See how a glTF scene looks, and what it costs, when its textures are decoded from neural latents."


def _with_subcommand(arguments: list[str]) -> list[str]:
    if arguments and (arguments[0] in SUBCOMMANDS or arguments[0] in ("-h", "--help")):
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
    try:
        with contextlib.redirect_stderr(complaint):
            options: Options = tyro.cli(
                _Subcommands,
                prog="ntc-viewer",
                description=DESCRIPTION,
                args=_with_packs_merged(_with_subcommand(list(arguments))),
            )
    except SystemExit as stopped:
        if stopped.code in (0, None):
            raise
        raise InputError(f"{_one_line(complaint.getvalue())} (see ntc-viewer --help)") from None
    return _with_scene_found(options)


def _with_scene_found(options: Options) -> Options:
    """A scene written behind `--pack F ...` was read as a pack: take it back."""
    if not isinstance(options, ViewOptions | RenderOptions) or options.scene is not None:
        return options
    scenes = [path for path in options.pack if path.suffix.lower() != PACK_SUFFIX]
    if len(scenes) != 1:
        return options
    return replace(options, scene=scenes[0], pack=tuple(path for path in options.pack if path != scenes[0]))
