"""The options of long commands in groups, as `--help` shows them: by task, with an example each."""

import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

MOST_IN_GROUP = 10


@dataclass(frozen=True)
class HelpGroup:
    """Options that belong to one task."""

    title: str
    options: tuple[str, ...]
    """Names without dashes, in the order in which they are shown."""
    example: str
    """Arguments of an example, with the command."""


def _group(title: str, options: str, example: str) -> HelpGroup:
    return HelpGroup(title, tuple(options.split()), example)


GROUPS: Mapping[str, Sequence[HelpGroup]] = {
    "view": (
        _group("scene and packs", "pack grouping", "view street.glb --grouping clustered"),
        _group("decoding", "path precision filter decoder-variant device", "view street.glb --path auto"),
        _group(
            "scripts and pictures",
            "script exec headless out size",
            "view --headless --exec 'compare.mode split' --out d",
        ),
    ),
    "render": (
        _group("picture", "out size view aovs anisotropy require-gpu device", "render street.glb --view lit --out d"),
        _group(
            "camera and pose",
            "cameras camera eye target fov animation time variant",
            "render street.glb --eye 3 2 8 --target 0 1 0 --out d",
        ),
        _group(
            "decoding",
            "pack grouping path precision filter decoder-variant",
            "render street.glb --pack a.ntc --path cached --out d",
        ),
        _group(
            "light",
            "environment sun sun-strength exposure tone-map",
            "render street.glb --view lit --environment studio --out d",
        ),
        _group(
            "overlay",
            "overlay opacity palette block scale error-by-map",
            "render street.glb --overlay divergence --out d",
        ),
    ),
    "encode": (
        _group(
            "quality and size",
            "out bits quality size preset maps map-weights texture-size levels",
            "encode street.glb --quality 38",
        ),
        _group(
            "groups",
            "grouping clusters features clip-weights labels views sampled-views spread-weight largest-share",
            "encode street.glb --grouping universal",
        ),
        _group(
            "many textures, by jobs",
            "workers ray gpus-per-job report",
            "encode photos --workers 8 --out library",
        ),
        _group(
            "codec and training",
            "codec recipe steps epochs device state seed",
            "encode street.glb --codec grid --epochs 4",
        ),
    ),
    "check": (
        _group(
            "what is measured",
            "pack grouping views close cameras size device",
            "check street.glb --views 4",
        ),
        _group(
            "what is accepted",
            "budget against out suggest",
            "check street.glb --budget street.toml --out report",
        ),
    ),
    "bench": (
        _group(
            "what is timed",
            "pack what thorough size views repeats device json",
            "bench street.glb --json times.json",
        ),
        _group(
            "decoders and paths",
            "paths precisions filters formats decoder-variant codec hidden-width decoders",
            "bench street.glb --paths cached forward",
        ),
        _group("memory", "memory-mb worst-sizes", "bench street.glb --memory-mb 64"),
    ),
}
"""Groups by command. Shorter commands list their options in one box."""
_INDENT, _WIDTH = 23, 78
"""Column where the text of an option begins, and the width of a line."""
_OPTION = re.compile(r"^ {1,3}(?:-h, )?--([a-z-]+)")


def _wrapped(lines: Sequence[str]) -> list[str]:
    """Return the lines of an option with its text wrapped as one paragraph: the source's line breaks mean nothing."""
    head, _, text = lines[0].strip().partition("  ")
    head = f"  {head}"
    words = " ".join([text, *lines[1:]]).split()
    own = textwrap.wrap(" ".join(words), _WIDTH - _INDENT, break_long_words=False, break_on_hyphens=False)
    first = [f"{head:{_INDENT}}{own.pop(0)}"] if len(head) <= _INDENT - 2 and own else [head]
    return [*first, *(" " * _INDENT + line for line in own)]


def grouped_help(text: str, command: str) -> str:
    """Return the plain help `text` of a command with its list of options divided into its groups; as it is without groups."""
    lines = [line.rstrip() for line in text.splitlines()]
    if command not in GROUPS or " options" not in lines:
        return "\n".join(lines) + "\n"
    first = lines.index(" options") + 2
    entries: dict[str, list[str]] = {}
    name = ""
    for line in filter(None, lines[first:]):
        found = _OPTION.match(line)
        name = found[1] if found else name
        entries.setdefault(name, []).append(line)
    shown = [*lines[:first], *_wrapped(entries.pop("help"))]
    for group in GROUPS[command]:
        shown += ["", f" {group.title}", lines[first - 1]]
        shown += [line for option in group.options for line in _wrapped(entries.pop(option, [f"  --{option}"]))]
        shown += [f"  Example: ntc-viewer {group.example}"]
    return "\n".join([*shown, *(line for own in entries.values() for line in own)]) + "\n"
