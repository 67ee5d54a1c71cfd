"""An array of equally large sRGB textures without mips that compute shaders write and samplers read."""

import ctypes

from viewer.gl import functions as names
from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.functions import GlFunctions


class _Layers:
    """Memory for `layers` layers: the texture, and a view of it that shaders write to."""

    def __init__(self, call: GlFunctions, side: int, layers: int) -> None:
        self._call, self.layers = call, layers
        self.texture, self.view = self._name(), self._name()
        target = names.GL_TEXTURE_2D_ARRAY
        call("glActiveTexture", names.GL_TEXTURE0)
        call("glBindTexture", target, self.texture)
        call("glTexStorage3D", target, 1, names.GL_SRGB8_ALPHA8, side, side, layers)

    def make_view(self) -> None:
        """What is left to do where there was memory."""
        target = names.GL_TEXTURE_2D_ARRAY
        for name, value in (
            (names.GL_TEXTURE_MIN_FILTER, names.GL_LINEAR),
            (names.GL_TEXTURE_MAG_FILTER, names.GL_LINEAR),
            (names.GL_TEXTURE_WRAP_S, names.GL_CLAMP_TO_EDGE),
            (names.GL_TEXTURE_WRAP_T, names.GL_CLAMP_TO_EDGE),
        ):
            self._call("glTexParameteri", target, name, value)
        self._call("glTextureView", self.view, target, self.texture, names.GL_RGBA8, 0, 1, 0, self.layers)

    def _name(self) -> int:
        handle = ctypes.c_uint()
        self._call("glGenTextures", 1, ctypes.addressof(handle))
        return handle.value

    @property
    def is_released(self) -> bool:
        """Whether it has been freed."""
        return self.texture == 0

    def release(self) -> None:
        """Free it."""
        for name in (self.view, self.texture):
            self._call("glDeleteTextures", 1, ctypes.addressof(ctypes.c_uint(name)))
        self.texture = self.view = 0


class SrgbAtlas:
    """Layers of `side` x `side` texels in GL_SRGB8_ALPHA8. Shaders cannot store into that: they write sRGB-coded numbers through a
    view of the same memory as GL_RGBA8. Grows without losing its content."""

    def __init__(self, context: GraphicsContext, side: int) -> None:
        self._memory, self._call, self._side = context.memory, context.functions, side
        self._held: _Layers | None = None

    @property
    def layers(self) -> int:
        """Layers that there are."""
        return 0 if self._held is None else self._held.layers

    @property
    def bytes_on_gpu(self) -> int:
        """Of all layers."""
        return self.layers * self._side * self._side * 4

    def grow(self, layers: int) -> bool:
        """Have at least this many layers; False, and all as before, where the driver has no memory for them."""
        if layers <= self.layers:
            return True
        side, old = self._side, self._held
        try:
            made = self._memory.made(
                "decoded tiles", layers * side * side * 4, lambda: _Layers(self._call, side, layers)
            )
        except GpuMemoryError:
            return False
        made.make_view()
        self._held = made
        if old is not None:
            place = (names.GL_TEXTURE_2D_ARRAY, 0, 0, 0, 0)
            self._call("glCopyImageSubData", old.texture, *place, made.texture, *place, side, side, old.layers)
            old.release()
        return True

    def use(self, unit: int) -> None:
        """Bind to a texture unit: samplers see linear light."""
        self._call("glActiveTexture", names.GL_TEXTURE0 + unit)
        self._call("glBindTexture", names.GL_TEXTURE_2D_ARRAY, self._held.texture if self._held is not None else 0)

    def bind_image(self, unit: int) -> None:
        """Bind all layers to an image unit, for writing sRGB-coded numbers."""
        view = self._held.view if self._held is not None else 0
        self._call("glBindImageTexture", unit, view, 0, 1, 0, names.GL_WRITE_ONLY, names.GL_RGBA8)

    def release(self) -> None:
        """Free the layers."""
        if self._held is not None:
            self._held.release()
            self._held = None
