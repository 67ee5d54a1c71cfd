"""Drawing with OpenGL 4.1, where textures replace storage buffers and readable images.

Vertex and fragment shaders in GLSL 4.30 are rewritten in GLSL 4.10, which reads words of a buffer through samplers. Shaders that write
into a buffer or an image cannot be rewritten. Line numbers do not change.
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


VERSION: Final = "#version 410"
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
_MISSING: Final = (("Snorm2x16", _SNORM), ("unpackHalf2x16", _HALF))
"""Functions that GLSL 4.10 lacks, as parts of their names and lines."""
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
    """Error of a shader that GLSL 4.10 cannot express."""


@dataclass(frozen=True)
class OlderSource:
    """Shader in GLSL 4.10, with the bindings that its text cannot express."""

    text: str
    units: Mapping[str, int]
    """Texture unit of each sampler, by name."""
    blocks: Mapping[str, int]
    """Binding of each uniform block, by name."""


class _Records:
    """Structs of a shader: size in words of a buffer (std430), and GLSL that reads them."""

    def __init__(self, text: str) -> None:
        self._fields = {
            match[1]: [(kind, name, int(count or 0)) for kind, name, count in _FIELD.findall(match[2])]
            for match in _STRUCT.finditer(text)
        }

    def _alignment(self, kind: str) -> int:
        if kind in _WORDS:
            return _WORDS[kind]
        return max(self._alignment(field_kind) for field_kind, _, _ in self._fields[kind])

    def words(self, kind: str) -> int:
        """Return the size of an element of an array of `kind`, in words of 4 bytes."""
        if kind in _WORDS:
            return _WORDS[kind]
        if kind not in self._fields:
            raise UnsuitableShaderError(f"buffers of {kind} cannot be read")
        place = 0
        for field_kind, _, count in self._fields[kind]:
            place = self._rounded(place, self._alignment(field_kind)) + self.words(field_kind) * max(count, 1)
        return self._rounded(place, self._alignment(kind))

    @staticmethod
    def _rounded(place: int, alignment: int) -> int:
        return -(-place // alignment) * alignment

    def read(self, kind: str, words: str, first: int) -> str:
        """Return GLSL for a value that begins at word `first` after `at`; `words` is the sampler."""
        if kind in _WRITTEN:
            return _WRITTEN[kind].format(f"texelFetch({words}, at + {first}).x")
        if kind in _WORDS:
            part = {"u": "uint", "i": "int"}.get(kind[0], "float")
            return f"{kind}({', '.join(self.read(part, words, first + i) for i in range(_WORDS[kind]))})"
        parts, place = [], first
        for field_kind, _, count in self._fields[kind]:
            place = self._rounded(place, self._alignment(field_kind))
            size = self.words(field_kind)
            values = [self.read(field_kind, words, place + size * i) for i in range(max(count, 1))]
            parts.append(f"{field_kind}[{count}]({', '.join(values)})" if count else values[0])
            place += size * len(values)
        return f"{kind}({', '.join(parts)})"


def _rewritten(text: str, opening: str, closing: str, head: str, tail: str) -> str:
    """Return `text` with `head` in place of matches of `opening`, and `tail` in place of the matching `closing`."""
    pattern = re.compile(opening)
    start = 0
    while (match := pattern.search(text, start)) is not None:
        depth, end = 1, match.end()
        while depth:
            depth += {match[0][-1]: 1, closing: -1}.get(text[end], 0)
            end += 1
        text = f"{text[: match.start()]}{head}{text[match.end() : end - 1]}{tail}{text[end:]}"
        start = match.start() + len(head)
    return text


def older_source(text: str) -> OlderSource:
    """Rewrite an assembled shader in GLSL 4.10. Raises UnsuitableShaderError."""
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
            # The kind differs from program to program: such buffers are not read without compute shaders.
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

    text = text.replace(_EARLY_TESTS, "").replace("#version 430", VERSION)
    for pattern, replacement in ((_BUFFER, buffer), (_BLOCK, block), (_SAMPLER, sampler), (_IMAGE, image)):
        text = pattern.sub(replacement, text)
    text = _rewritten(text, r"\bimageLoad\(", ")", "texelFetch(", ", 0)")
    for name in dict.fromkeys(arrays):
        text = _rewritten(text, rf"(?<![\w.]){name}\[", "]", f"{name}_at(", ")")
    return OlderSource(_completed(text), units, blocks)


def _completed(text: str) -> str:
    """Return `text` with the functions that the version lacks, and macros on one line each."""
    lines = [line for name, functions in _MISSING if name in text for line in functions]
    head, mark, rest = text.partition("#line 2 0\n")
    if mark:
        text = head + "".join(f"{line}\n" for line in lines) + mark + rest
    if re.search(r"\\\n", text):
        text = re.sub(r"(?:[^\n]*\\\n)+[^\n]*", lambda macro: _joined(macro[0]), text)
    return text


def _joined(macro: str) -> str:
    return macro.replace("\\\n", " ") + "\n" * macro.count("\\\n")
