"""An array of equally large sRGB textures without mips that compute shaders write and samplers read."""

import ctypes

from viewer.gl import functions as names
from viewer.gl.context import GraphicsContext

NO_ERROR = "GL_NO_ERROR"


class SrgbAtlas:
    """Layers of `side` x `side` texels in GL_SRGB8_ALPHA8. Shaders cannot store into that: they write sRGB-coded numbers through a
    view of the same memory as GL_RGBA8. Grows without losing its content."""

    def __init__(self, context: GraphicsContext, side: int) -> None:
        self._gl, self._call, self._side = context.gl, context.functions, side
        self.layers = 0
        self._texture = 0
        self._view = 0

    @property
    def bytes_on_gpu(self) -> int:
        """Of all layers."""
        return self.layers * self._side * self._side * 4

    def _name(self) -> int:
        handle = ctypes.c_uint()
        self._call("glGenTextures", 1, ctypes.addressof(handle))
        return handle.value

    def grow(self, layers: int) -> bool:
        """Have at least this many layers; False, and all as before, where the driver has no memory for them."""
        if layers <= self.layers:
            return True
        # What others have left behind is not this call's.
        self._read_error()
        target, side = names.GL_TEXTURE_2D_ARRAY, self._side
        old_texture, old_view, old_layers = self._texture, self._view, self.layers
        self._texture, self._view = self._name(), self._name()
        self._call("glActiveTexture", names.GL_TEXTURE0)
        self._call("glBindTexture", target, self._texture)
        self._call("glTexStorage3D", target, 1, names.GL_SRGB8_ALPHA8, side, side, layers)
        if self._read_error() != NO_ERROR:
            self._delete(self._texture)
            self._delete(self._view)
            self._texture, self._view = old_texture, old_view
            return False
        self.layers = layers
        for name, value in (
            (names.GL_TEXTURE_MIN_FILTER, names.GL_LINEAR),
            (names.GL_TEXTURE_MAG_FILTER, names.GL_LINEAR),
            (names.GL_TEXTURE_WRAP_S, names.GL_CLAMP_TO_EDGE),
            (names.GL_TEXTURE_WRAP_T, names.GL_CLAMP_TO_EDGE),
        ):
            self._call("glTexParameteri", target, name, value)
        self._call("glTextureView", self._view, target, self._texture, names.GL_RGBA8, 0, 1, 0, layers)
        if old_layers:
            place = (target, 0, 0, 0, 0)
            self._call("glCopyImageSubData", old_texture, *place, self._texture, *place, side, side, old_layers)
            self._delete(old_view)
            self._delete(old_texture)
        return True

    def _read_error(self) -> str:
        """OpenGL's last error, which is then forgotten."""
        return str(self._gl.error)

    def use(self, unit: int) -> None:
        """Bind to a texture unit: samplers see linear light."""
        self._call("glActiveTexture", names.GL_TEXTURE0 + unit)
        self._call("glBindTexture", names.GL_TEXTURE_2D_ARRAY, self._texture)

    def bind_image(self, unit: int) -> None:
        """Bind all layers to an image unit, for writing sRGB-coded numbers."""
        self._call("glBindImageTexture", unit, self._view, 0, 1, 0, names.GL_WRITE_ONLY, names.GL_RGBA8)

    def _delete(self, name: int) -> None:
        self._call("glDeleteTextures", 1, ctypes.addressof(ctypes.c_uint(name)))

    def release(self) -> None:
        """Free the layers."""
        if self.layers:
            self._delete(self._view)
            self._delete(self._texture)
            self.layers = 0
