"""Declarations of an assembled shader, with its `#if`s resolved: enough of a preprocessor to need no compiler."""

import re
from dataclasses import dataclass
from typing import Final, Literal

Kind = Literal["storage", "uniform block", "sampler", "image", "output"]

_LINE: Final = re.compile(
    r"^[ \t]*#[ \t]*(define|undef|if|ifdef|ifndef|elif|else|endif)\b[ \t]*(.*)$|^[ \t]*(layout\b.*)$", re.MULTILINE
)
_LAYOUT: Final = re.compile(r"layout\s*\(([^)]*)\)\s*(.*)")
_NUMBER: Final = re.compile(r"\b(?:binding|location)\s*=\s*(\w+)")
_NAME: Final = re.compile(r"\b[A-Za-z_]\w*\b")


@dataclass(frozen=True)
class Declaration:
    """Declaration with `layout(...)` that takes one number."""

    kind: Kind
    number: int
    """Its binding, or the location of an output."""
    text: str
    """Type and name."""


def _value(expression: str, defines: dict[str, str]) -> int:
    """Return the value of a `#if`'s expression, or of a macro."""
    expression = re.sub(r"//.*", "", expression)
    expression = re.sub(r"defined\s*\(?\s*(\w+)\s*\)?", lambda match: str(int(match[1] in defines)), expression)
    for _ in range(8):
        replaced = _NAME.sub(lambda match: f"({defines.get(match[0], '0').rstrip('u') or '0'})", expression)
        if replaced == expression:
            break
        expression = replaced
    expression = expression.replace("&&", " and ").replace("||", " or ")
    expression = re.sub(r"!(?!=)", " not ", expression)
    return int(eval(expression, {"__builtins__": {}}))


def _kind(text: str) -> Kind | None:
    head = text.split("{", maxsplit=1)[0]
    if re.search(r"\bbuffer\b", head):
        return "storage"
    if "sampler" in head:
        return "sampler"
    if re.search(r"\b[ui]?image\w+\b", head):
        return "image"
    if re.match(r"out\b", head):
        return "output"
    return "uniform block" if "{" in text else None


def declarations(text: str) -> tuple[Declaration, ...]:
    """Storage and uniform blocks, samplers, images and outputs with numbers that a compiler would see in `text`."""
    defines: dict[str, str] = {}
    listed: list[Declaration] = []
    branches: list[tuple[bool, bool]] = []
    """Of each open `#if`: whether its present branch is read, and whether some branch of it has been."""
    for match in _LINE.finditer(text):
        directive, rest, layout = match[1], match[2], match[3]
        reading = all(now for now, _ in branches)
        if directive in ("if", "ifdef", "ifndef"):
            if not reading:
                holds = False
            elif directive == "if":
                holds = bool(_value(rest, defines))
            else:
                holds = (rest.split()[0] in defines) == (directive == "ifdef")
            branches.append((holds, holds))
        elif directive in ("elif", "else"):
            _, before = branches.pop()
            outside = all(now for now, _ in branches)
            holds = outside and not before and (directive == "else" or bool(_value(rest, defines)))
            branches.append((holds, before or holds))
        elif directive == "endif":
            branches.pop()
        elif not reading:
            continue
        elif directive == "define":
            name, *value = rest.split(None, 1)
            defines[name] = value[0] if value else "1"
        elif directive == "undef":
            defines.pop(rest.strip(), None)
        else:
            parts = _LAYOUT.match(layout)
            number = parts and _NUMBER.search(parts[1])
            kind = parts and _kind(parts[2])
            if parts and number and kind:
                # An array takes a number for each element.
                count = re.search(r"\[(\d+)\];", parts[2]) if kind in ("image", "sampler") else None
                first = _value(number[1], defines)
                listed += [Declaration(kind, first + own, parts[2]) for own in range(int(count[1]) if count else 1)]
    return tuple(listed)
