"""GLSL programs from files: includes once, defines after `#version`, compiler errors mapped back to file and line."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

import moderngl

from viewer.gl.functions import GlFunctions
from viewer.gl.older_glsl import UnsuitableShaderError, older_source

Defines = Mapping[str, int | float | str]
EXTENSION = "extension"
"""Key of `Defines` that becomes `#extension VALUE : require` instead of a `#define`."""

_INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"\s*$')
_VERSION = re.compile(r"^\s*#\s*version\b.*$")
# Mesa writes "0:12(5): error", NVIDIA "0(12) : error", others "ERROR: 0:12: ...".
_LOCATION = re.compile(r"\b(\d+)(?::(\d+)|\((\d+)\))")
_UNIFORM = re.compile(r"\buniform\s+(?:\w+\s+)+(\w+)\s*(?:\[[^\]]*\]\s*)?;")


class ShaderError(Exception):
    """Error of a shader that cannot be assembled or compiled; the message names file and line."""


@dataclass(frozen=True)
class ShaderSource:
    """Assembled shader."""

    text: str
    files: tuple[str, ...]
    """File of each source number that the text's `#line` directives use."""
    units: Mapping[str, int] = field(default_factory=dict)
    """Texture units of samplers whose declarations have no binding."""
    blocks: Mapping[str, int] = field(default_factory=dict)
    """Bindings of uniform blocks whose declarations have none."""

    @property
    def uniforms(self) -> frozenset[str]:
        """Names of the uniforms that the text declares, also inside an `#if` that is false."""
        return frozenset(_UNIFORM.findall(self.text))

    def explain(self, log: str) -> str:
        """Return a compiler's log with source numbers replaced by file names."""

        def name(match: re.Match[str]) -> str:
            number, line = int(match[1]), match[2] or match[3]
            return f"{self.files[number]}:{line}" if number < len(self.files) else match[0]

        return "\n".join(_LOCATION.sub(name, line, count=1) for line in log.splitlines())


class ShaderLibrary:
    """GLSL files of a folder, and generated ones that exist only in memory."""

    def __init__(self, folder: Path, generated: Mapping[str, str] | None = None, older: bool = False) -> None:
        """Take the folder and generated files; `older`: assemble GLSL 4.10 for what draws (`viewer.gl.older_glsl`)."""
        self._folder, self.is_older = folder, older
        self._generated = dict(generated or {})

    def with_generated(self, generated: Mapping[str, str]) -> "ShaderLibrary":
        """Return this library with further generated files."""
        return ShaderLibrary(self._folder, {**self._generated, **generated}, self.is_older)

    def _read(self, name: str) -> str:
        if name in self._generated:
            return self._generated[name]
        if ".." in PurePosixPath(name).parts:
            raise ShaderError(f"{name}: lies outside the shader folder")
        try:
            return (self._folder / name).read_text(encoding="utf-8")
        except OSError as error:
            raise ShaderError(f"{name}: {error.strerror}") from error

    def assemble(self, name: str, defines: Defines | None = None) -> ShaderSource:
        """Assemble the shader `name` with its includes, each file once. `defines` (0 is a value like any other) follow `#version`."""
        files: list[str] = []
        output: list[str] = []
        self._append(name, files, output)
        for position, line in enumerate(output):
            if _VERSION.match(line):
                given = dict(defines or {})
                extension = given.pop(EXTENSION, None)
                lines = []
                if extension is not None:
                    # Half types, and what unpacks them, have overloads from 4.50 on only.
                    output[position] = "#version 450"
                    lines.append(f"#extension {extension} : require")
                lines += [f"#define {key} {value}" for key, value in given.items()]
                # The line after #version is line 2 of file 0, whatever was inserted.
                output[position + 1 : position + 1] = [*lines, "#line 2 0"]
                return self._source(name, "\n".join(output) + "\n", tuple(files))
        raise ShaderError(f"{name}: has no #version line")

    def _source(self, name: str, text: str, files: tuple[str, ...]) -> ShaderSource:
        if not self.is_older or name.endswith(".comp"):
            return ShaderSource(text, files)
        try:
            older = older_source(text)
        except UnsuitableShaderError as error:
            raise ShaderError(f"{name}: {error}") from error
        return ShaderSource(older.text, files, older.units, older.blocks)

    def _append(self, name: str, files: list[str], output: list[str]) -> None:
        number = len(files)
        files.append(name)
        if number > 0:
            output.append(f"#line 1 {number}")
        for position, line in enumerate(self._read(name).splitlines(), start=1):
            match = _INCLUDE.match(line)
            if match is None:
                output.append(line)
                continue
            if match[1] not in files:
                try:
                    self._append(match[1], files, output)
                except ShaderError as error:
                    raise ShaderError(f"{name}:{position}: {error}") from error
            output.append(f"#line {position + 1} {number}")


class ProgramFactory:
    """Factory of a library's programs; it compiles each distinct one once."""

    def __init__(self, gl: moderngl.Context, library: ShaderLibrary, functions: GlFunctions | None = None) -> None:
        """Take a library; `functions` are needed where it assembles GLSL 4.10."""
        self._gl, self._functions = gl, functions
        self._library = library
        self._programs: dict[object, moderngl.Program | moderngl.ComputeShader] = {}
        self._variants: dict[object, ProgramFactory] = {}
        self._triangles: dict[moderngl.Program, moderngl.VertexArray] = {}

    def with_generated(self, generated: Mapping[str, str]) -> "ProgramFactory":
        """Return the factory for the same library with further generated files: one for equal files, freed with this one."""
        key = tuple(sorted(generated.items()))
        if key not in self._variants:
            self._variants[key] = ProgramFactory(self._gl, self._library.with_generated(generated), self._functions)
        return self._variants[key]

    def program(self, vertex: str, fragment: str, defines: Defines | None = None) -> moderngl.Program:
        """Return the program of a vertex and a fragment shader file. Raises ShaderError."""
        made = self._find((vertex, fragment), defines)
        assert isinstance(made, moderngl.Program)
        return made

    def compute(self, name: str, defines: Defines | None = None) -> moderngl.ComputeShader:
        """Return the compute program of a file. Raises ShaderError."""
        if self._library.is_older:
            raise ShaderError(f"{name}: computing needs OpenGL 4.3")
        made = self._find((name,), defines)
        assert isinstance(made, moderngl.ComputeShader)
        return made

    def fullscreen(self, fragment: str, defines: Defines | None = None) -> moderngl.VertexArray:
        """Return a triangle over the whole target for a fragment shader file, to be rendered with 3 vertices. Raises ShaderError."""
        program = self.program("common/fullscreen.vert", fragment, defines)
        if program not in self._triangles:
            self._triangles[program] = self._gl.vertex_array(program, [])
        return self._triangles[program]

    def _find(self, names: tuple[str, ...], defines: Defines | None) -> moderngl.Program | moderngl.ComputeShader:
        key = (names, tuple(sorted((defines or {}).items())))
        if key not in self._programs:
            sources = [self._library.assemble(name, defines) for name in names]
            made: moderngl.Program | moderngl.ComputeShader
            try:
                if len(sources) == 1:
                    made = self._gl.compute_shader(sources[0].text)
                else:
                    made = self._gl.program(vertex_shader=sources[0].text, fragment_shader=sources[1].text)
            except moderngl.Error as error:
                log = str(error)
                source = sources[0] if "vertex_shader" in log else sources[-1]
                raise ShaderError(f"{' + '.join(names)}: {source.explain(log)}") from error
            for source in sources:
                self._place(made, source)
            made.extra = frozenset().union(*(source.uniforms for source in sources))
            self._programs[key] = made
        return self._programs[key]

    def _place(self, program: moderngl.Program | moderngl.ComputeShader, source: ShaderSource) -> None:
        """Set the bindings of textures and uniform blocks whose declarations have none."""
        for name, unit in source.units.items():
            sampler = program.get(name, None)
            if isinstance(sampler, moderngl.Uniform) and self._functions is not None:
                # moderngl does not know samplers of texture buffers.
                self._functions("glProgramUniform1i", program.glo, sampler.location, unit)
        for name, binding in source.blocks.items():
            block = program.get(name, None)
            if isinstance(block, moderngl.UniformBlock):
                block.binding = binding

    def release(self) -> None:
        """Free all programs."""
        for part in (*self._variants.values(), *self._triangles.values(), *self._programs.values()):
            part.release()
        self._variants.clear()
        self._triangles.clear()
        self._programs.clear()


def set_uniforms(program: moderngl.Program | moderngl.ComputeShader, values: Mapping[str, object]) -> None:
    """Set uniforms of a program that a ProgramFactory made; bytes are written as they are, other values by moderngl.

    Drivers remove uniforms that have no effect: those are skipped. Raises ShaderError for a name that the source does not declare.
    """
    for name, value in values.items():
        uniform = program.get(name, None)
        if isinstance(uniform, moderngl.Uniform):
            if isinstance(value, bytes):
                uniform.write(value)
            else:
                uniform.value = value
        elif name not in (program.extra or ()):
            raise ShaderError(f"the program has no uniform {name!r}")
