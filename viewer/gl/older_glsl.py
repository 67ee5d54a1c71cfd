"""GLSL 4.30 of vertex and fragment shaders as GLSL 4.10: buffers are read through texture buffers, images through samplers.

Only what draws can be written for both: no shader that is turned here may write into a buffer or an image. Lines stay where they are.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from viewer.gl.texture_buffers import IMAGE_UNITS, STORAGE_UNITS

_LINES: Final = {
    # Early tests are the rule for shaders that neither discard nor write a depth.
    "layout(early_fragment_tests) in;": "",
    "#version 430": "#version 410",
}
_SNORM: Final = (
    "uint packSnorm2x16(vec2 v) { ivec2 s = ivec2(roundEven(clamp(v, -1.0, 1.0) * 32767.0)); "
    "return uint(s.x & 0xFFFF) | (uint(s.y) << 16); }",
    "vec2 unpackSnorm2x16(uint bits) { ivec2 s = ivec2(int(bits << 16) >> 16, int(bits) >> 16); "
    "return clamp(vec2(s) / 32767.0, -1.0, 1.0); }",
)
_HALF: Final = (
    "float half_value(uint h) { uint e = (h >> 10) & 31u; uint m = h & 1023u; "
    "float v = e == 0u ? float(m) / 16777216.0 : uintBitsToFloat(((e + 112u) << 23) | (m << 13)); "
    "return (h & 0x8000u) != 0u ? -v : v; }",
    "vec2 unpackHalf2x16(uint bits) { return vec2(half_value(bits & 0xFFFFu), half_value(bits >> 16)); }",
)
"""Of finite halves: weights are stored without others."""
_STRUCT = re.compile(r"struct (\w+) \{(.*?)\};", re.DOTALL)
_FIELD = re.compile(r"^\s*(\w+) (\w+)(?:\[(\d+)\])?;", re.MULTILINE)
_BUFFER = re.compile(
    r"layout\(std430, binding = (\w+)\) (?:readonly )?buffer \w+ \{(\s*)(\w+) (\w+)\[\];([^\n]*\n)\};", re.DOTALL
)
_BLOCK = re.compile(r"layout\(std140, binding = (\w+)\) uniform (\w+)")
_SAMPLER = re.compile(r"layout\(binding = (\w+)\) uniform (\w+) (\w+);")
_IMAGE = re.compile(r"layout\(\w+, binding = (\w+)\) uniform readonly (u?)image2D (\w+);")
_DEFINE = re.compile(r"^\s*#define (\w+) (\d+)\s*$", re.MULTILINE)
_WORDS: Final = {"int": 1, "uint": 1, "float": 1, "vec2": 2, "vec4": 4, "uvec2": 2, "uvec4": 4, "ivec4": 4}
_WRITTEN: Final = {"int": "int({})", "uint": "{}", "float": "uintBitsToFloat({})"}


class UnsuitableShaderError(Exception):
    """A shader that cannot be said in GLSL 4.10."""


@dataclass(frozen=True)
class OlderSource:
    """A shader in GLSL 4.10, and what it cannot say itself."""

    text: str
    units: Mapping[str, int]
    """Texture unit of each sampler, by name."""
    blocks: Mapping[str, int]
    """Binding of each uniform block, by name."""


class _Records:
    """The structs of a shader: how many words they take in a buffer (std430), and how they are read."""

    def __init__(self, text: str) -> None:
        self._fields = {
            match[1]: [(kind, name, int(count or 0)) for kind, name, count in _FIELD.findall(match[2])]
            for match in _STRUCT.finditer(text)
        }

    def _alignment(self, kind: str) -> int:
        if kind in _WORDS:
            return _WORDS[kind]
        return max(self._alignment(own) for own, _, _ in self._fields[kind])

    def words(self, kind: str) -> int:
        """Size of an element of an array of `kind`, in words of 4 bytes."""
        if kind in _WORDS:
            return _WORDS[kind]
        if kind not in self._fields:
            raise UnsuitableShaderError(f"buffers of {kind} cannot be read")
        place = 0
        for own, _, count in self._fields[kind]:
            place = self._rounded(place, self._alignment(own)) + self.words(own) * max(count, 1)
        return self._rounded(place, self._alignment(kind))

    @staticmethod
    def _rounded(place: int, alignment: int) -> int:
        return -(-place // alignment) * alignment

    def read(self, kind: str, words: str, first: int) -> str:
        """GLSL for a value that begins at word `first` after `at`; `words` is the texture buffer."""
        if kind in _WRITTEN:
            return _WRITTEN[kind].format(f"texelFetch({words}, at + {first}).x")
        if kind in _WORDS:
            part = {"u": "uint", "i": "int"}.get(kind[0], "float")
            return f"{kind}({', '.join(self.read(part, words, first + i) for i in range(_WORDS[kind]))})"
        parts, place = [], first
        for own, _, count in self._fields[kind]:
            place = self._rounded(place, self._alignment(own))
            size = self.words(own)
            values = [self.read(own, words, place + size * i) for i in range(max(count, 1))]
            parts.append(f"{own}[{count}]({', '.join(values)})" if count else values[0])
            place += size * len(values)
        return f"{kind}({', '.join(parts)})"


def _rewritten(text: str, opening: str, closing: str, head: str, tail: str) -> str:
    """`text` with `head` in place of what the pattern `opening` finds, and `tail` in place of the `closing` that belongs to it."""
    found = re.compile(opening)
    start = 0
    while (match := found.search(text, start)) is not None:
        depth, end = 1, match.end()
        while depth:
            depth += {match[0][-1]: 1, closing: -1}.get(text[end], 0)
            end += 1
        text = f"{text[: match.start()]}{head}{text[match.end() : end - 1]}{tail}{text[end:]}"
        start = match.start() + len(head)
    return text


def older_source(text: str) -> OlderSource:
    """An assembled shader in GLSL 4.10. Raises UnsuitableShaderError."""
    records = _Records(text)
    numbers = {name: int(value) for name, value in _DEFINE.findall(text)}
    units: dict[str, int] = {}
    blocks: dict[str, int] = {}
    arrays: list[str] = []

    def number(binding: str) -> int:
        return int(binding) if binding.isdigit() else numbers[binding]

    def buffer(match: re.Match[str]) -> str:
        binding, space, kind, name, rest = match.groups()
        words = f"{name}_words"
        units[words] = STORAGE_UNITS + number(binding)
        arrays.append(name)
        if re.search(rf"#define {kind}\b", text):
            # Of a kind that differs from program to program: such buffers are not read where nothing computes.
            return f"uniform usamplerBuffer {words};" + "\n" * match[0].count("\n")
        size = records.words(kind)
        read = records.read(kind, words, 0)
        lines = f"{kind} {name}_at(int index) {{ int at = index * {size}; return {read}; }}"
        blank = "\n" * (space.count("\n") + rest.count("\n"))
        return f"uniform usamplerBuffer {words}; {lines}{blank}"

    def block(match: re.Match[str]) -> str:
        blocks[match[2]] = number(match[1])
        return f"layout(std140) uniform {match[2]}"

    def sampler(match: re.Match[str]) -> str:
        units[match[3]] = number(match[1])
        return f"uniform {match[2]} {match[3]};"

    def image(match: re.Match[str]) -> str:
        units[match[3]] = IMAGE_UNITS + number(match[1])
        return f"uniform {match[2]}sampler2D {match[3]};"

    for line, other in _LINES.items():
        text = text.replace(line, other)
    for pattern, replacement in ((_BUFFER, buffer), (_BLOCK, block), (_SAMPLER, sampler), (_IMAGE, image)):
        text = pattern.sub(replacement, text)
    text = _rewritten(text, r"\bimageLoad\(", ")", "texelFetch(", ", 0)")
    for name in dict.fromkeys(arrays):
        text = _rewritten(text, rf"(?<![\w.]){name}\[", "]", f"{name}_at(", ")")
    return OlderSource(_completed(text), units, blocks)


def _completed(text: str) -> str:
    """`text` with the functions that GLSL 4.10 lacks, and macros on one line each."""
    for name, lines in (("Snorm2x16", _SNORM), ("unpackHalf2x16", _HALF)):
        if name in text:
            head, line, rest = text.partition("#line 2 0\n")
            text = "\n".join((head + lines[0], lines[1], line + rest))
    if re.search(r"\\\n", text):
        text = re.sub(r"(?:[^\n]*\\\n)+[^\n]*", lambda found: _joined(found[0]), text)
    return text


def _joined(macro: str) -> str:
    return macro.replace("\\\n", " ") + "\n" * macro.count("\\\n")
