"""One OpenGL context, and programs compiled once, for all tests of a process that draw without a window.

Contexts and programs cost more than most pictures of tests. `share` makes `create_headless_context` wrap one context again
and again: memory accounts, limits and simulated losses are new each time, objects and programs of OpenGL live in the one context.
Tests that ask for a device or a window system get a separate context.

OpenGL frees nothing by itself while its context lives: `free_unreachable` frees what tests have left.
"""

import gc
import os
from collections.abc import Mapping
from typing import Final

import moderngl
import pytest

from viewer.gl import context as context_module
from viewer.gl.context import GraphicsContext, wrap_context
from viewer.gl.devices import DEVICE_VARIABLE
from viewer.gl.functions import GlFunctions
from viewer.gl.program import Defines, ProgramFactory, ShaderLibrary
from viewer.gl.systems import SYSTEM, GraphicsSystem
from viewer.render.resources import pack_buffers

_create: Final = context_module.create_headless_context
_release: Final = moderngl.Context.release
_find: Final = ProgramFactory._find
_SHARED: Final[list[GraphicsContext]] = []
"""The shared context, once there is one."""
_MADE: Final[dict[object, ProgramFactory]] = {}
MOST_PROGRAMS: Final = 200
"""Most programs that are cached for later tests; one takes 1.4 MB with Mesa."""


def shared_context(device: str | None = None, system: GraphicsSystem = SYSTEM) -> GraphicsContext:
    """Return the shared context, current and in a new wrapping. Other devices and systems have separate contexts."""
    if device is not None or DEVICE_VARIABLE in os.environ or system is not SYSTEM:
        return _create(device, system)
    if not _SHARED:
        _SHARED.append(_create())
        # Objects that nothing refers to are noted, for `free_unreachable`.
        _SHARED[0].gl.gc_mode = "context_gc"
    shared = _SHARED[0]
    shared.gl.__enter__()
    return wrap_context(shared.gl, shared.load)


def is_shared(gl: moderngl.Context) -> bool:
    """Return whether `gl` is the shared context."""
    return bool(_SHARED) and gl is _SHARED[0].gl


def release_unless_shared(gl: moderngl.Context) -> None:
    """Free a context, but the shared one, which others go on with."""
    if not is_shared(gl):
        _release(gl)


def free_unreachable() -> None:
    """Free what nothing refers to, also in the shared context, among it all programs once there are too many.

    Programs that somebody holds stay as they are. The shared context is current afterwards, where there is one.
    """
    if sum(len(made._programs) for made in _MADE.values()) > MOST_PROGRAMS:
        _MADE.clear()
    gc.collect()
    if not _SHARED:
        return
    gl = _SHARED[0].gl
    gl.__enter__()
    while gl.objects:
        unreachable = gl.objects.popleft()
        # moderngl notes those that were released too.
        if not isinstance(unreachable, moderngl.InvalidObject):
            unreachable.release()


class SharedPrograms(ProgramFactory):
    """Factory whose programs all factories of the shared context use, each compiled once; in other contexts a separate one.

    Programs are not shared while a test replaces `ProgramFactory._find`, because what it returns must not outlive the test.
    """

    def __init__(self, gl: moderngl.Context, library: ShaderLibrary, functions: GlFunctions | None = None) -> None:
        super().__init__(gl, library, functions)
        self._one: ProgramFactory | None = None
        if is_shared(gl):
            key = (library._folder, library.is_older, tuple(sorted(library._generated.items())))
            self._one = _MADE.setdefault(key, ProgramFactory(gl, library, functions))

    def with_generated(self, generated: Mapping[str, str]) -> ProgramFactory:
        """Return the factory for the library with further files."""
        if self._one is None:
            return super().with_generated(generated)
        return SharedPrograms(self._gl, self._library.with_generated(generated), self._functions)

    def program(self, vertex: str, fragment: str, defines: Defines | None = None) -> moderngl.Program:
        """Return a program of the shared factory."""
        if self._one is None or ProgramFactory._find is not _find:
            return super().program(vertex, fragment, defines)
        return self._one.program(vertex, fragment, defines)

    def compute(self, name: str, defines: Defines | None = None) -> moderngl.ComputeShader:
        """Return a compute program of the shared factory."""
        if self._one is None or ProgramFactory._find is not _find:
            return super().compute(name, defines)
        return self._one.compute(name, defines)


def share() -> None:
    """Let everything that is imported from now on draw in the shared context."""
    patch = pytest.MonkeyPatch()
    patch.setattr(context_module, "create_headless_context", shared_context)
    patch.setattr(moderngl.Context, "release", release_unless_shared)
    patch.setattr(pack_buffers, "ProgramFactory", SharedPrograms)
