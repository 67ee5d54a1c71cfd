"""Parsing of the command line into options; bad arguments become one line instead of tyro's box."""

import contextlib
import difflib
import functools
import importlib
import importlib.util
import io
import operator
import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Protocol, runtime_checkable

import tyro

import viewer
from ntc.errors import InputError
from ntc.library.index import is_library
from viewer.cli.help_groups import HELP_ALL, grouped_help, help_entry
from viewer.cli.options import SUBCOMMANDS, Subcommand
from viewer.locations import BUILTIN_SCENES
from viewer.scene.scene_files import PACK_SUFFIX

LAB_COMMANDS = "lab.commands"
"""Module of the research commands, with SUBCOMMANDS and STUDIES; the viewer also works where it is not installed."""
DESCRIPTION = (
    "See how a glTF scene looks, and what it costs, when its textures are decoded from neural latents. "
    "A SCENE without a command opens in the window. "
    "Each command has --help with its usual options, and --help-all. "
    "Measurements over many settings: ntc-viewer study NAME (see ntc-viewer study --help). "
    "Version: ntc-viewer --version. "
    "Completion in the shell: ntc-viewer --tyro-write-completion bash|zsh|fish FILE."
)
VERSION = "--version"
COMPLETION = ("--tyro-write-completion", "--tyro-print-completion")
SHELLS = ("bash", "zsh", "fish")
OUTPUTS = ("out", "web", "state", "json")
"""Names of options that hold the path of a file or folder to write, in all commands."""
REMOVED_OPTIONS = {
    ("study rate", "--workers"): "leave it out, points are measured one after the other",
    ("study rate", "--ray"): "leave it out, points are measured one after the other",
    ("encode", "--report"): "write a report with: ntc-viewer check F.ntc|LIBRARY --out DIR",
    ("library", "assign"): "encode with decoders of a pack: ntc-viewer encode SCENE --decoders F.ntc --out LIBRARY",
    ("library", "compact"): "leave it out, the index renews itself; delete damaged packs that verify names",
}
"""Options of earlier versions, by command and name, with what to do instead."""


@runtime_checkable
class SceneAndPacks(Protocol):
    """Options of the commands that open a scene with packs."""

    __dataclass_fields__: ClassVar[dict[str, Any]]
    scene: Path | None
    pack: tuple[Path, ...]


def _lab_commands() -> tuple[tuple[Subcommand, ...], tuple[Subcommand, ...]]:
    """Return (subcommands, studies) of the package `lab`; both empty where it is not installed."""
    if importlib.util.find_spec("lab") is None:
        return (), ()
    lab = importlib.import_module(LAB_COMMANDS)
    return lab.SUBCOMMANDS, lab.STUDIES


def _with_packs_merged(arguments: list[str]) -> list[str]:
    """Return `arguments` with the values of repeated --pack options behind one: `--pack a --pack b` means `--pack a b`."""
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
    """Return the message of tyro's error box: the lines above its inner rule, on one line."""
    text = re.sub(r"\x1b\[[0-9;]*m", "", box)
    lines = [line.strip().strip("│").strip() for line in text.splitlines()]
    lines = [line for line in lines if line and not line.startswith(("╭", "╰"))]
    rules = [number for number, line in enumerate(lines) if set(line) in ({"─"}, {"-"})]
    if rules[:1] == [1]:
        # Without UTF-8, tyro prints no box, but a title above a first rule.
        lines, rules = lines[2:], [number - 2 for number in rules[1:]]
    return " ".join(lines[: rules[0]] if rules else lines) or "the arguments could not be read"


def parse_arguments(arguments: Sequence[str]) -> tuple[Subcommand, Any]:
    """Return (command, its options) for `arguments` without the program's name. The default command is `view`.

    Raises InputError with one line for bad arguments, SystemExit(0) after printing help, the version or a completion script.
    """
    if arguments and arguments[0] == VERSION:
        sys.stdout.write(f"ntc-viewer {viewer.__version__}\n")
        raise SystemExit(0)
    lab_commands, studies = _lab_commands()
    commands = (*SUBCOMMANDS[:-1], *lab_commands, SUBCOMMANDS[-1])
    names = ("study", *(command.name for command in commands))
    named = bool(arguments) and arguments[0] in ("-h", "--help", HELP_ALL, *COMPLETION, *names)
    if arguments and not named:
        _refuse_unknown_command(arguments[0], names)
    if arguments and arguments[0] in COMPLETION:
        _check_completion(arguments)
    words = _with_packs_merged(list(arguments) if named else ["view", *arguments])
    _refuse_removed_options(words)
    everything, words = HELP_ALL in words, ["--help" if word == HELP_ALL else word for word in words]
    errors, printed = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(printed):
            if words[0] == "study":
                study = _study(words, studies)
                options = tyro.cli(study.options, prog=f"ntc-viewer study {study.name}", args=words[2:])
                return study, _checked(options)
            choices = (Annotated[c.options, tyro.conf.subcommand(c.name, prefix_name=False)] for c in commands)
            union: Any = functools.reduce(operator.or_, choices)
            options = tyro.cli(union, prog="ntc-viewer", description=DESCRIPTION, args=words)
    except SystemExit as stopped:
        if stopped.code in (0, None):
            command_words = " ".join(words[: 2 if words[0] == "study" else 1])
            sys.stdout.write(grouped_help(printed.getvalue(), command_words, everything))
            raise
        raise InputError(f"{_one_line(errors.getvalue())} (see ntc-viewer --help)") from None
    command = next(command for command in commands if command.options is type(options))
    return command, _checked(options)


def _refuse_unknown_command(word: str, names: Sequence[str]) -> None:
    """Refuse a first argument that can only be a mistyped command: a plain word that names no file and no scene. Raises InputError."""
    if word in BUILTIN_SCENES or not re.fullmatch(r"[A-Za-z][A-Za-z-]*", word) or Path(word).exists():
        return
    near = difflib.get_close_matches(word.lower(), names, n=1)
    remedy = f"did you mean {near[0]}?" if near else f"choose {', '.join(names)}, or name a scene"
    raise InputError(f"{word}: no such command, and no such file; {remedy}")


def _refuse_removed_options(words: Sequence[str]) -> None:
    """Refuse an option of an earlier version. `words` begin with the command. Raises InputError."""
    command = " ".join(words[: 2 if words[0] == "study" else 1])
    for number, word in enumerate(words):
        option = word.partition("=")[0]
        # A file may be called like a removed action, so only the word behind the command counts as one.
        if (remedy := REMOVED_OPTIONS.get((command, option))) and (number == 1 or option.startswith("--")):
            raise InputError(f"{command} {option}: the option was removed; {remedy}")


def _check_completion(arguments: Sequence[str]) -> None:
    """Refuse an unknown shell, and a completion file that cannot be written. Raises InputError."""
    shell = arguments[1] if len(arguments) > 1 else ""
    if shell not in SHELLS or (arguments[0] == COMPLETION[0]) != (len(arguments) > 2):
        raise InputError(f"{arguments[0]}: write ntc-viewer {COMPLETION[0]} {'|'.join(SHELLS)} FILE")
    if len(arguments) > 2:
        _require_folder(arguments[0], Path(arguments[2]))


def _checked(options: Any) -> Any:
    """Return `options` with the scene taken from --pack if it was written there. Raises InputError for a missing output folder."""
    for name in OUTPUTS:
        path = getattr(options, name, None)
        if isinstance(path, Path):
            _require_folder(f"--{name}", path)
    return _with_scene(options)


def _require_folder(option: str, path: Path) -> None:
    """Refuse an output `path` in a folder that does not exist. Raises InputError."""
    folder = path.parent
    if not folder.is_dir():
        problem = "is not a folder" if folder.exists() else "does not exist"
        raise InputError(f"{option} {path}: the folder {folder} {problem}; create it first, or correct the path")


def _study(words: list[str], studies: Sequence[Subcommand]) -> Subcommand:
    """Return the study that `words` name. Raises InputError for none and for an unknown one."""
    name = words[1] if len(words) > 1 else ""
    if name in ("-h", "--help"):
        sys.stdout.write("usage: ntc-viewer study NAME ...; each has --help\n")
        for study in studies:
            sys.stdout.write("\n".join(help_entry(study.name, (study.options.__doc__ or "").strip())) + "\n")
        raise SystemExit(0)
    for study in studies:
        if study.name == name:
            return study
    raise InputError(f"study {name}: no such study (there are: {', '.join(study.name for study in studies)})")


def _with_scene(options: Any) -> Any:
    """Return `options` with the scene that follows `--pack F ...` moved from the packs, where tyro has put it, to the scene."""
    if not isinstance(options, SceneAndPacks) or options.scene is not None:
        return options
    scenes = [path for path in options.pack if path.suffix.lower() != PACK_SUFFIX and not is_library(path)]
    if len(scenes) != 1:
        return options
    return replace(options, scene=scenes[0], pack=tuple(path for path in options.pack if path != scenes[0]))
