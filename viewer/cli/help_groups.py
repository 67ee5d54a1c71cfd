"""Help of commands at 80 columns: the usual options with examples in `--help`, all options in groups in `--help-all`."""

import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

HELP_ALL = "--help-all"
MOST_IN_GROUP = 10


@dataclass(frozen=True)
class HelpGroup:
    """Group of options for one task, with examples."""

    title: str
    options: tuple[str, ...]
    """Names without dashes, in the order of the help."""
    examples: tuple[str, ...]
    """Arguments of example commands, without the program's name."""


def _group(title: str, options: str, *examples: str) -> HelpGroup:
    return HelpGroup(title, tuple(options.split()), examples)


_TRAINING = _group("training", "scale steps texels-per-texture seeds device")
GROUPS: Mapping[str, Sequence[HelpGroup]] = {
    "view": (
        _group(
            "usual options",
            "pack grouping path precision filter size",
            "view street.glb --grouping clustered",
            "view street.glb --path auto",
        ),
        _group(
            "scripts and pictures",
            "script exec headless out",
            "view --headless --exec 'compare.mode wipe' --out d",
        ),
        _group("GPU", "device decoder-variant", "view street.glb --headless --device software"),
    ),
    "render": (
        _group(
            "usual options",
            "out size view pack grouping camera eye target overlay",
            "render street.glb --view lit --out d",
            "render street.glb --eye 3 2 8 --target 0 1 0 --out d",
            "render street.glb --overlay divergence --out d",
        ),
        _group(
            "camera and pose",
            "cameras fov animation time variant",
            "render street.glb --cameras c.json --camera door --out d",
        ),
        _group(
            "decoding",
            "path precision filter anisotropy decoder-variant device require-gpu",
            "render street.glb --pack a.ntc --path cached --out d",
        ),
        _group(
            "light",
            "environment sun sun-strength exposure tone-map",
            "render street.glb --view lit --environment studio --out d",
        ),
        _group(
            "maps and errors",
            "opacity palette block scale error-by-map aovs",
            "render street.glb --view lit --aovs --out d",
        ),
    ),
    "encode": (
        _group(
            "usual options",
            "out bits quality size preset grouping maps texture-size",
            "encode street.glb --bits 4",
            "encode street.glb --quality 38",
            "encode street.glb --size 20",
            "encode street.glb --preset fast",
            "encode photos --out photos.ntc",
        ),
        _group(
            "groups",
            "clusters features clip-weights labels views sampled-views spread-weight largest-share",
            "encode street.glb --grouping covisible --clusters 5",
        ),
        _group(
            "many textures, by jobs",
            "workers ray gpus-per-job decoders",
            "encode photos --workers 8 --out library",
            "encode new --decoders photos.ntc --out new.ntc",
        ),
        _group(
            "codec and training",
            "codec recipe steps epochs device state seed levels map-weights",
            "encode street.glb --codec grid --epochs 4",
        ),
    ),
    "export": (
        _group(
            "options",
            "out web shader as fallback pack",
            "export street.glb --out street.gltf",
            "export street.glb --as bc7 --out street.gltf",
            "export street.glb --web page",
            "export street.glb --shader hlsl --out decoder",
        ),
    ),
    "check": (
        _group(
            "usual options",
            "budget against out suggest pack grouping",
            "check street.glb --budget street.toml --out report",
            "check street.glb --against accepted/report.json",
        ),
        _group("what is measured", "views close cameras size device", "check street.glb --views 4"),
    ),
    "share": (
        _group(
            "usual options",
            "out codec groupings clusters steps bits texture-size seed",
            "share street.glb --out street-sharing",
            "share street.glb --clusters 2 4 --out d",
            "share street.glb --codec block --bits 2 --out d",
        ),
        _group("what is measured", "views size device gpu", "share street.glb --views path.json --out d"),
    ),
    "bench": (
        _group(
            "usual options",
            "pack paths views size thorough device json",
            "bench street.glb --json times.json",
            "bench street.glb --paths cached forward",
        ),
        _group(
            "what is timed",
            "what repeats precisions filters formats decoder-variant codec hidden-width decoders",
            "bench street.glb --formats bc7 astc-8x8",
        ),
        _group("memory", "memory-mb worst-sizes", "bench street.glb --memory-mb 64"),
    ),
    "study paper-textures": (
        _group("usual options", "out groupings clusters blocks texture-size levels"),
        _TRAINING,
    ),
    "study paper-scenes": (
        _group("usual options", "out groupings clusters more-clusters blocks texture-size levels"),
        _group("views", "views sampled-views size"),
        _TRAINING,
    ),
    "study rate": (
        _group("usual options", "out bits sides groupings clusters texture-size most grid-steps"),
        _group("other formats", "formats disk-formats jpeg-xl flip-every"),
    ),
}
"""Groups of options by command, the usual ones first. Other commands have few options and list them in one box."""
_INDENT, _WIDTH = 23, 78
"""Column where the text of an option begins, and the width of a line."""
_OPTION = re.compile(r"^ {1,3}(?:-h, )?--([a-z-]+)")


def help_entry(head: str, text: str) -> list[str]:
    """Return the lines of an entry of the help: its text beside `head`, or below a long one."""
    head = f"  {head}"
    text_lines = textwrap.wrap(text, _WIDTH - _INDENT, break_long_words=False, break_on_hyphens=False)
    first = [f"{head:{_INDENT}}{text_lines.pop(0)}"] if len(head) <= _INDENT - 2 and text_lines else [head]
    return [*first, *(" " * _INDENT + line for line in text_lines)]


def _option(lines: Sequence[str]) -> list[str]:
    """Return the lines of an option, with its text wrapped as one paragraph."""
    head, _, text = lines[0].strip().partition("  ")
    return help_entry(head, " ".join(" ".join([text, *lines[1:]]).split()))


def _explained(group: HelpGroup, rule: str, entries: Mapping[str, Sequence[str]]) -> list[str]:
    """Return the lines of a group: its title, its options with their texts, its examples."""
    shown = ["", f" {group.title}", rule]
    shown += [line for option in group.options for line in _option(entries[option])]
    return [*shown, *(f"  Example: ntc-viewer {example}" for example in group.examples)]


def grouped_help(text: str, command: str, everything: bool) -> str:
    """Return the help `text` of a command in lines of at most 80 columns, with the options in the command's groups.

    Without `everything`, only the usual options are explained; the others are listed by name.
    """
    lines = [
        part
        for line in text.splitlines()
        for part in (textwrap.wrap(line, _WIDTH, break_on_hyphens=False) if line[:1].strip() else [line.rstrip()])
    ]
    if command not in GROUPS or " options" not in lines:
        return "\n".join(lines) + "\n"
    title = lines.index(" options")
    rule, first = lines[title + 1], title + 2
    entries: dict[str, list[str]] = {}
    name = ""
    for line in filter(None, lines[first:]):
        match = _OPTION.match(line)
        name = match[1] if match else name
        entries.setdefault(name, []).append(line)
    usual, *others = GROUPS[command]
    shown = [*lines[: title - 1], *_explained(usual, rule, entries)]
    if everything:
        shown += [line for group in others for line in _explained(group, rule, entries)]
    elif others:
        shown += ["", f" more options: ntc-viewer {command} {HELP_ALL}", rule]
        for group in others:
            shown += help_entry(group.title, " ".join(f"--{option}" for option in group.options))
    return "\n".join(shown) + "\n"
