"""Drawing without storage buffers and images that are read (OpenGL 4.1, WebGL 2): textures stand in for them.

GLSL 4.30 of vertex and fragment shaders becomes GLSL 4.10 or GLSL ES 3.00, which reads words through samplers. Only what draws can be
written for all: no shader that is turned here may write into a buffer or an image. Lines stay where they are.
"""

import ctypes
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import moderngl

from viewer.gl.functions import GL_R32UI, GL_TEXTURE0, GL_TEXTURE_BUFFER, GlFunctions

STORAGE_UNITS: Final = 32
"""First texture unit of storage bindings: binding b is unit STORAGE_UNITS + b."""
IMAGE_UNITS: Final = 48
"""First texture unit of image units: image unit i is unit IMAGE_UNITS + i. 80 units are guaranteed (OpenGL 4.1, table 6.41)."""


class TextureBuffers:
    """Texture buffers, one for each storage binding. A buffer stays allocated until another one is bound there."""

    def __init__(self, call: GlFunctions) -> None:
        self._call = call
        self._textures: dict[int, int] = {}

    def bind(self, buffer: moderngl.Buffer, binding: int) -> None:
        """Let shaders read the words of `buffer` where those of OpenGL 4.3 name this binding."""
        if binding not in self._textures:
            name = ctypes.c_uint()
            self._call("glGenTextures", 1, ctypes.addressof(name))
            self._textures[binding] = name.value
        self._call("glActiveTexture", GL_TEXTURE0 + STORAGE_UNITS + binding)
        self._call("glBindTexture", GL_TEXTURE_BUFFER, self._textures[binding])
        self._call("glTexBuffer", GL_TEXTURE_BUFFER, GL_R32UI, buffer.glo)

    @staticmethod
    def bind_image(texture: moderngl.Texture, unit: int) -> None:
        """Let shaders read `texture` where those of OpenGL 4.3 name this image unit."""
        texture.use(IMAGE_UNITS + unit)


WORD_COLUMN_BITS: Final = 11
"""Bits of the column of a word where a buffer is a picture: rows of 2^11 words, the smallest limit of a texture in WebGL 2."""
# Early tests are the rule for shaders that neither discard nor write a depth.
_EARLY_TESTS: Final = "layout(early_fragment_tests) in;"
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
"""Functions that unpack finite halves: weights are stored without others."""
_WIDE_PRODUCT: Final = (
    "void umulExtended(uint a, uint b, out uint high, out uint low) { uint al = a & 65535u; uint ah = a >> 16; "
    "uint bl = b & 65535u; uint bh = b >> 16; uint m = ah * bl + ((al * bl) >> 16); uint n = al * bh + (m & 65535u); "
    "high = ah * bh + (m >> 16) + (n >> 16); low = a * b; }",
)
_BIT_COUNT: Final = (
    "int bitCount(uint v) { v = v - ((v >> 1) & 0x55555555u); v = (v & 0x33333333u) + ((v >> 2) & 0x33333333u); "
    "return int((((v + (v >> 4)) & 0x0F0F0F0Fu) * 0x01010101u) >> 24); }",
)


@dataclass(frozen=True)
class Dialect:
    """Version of GLSL that has neither storage buffers nor images that are read."""

    version: str
    """Line in place of `#version 430`."""
    words: str
    """Type of the samplers of words."""
    fetch: str
    """GLSL for the word at {place} of {words}."""
    precision: str = ""
    """Precision of samplers of images."""
    opening: tuple[str, ...] = ()
    """Lines that come first."""
    missing: tuple[tuple[str, tuple[str, ...]], ...] = ()
    """Functions that the version lacks, as parts of their names and lines."""


GLSL_410: Final = Dialect(
    "#version 410",
    "usamplerBuffer",
    "texelFetch({words}, {place}).x",
    missing=(("Snorm2x16", _SNORM), ("unpackHalf2x16", _HALF)),
)
GLSL_ES_300: Final = Dialect(
    "#version 300 es",
    "highp usampler2D",
    f"texelFetch({{words}}, ivec2(({{place}}) & {(1 << WORD_COLUMN_BITS) - 1}, ({{place}}) >> {WORD_COLUMN_BITS}), 0).x",
    precision="highp ",
    opening=("precision highp float;", "precision highp int;"),
    missing=(("umulExtended", _WIDE_PRODUCT), ("bitCount", _BIT_COUNT)),
)
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
    """Error of a shader that an older GLSL cannot express."""


@dataclass(frozen=True)
class OlderSource:
    """Shader in an older GLSL, with the bindings that its text cannot express."""

    text: str
    units: Mapping[str, int]
    """Texture unit of each sampler, by name."""
    blocks: Mapping[str, int]
    """Binding of each uniform block, by name."""


class _Records:
    """Structs of a shader: their size in words of a buffer (std430), and how they are read."""

    def __init__(self, text: str, fetch: str) -> None:
        self._fetch = fetch
        self._fields = {
            match[1]: [(kind, name, int(count or 0)) for kind, name, count in _FIELD.findall(match[2])]
            for match in _STRUCT.finditer(text)
        }

    def _alignment(self, kind: str) -> int:
        if kind in _WORDS:
            return _WORDS[kind]
        return max(self._alignment(own) for own, _, _ in self._fields[kind])

    def words(self, kind: str) -> int:
        """Return the size of an element of an array of `kind`, in words of 4 bytes."""
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
        """Return GLSL for a value that begins at word `first` after `at`; `words` is the sampler."""
        if kind in _WRITTEN:
            return _WRITTEN[kind].format(self._fetch.format(words=words, place=f"at + {first}"))
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
    """Return `text` with `head` in place of what `opening` finds, and `tail` in place of the `closing` that belongs to it."""
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


def older_source(text: str, dialect: Dialect = GLSL_410) -> OlderSource:
    """Rewrite an assembled shader in an older GLSL. Raises UnsuitableShaderError."""
    records = _Records(text, dialect.fetch)
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
            # The kind differs from program to program: such buffers are not read without compute shaders.
            return f"uniform {dialect.words} {words};" + "\n" * match[0].count("\n")
        size = records.words(kind)
        read = records.read(kind, words, 0)
        lines = f"{kind} {name}_at(int index) {{ int at = index * {size}; return {read}; }}"
        blank = "\n" * (space.count("\n") + rest.count("\n"))
        return f"uniform {dialect.words} {words}; {lines}{blank}"

    def block(match: re.Match[str]) -> str:
        blocks[match[2]] = number(match[1])
        return f"layout(std140) uniform {match[2]}"

    def sampler(match: re.Match[str]) -> str:
        units[match[3]] = number(match[1])
        return f"uniform {dialect.precision}{match[2]} {match[3]};"

    def image(match: re.Match[str]) -> str:
        units[match[3]] = IMAGE_UNITS + number(match[1])
        return f"uniform {dialect.precision}{match[2]}sampler2D {match[3]};"

    text = text.replace(_EARLY_TESTS, "").replace("#version 430", dialect.version)
    for pattern, replacement in ((_BUFFER, buffer), (_BLOCK, block), (_SAMPLER, sampler), (_IMAGE, image)):
        text = pattern.sub(replacement, text)
    text = _rewritten(text, r"\bimageLoad\(", ")", "texelFetch(", ", 0)")
    for name in dict.fromkeys(arrays):
        text = _rewritten(text, rf"(?<![\w.]){name}\[", "]", f"{name}_at(", ")")
    return OlderSource(_completed(text, dialect), units, blocks)


def _completed(text: str, dialect: Dialect) -> str:
    """Return `text` with the functions that the version lacks, and macros on one line each."""
    lines = [*dialect.opening, *(line for name, own in dialect.missing if name in text for line in own)]
    head, mark, rest = text.partition("#line 2 0\n")
    if mark:
        text = head + "".join(f"{line}\n" for line in lines) + mark + rest
    if re.search(r"\\\n", text):
        text = re.sub(r"(?:[^\n]*\\\n)+[^\n]*", lambda found: _joined(found[0]), text)
    return text


def _joined(macro: str) -> str:
    return macro.replace("\\\n", " ") + "\n" * macro.count("\\\n")
