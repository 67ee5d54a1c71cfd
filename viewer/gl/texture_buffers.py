"""What stands in for storage buffers and for images that are read, where OpenGL has neither: texture units."""

import ctypes
from typing import Final

import moderngl

from viewer.gl.functions import GL_R32UI, GL_TEXTURE0, GL_TEXTURE_BUFFER, GlFunctions

STORAGE_UNITS: Final = 32
"""The storage binding b is texture unit STORAGE_UNITS + b."""
IMAGE_UNITS: Final = 48
"""The image unit i is texture unit IMAGE_UNITS + i. 80 texture units are guaranteed (OpenGL 4.1, table 6.41)."""


class TextureBuffers:
    """One texture for each storage binding. What is bound last stays allocated until something else is bound there."""

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
