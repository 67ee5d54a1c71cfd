"""Recorder of the programs that a renderer would compile. They are not compiled, but handed to other compilers."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Final
from unittest.mock import patch

import moderngl

from viewer.gl.program import Defines, ProgramFactory

HALF_EXTENSION: Final = "GL_EXT_shader_explicit_arithmetic_types_float16"
"""The one of `HALF_EXTENSIONS` that compilers other than drivers' know best."""


@dataclass(frozen=True)
class AssembledProgram:
    """Program in the form that the driver would get."""

    files: tuple[str, ...]
    """Files of its stages, below shaders/: one of a compute shader, else those of the vertex and the fragment shader."""
    texts: tuple[str, ...]
    """GLSL of each stage."""
    defines: Mapping[str, int | float | str]
    """What was defined; of equal texts those of the first."""
    codec: str
    """`ProgramRecorder.codec` while it was first assembled."""


class _NoProgram(moderngl.Program):
    """Draws nothing."""

    _glo = 0

    def __init__(self, uniforms: frozenset[str]) -> None:
        self.extra = uniforms

    def get(self, _key: str, default: Any) -> Any:
        return default

    def release(self) -> None:
        """There is nothing to free."""


class _NoComputeShader(moderngl.ComputeShader):
    """Computes nothing."""

    def __init__(self, uniforms: frozenset[str]) -> None:
        self.extra = uniforms

    def get(self, _key: str, default: Any) -> Any:
        return default

    def run(self, *_groups: int) -> None:
        """Nothing is run."""

    def run_indirect(self, *_place: object) -> None:
        """Nothing is run."""

    def release(self) -> None:
        """There is nothing to free."""


class _NoVertexArray(moderngl.VertexArray):
    """Draws nothing."""

    _glo = 0

    def __init__(self, program: moderngl.Program) -> None:
        self._program = program

    def render(self, *_: object, **__: object) -> None:
        """Nothing is drawn."""

    def render_indirect(self, *_: object, **__: object) -> None:
        """Nothing is drawn."""

    def release(self) -> None:
        """There is nothing to free."""


@dataclass
class ProgramRecorder:
    """Recorder of the programs of a ProgramFactory, which gets programs without effect instead."""

    programs: dict[tuple[str, ...], AssembledProgram] = field(default_factory=dict[tuple[str, ...], AssembledProgram])
    uniforms: dict[tuple[str, ...], frozenset[str]] = field(default_factory=dict[tuple[str, ...], frozenset[str]])
    codec: str = ""
    """Name that recorded programs get as their codec."""

    def find(
        self, factory: ProgramFactory, names: tuple[str, ...], defines: Defines | None
    ) -> moderngl.Program | moderngl.ComputeShader:
        """Record a program and return one without effect, in place of `ProgramFactory._find`."""
        key = (names, tuple(sorted((defines or {}).items())))
        if key not in factory._programs:
            sources = [factory._library.assemble(name, defines) for name in names]
            texts = tuple(source.text for source in sources)
            if texts not in self.programs:
                self.programs[texts] = AssembledProgram(names, texts, dict(defines or {}), self.codec)
                self.uniforms[texts] = frozenset[str]().union(*(source.uniforms for source in sources))
            kind = _NoComputeShader if len(names) == 1 else _NoProgram
            factory._programs[key] = kind(self.uniforms[texts])
        return factory._programs[key]

    @staticmethod
    def vertex_array(
        _gl: moderngl.Context, program: moderngl.Program, *_: object, **__: object
    ) -> moderngl.VertexArray:
        """Return a vertex array without effect, in place of `moderngl.Context.vertex_array`."""
        return _NoVertexArray(program)

    @contextmanager
    def recording(self) -> Iterator[None]:
        """While it lasts nothing is compiled."""

        def find(
            factory: ProgramFactory, names: tuple[str, ...], defines: Defines | None
        ) -> moderngl.Program | moderngl.ComputeShader:
            return self.find(factory, names, defines)

        with (
            patch.object(ProgramFactory, "_find", find),
            patch.object(moderngl.Context, "vertex_array", self.vertex_array),
        ):
            yield
