"""Buffers that shaders read through texture buffers, where OpenGL has no storage buffers."""

import ctypes

import moderngl

from viewer.gl.functions import GL_R32UI, GL_TEXTURE0, GL_TEXTURE_BUFFER, GlFunctions
from viewer.gl.older_glsl import STORAGE_UNITS


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
