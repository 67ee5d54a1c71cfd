"""An array of equally large sRGB textures with given mips, which moderngl cannot make."""

import ctypes
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from viewer.gl import functions as names
from viewer.gl.context import GraphicsContext


class SrgbTextureArray:
    """`layers` textures of (width, height) texels in GL_SRGB8_ALPHA8, each with its whole mip chain."""

    def __init__(self, context: GraphicsContext, size: tuple[int, int], layers: int) -> None:
        self.size = size
        self.levels = max(size).bit_length()
        self._call = context.functions
        self._layers, self._memory = layers, context.memory
        self._handle = 0
        self._what = f"{layers} source images of {size[0]} x {size[1]}"
        self._bytes = 4 * layers * size[0] * size[1] * 4 // 3
        context.memory.check_size(self._what, size)
        context.memory.made(self._what, self._bytes, self._made)

    def _made(self) -> "SrgbTextureArray":
        handle = ctypes.c_uint()
        self._call("glGenTextures", 1, ctypes.addressof(handle))
        self._handle = handle.value
        self._bind()
        target, size = names.GL_TEXTURE_2D_ARRAY, self.size
        self._call("glTexStorage3D", target, self.levels, names.GL_SRGB8_ALPHA8, *size, self._layers)
        return self

    @property
    def is_released(self) -> bool:
        """Whether it has been freed."""
        return self._handle == 0

    def _bind(self, unit: int = 0) -> None:
        self._call("glActiveTexture", names.GL_TEXTURE0 + unit)
        self._call("glBindTexture", names.GL_TEXTURE_2D_ARRAY, self._handle)

    def use(self, unit: int) -> None:
        """Bind to a texture unit."""
        self._bind(unit)

    def write(self, layer: int, mips: Sequence[NDArray[np.uint8]]) -> None:
        """Upload the mips [h, w, 3] uint8 sRGB of one layer, largest first. Frees the array where there is no memory after all."""
        self._bind()
        self._call("glPixelStorei", names.GL_UNPACK_ALIGNMENT, 1)
        for level, mip in enumerate(mips):
            pixels = np.ascontiguousarray(mip)
            height, width = pixels.shape[:2]
            self._call(
                "glTexSubImage3D",
                names.GL_TEXTURE_2D_ARRAY,
                level,
                0,
                0,
                layer,
                width,
                height,
                1,
                names.GL_RGB,
                names.GL_UNSIGNED_BYTE,
                pixels.ctypes.data,
            )
        # Some drivers only look for memory when there is something to put there.
        self._memory.check(self._what, self._bytes, self)

    def release(self) -> None:
        """Free the textures."""
        if self._handle:
            self._call("glDeleteTextures", 1, ctypes.addressof(ctypes.c_uint(self._handle)))
            self._handle = 0
