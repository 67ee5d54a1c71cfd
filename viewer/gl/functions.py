"""OpenGL functions that moderngl lacks, called by their addresses: texture arrays and views, integer clears, fences, timestamps."""

import ctypes
from collections.abc import Callable
from typing import Any

from viewer.gl.systems import FunctionLoader

GL_TEXTURE_2D_ARRAY = 0x8C1A
GL_TEXTURE_BUFFER = 0x8C2A
GL_R32UI = 0x8236
GL_TEXTURE_MAX_LEVEL = 0x813D
GL_SRC1_COLOR = 0x88F9
GL_ONE_MINUS_SRC1_COLOR = 0x88FA
GL_TRIANGLES = 0x0004
GL_UNSIGNED_INT = 0x1405
GL_UNSIGNED_SHORT = 0x1403
GL_SRGB8_ALPHA8 = 0x8C43
GL_RGBA8 = 0x8058
GL_RGBA = 0x1908
GL_WRITE_ONLY = 0x88B9
GL_TEXTURE_MIN_FILTER = 0x2801
GL_TEXTURE_MAG_FILTER = 0x2800
GL_TEXTURE_WRAP_S = 0x2802
GL_TEXTURE_WRAP_T = 0x2803
GL_LINEAR = 0x2601
GL_CLAMP_TO_EDGE = 0x812F
GL_RGB = 0x1907
GL_UNSIGNED_BYTE = 0x1401
GL_UNPACK_ALIGNMENT = 0x0CF5
GL_PIXEL_UNPACK_BUFFER = 0x88EC
GL_COMPRESSED_RED_RGTC1 = 0x8DBB
GL_COMPRESSED_RG_RGTC2 = 0x8DBD
GL_COMPRESSED_RGBA_BPTC_UNORM = 0x8E8C
GL_COMPRESSED_SRGB_ALPHA_BPTC_UNORM = 0x8E8D
GL_TEXTURE_SWIZZLE_R = 0x8E42
GL_ZERO = 0
GL_RED = 0x1903
GL_TEXTURE0 = 0x84C0
GL_COLOR = 0x1800
GL_COPY_WRITE_BUFFER = 0x8F37
GL_STREAM_READ = 0x88E1
GL_SYNC_GPU_COMMANDS_COMPLETE = 0x9117
GL_SYNC_FLUSH_COMMANDS_BIT = 0x0001
GL_TIMEOUT_EXPIRED = 0x911B
GL_TIMESTAMP = 0x8E28
GL_QUERY_RESULT = 0x8866
GL_QUERY_RESULT_AVAILABLE = 0x8867

_UINT, _INT, _POINTER = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p
_SIGNATURES: dict[str, tuple[type, ...]] = {
    "glGenTextures": (_INT, _POINTER),
    "glDeleteTextures": (_INT, _POINTER),
    "glActiveTexture": (_UINT,),
    "glBindTexture": (_UINT, _UINT),
    "glTexStorage3D": (_UINT, _INT, _UINT, _INT, _INT, _INT),
    "glTexImage3D": (_UINT, *[_INT] * 6, _UINT, _UINT, _POINTER),
    "glTexBuffer": (_UINT, _UINT, _UINT),
    "glUseProgram": (_UINT,),
    "glProgramUniform1i": (_UINT, _INT, _INT),
    "glBindVertexArray": (_UINT,),
    "glVertexAttrib4f": (_UINT, *[ctypes.c_float] * 4),
    "glVertexAttribI4ui": (_UINT, *[_UINT] * 4),
    "glDrawElementsBaseVertex": (_UINT, _INT, _UINT, _POINTER, _INT),
    "glTexSubImage3D": (_UINT, *[_INT] * 7, _UINT, _UINT, _POINTER),
    "glCompressedTexSubImage3D": (_UINT, *[_INT] * 7, _UINT, _INT, _POINTER),
    "glTexParameteri": (_UINT, _UINT, _INT),
    "glTextureView": (_UINT, _UINT, _UINT, _UINT, _UINT, _UINT, _UINT, _UINT),
    "glBindImageTexture": (_UINT, _UINT, _INT, ctypes.c_ubyte, _INT, _UINT, _UINT),
    "glCopyImageSubData": (_UINT, _UINT, *[_INT] * 4, _UINT, _UINT, *[_INT] * 7),
    "glPixelStorei": (_UINT, _INT),
    "glClearBufferuiv": (_UINT, _INT, _POINTER),
    "glBindBuffer": (_UINT, _UINT),
    "glBufferData": (_UINT, ctypes.c_ssize_t, _POINTER, _UINT),
    "glFlush": (),
    "glFenceSync": (_UINT, _UINT),
    "glClientWaitSync": (_POINTER, _UINT, ctypes.c_uint64),
    "glDeleteSync": (_POINTER,),
    "glGenQueries": (_INT, _POINTER),
    "glQueryCounter": (_UINT, _UINT),
    "glGetQueryObjectuiv": (_UINT, _UINT, _POINTER),
    "glGetQueryObjectui64v": (_UINT, _UINT, _POINTER),
}
_RESULTS: dict[str, type] = {"glFenceSync": _POINTER, "glClientWaitSync": _UINT}
"""Types of the results, of functions that return one."""
_BEYOND_DRAWING = ("glTexStorage3D", "glTextureView", "glBindImageTexture", "glCopyImageSubData")
"""Functions that OpenGL 4.1 lacks: nothing calls them where `Features.compute` is false."""


class GlFunctions:
    """Calls by name: `functions("glBindTexture", target, texture)`. Raises RuntimeError where the driver lacks one.

    `computes`: it must have those of OpenGL 4.3, else of 4.1.
    """

    def __init__(self, load: FunctionLoader, computes: bool = True) -> None:
        self._calls: dict[str, Callable[..., Any]] = {}
        for name, arguments in _SIGNATURES.items():
            address = load(name)
            if not address and not computes and name in _BEYOND_DRAWING:
                continue
            if not address:
                raise RuntimeError(f"the OpenGL driver has no {name}")
            self._calls[name] = ctypes.CFUNCTYPE(_RESULTS.get(name), *arguments)(address)

    def __call__(self, name: str, *arguments: Any) -> Any:
        return self._calls[name](*arguments)
