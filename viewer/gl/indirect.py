"""Indirect draws whose number only the GPU knows (OpenGL 4.6 or GL_ARB_indirect_parameters)."""

import ctypes

import moderngl

from viewer.gl.context import GraphicsContext
from viewer.gl.functions import GL_TRIANGLES, GL_UNSIGNED_INT, GL_UNSIGNED_SHORT

GL_DRAW_INDIRECT_BUFFER = 0x8F3F
GL_PARAMETER_BUFFER = 0x80EE
EXTENSION = "GL_ARB_indirect_parameters"
CORE_VERSION = 460
COMMAND_BYTES = 20
"""Number of bytes of a DrawElementsIndirectCommand."""


class IndirectDraws:
    """Draws of commands in a buffer, whose number is in another buffer."""

    def __init__(self, context: GraphicsContext) -> None:
        self._functions = context.functions
        name = "glMultiDrawElementsIndirectCount"
        address = 0
        if context.gl.version_code >= CORE_VERSION:
            address = context.load(name)
        elif EXTENSION in context.gl.extensions:
            address = context.load(f"{name}ARB")
        arguments = (ctypes.c_uint, ctypes.c_uint, ctypes.c_void_p, ctypes.c_ssize_t, ctypes.c_int, ctypes.c_int)
        self._call = ctypes.CFUNCTYPE(None, *arguments)(address) if address else None

    @property
    def are_counted(self) -> bool:
        """True where the driver reads the number from a buffer; else all there may be are drawn, and unused ones must be empty."""
        return self._call is not None

    def draw(
        self,
        array: moderngl.VertexArray,
        index_bytes: int,
        commands: moderngl.Buffer,
        first: int,
        most: int,
        counts: moderngl.Buffer,
        place: int,
    ) -> None:
        """Draw commands from number `first` on, at most `most`: as many as the uint32 says at byte `place` of `counts`."""
        if self._call is None:
            array.render_indirect(commands, moderngl.TRIANGLES, count=most, first=first)
            return
        call = self._functions
        call("glUseProgram", array.program.glo)
        call("glBindVertexArray", array.glo)
        call("glBindBuffer", GL_DRAW_INDIRECT_BUFFER, commands.glo)
        call("glBindBuffer", GL_PARAMETER_BUFFER, counts.glo)
        kind = GL_UNSIGNED_INT if index_bytes == 4 else GL_UNSIGNED_SHORT
        self._call(GL_TRIANGLES, kind, COMMAND_BYTES * first, place, most, COMMAND_BYTES)
        call("glBindBuffer", GL_PARAMETER_BUFFER, 0)
