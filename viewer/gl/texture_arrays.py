"""Arrays of textures in formats that moderngl cannot make: of images with given mips, of blocks that the hardware decodes, and of
tiles that compute shaders write.

The first three channels are sRGB, which the hardware filters in linear light, or all four are linear.
"""

import ctypes
from collections.abc import Sequence
from typing import Final, Literal

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl import functions as names
from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext


class _TextureArray:
    """Texture array of 8-bit channels with `levels` mips, uninitialised, and a view of it that shaders can write."""

    def __init__(
        self, context: GraphicsContext, size: tuple[int, int], layers: int, kind: int, levels: int = 1
    ) -> None:
        """`kind`: internal format; without compute shaders one of 8-bit RGBA."""
        self._call, self.layers = context.functions, layers
        self.texture = self._new_name()
        self.view = 0
        self.use(0)
        call, target = self._call, names.GL_TEXTURE_2D_ARRAY
        if context.features.compute:
            call("glTexStorage3D", target, levels, kind, *size, layers)
            return
        call("glTexParameteri", target, names.GL_TEXTURE_MAX_LEVEL, levels - 1)
        for level in range(levels):
            extent = (max(1, size[0] >> level), max(1, size[1] >> level), layers, 0)
            call("glTexImage3D", target, level, kind, *extent, names.GL_RGBA, names.GL_UNSIGNED_BYTE, None)

    def _new_name(self) -> int:
        name = ctypes.c_uint()
        self._call("glGenTextures", 1, ctypes.addressof(name))
        return name.value

    def make_view(self) -> None:
        """Set a bilinear filter without repetition, and make `view`: the first mips as GL_RGBA8, for image units."""
        target = names.GL_TEXTURE_2D_ARRAY
        for name, value in (
            (names.GL_TEXTURE_MIN_FILTER, names.GL_LINEAR),
            (names.GL_TEXTURE_MAG_FILTER, names.GL_LINEAR),
            (names.GL_TEXTURE_WRAP_S, names.GL_CLAMP_TO_EDGE),
            (names.GL_TEXTURE_WRAP_T, names.GL_CLAMP_TO_EDGE),
        ):
            self._call("glTexParameteri", target, name, value)
        self.view = self._new_name()
        self._call("glTextureView", self.view, target, self.texture, names.GL_RGBA8, 0, 1, 0, self.layers)

    def use(self, unit: int) -> None:
        """Bind to a texture unit: samplers see linear light."""
        self._call("glActiveTexture", names.GL_TEXTURE0 + unit)
        self._call("glBindTexture", names.GL_TEXTURE_2D_ARRAY, self.texture)

    def use_view(self, unit: int) -> None:
        """Bind `view` to a texture unit."""
        self._call("glActiveTexture", names.GL_TEXTURE0 + unit)
        self._call("glBindTexture", names.GL_TEXTURE_2D_ARRAY, self.view)

    @property
    def is_released(self) -> bool:
        """True once it has been freed."""
        return self.texture == 0

    def release(self) -> None:
        """Free it; a second time does nothing."""
        for name in filter(None, (self.view, self.texture)):
            self._call("glDeleteTextures", 1, ctypes.addressof(ctypes.c_uint(name)))
        self.texture = self.view = 0


def _rgba_kind(srgb: bool) -> int:
    return names.GL_SRGB8_ALPHA8 if srgb else names.GL_RGBA8


class ImageArray:
    """Array of `layers` textures of (width, height) texels, each with its whole mip chain."""

    def __init__(self, context: GraphicsContext, size: tuple[int, int], layers: int, srgb: bool = True) -> None:
        """Allocate the array. Raises GpuMemoryError."""
        self.size = size
        self.levels = max(size).bit_length()
        self._call, self._memory = context.functions, context.memory
        self._what = f"{layers} source images of {size[0]} x {size[1]}"
        self._bytes = 4 * layers * size[0] * size[1] * 4 // 3
        self._memory.check_size(self._what, size)
        self._array = self._memory.made(
            self._what, self._bytes, lambda: _TextureArray(context, size, layers, _rgba_kind(srgb), self.levels)
        )

    @property
    def is_released(self) -> bool:
        """True once it has been freed."""
        return self._array.is_released

    def use(self, unit: int) -> None:
        """Bind to a texture unit: samplers see linear light."""
        self._array.use(unit)

    def write(self, layer: int, mips: Sequence[NDArray[np.uint8]]) -> None:
        """Upload the mips [h, w, 3 or 4] uint8 of one layer, largest first.

        Raises GpuMemoryError where there is no memory after all; the array is freed then.
        """
        self.use(0)
        self._call("glPixelStorei", names.GL_UNPACK_ALIGNMENT, 1)
        for level, mip in enumerate(mips):
            pixels = np.ascontiguousarray(mip)
            height, width = pixels.shape[:2]
            target, place, extent = names.GL_TEXTURE_2D_ARRAY, (level, 0, 0, layer), (width, height, 1)
            layout = names.GL_RGB if pixels.shape[2] == 3 else names.GL_RGBA
            texels = (layout, names.GL_UNSIGNED_BYTE, pixels.ctypes.data)
            self._call("glTexSubImage3D", target, *place, *extent, *texels)
        # Some drivers allocate memory only when there is something to put there.
        self._memory.check(self._what, self._bytes, self._array)

    def release(self) -> None:
        """Free the textures."""
        self._array.release()


GpuBlockFormat = Literal["bc7", "bc5", "bc4"]
"""BC7 of RGB or RGBA, BC5 of two components, BC4 of one."""
BLOCK_BYTES: Final[dict[GpuBlockFormat, int]] = {"bc7": 16, "bc5": 16, "bc4": 8}
STORED_COMPONENTS: Final[dict[GpuBlockFormat, int]] = {"bc7": 4, "bc5": 2, "bc4": 1}
_BLOCK_KINDS: Final[dict[GpuBlockFormat, int]] = {
    "bc7": names.GL_COMPRESSED_RGBA_BPTC_UNORM,
    "bc5": names.GL_COMPRESSED_RG_RGTC2,
    "bc4": names.GL_COMPRESSED_RED_RGTC1,
}


def blocks_bytes(size: tuple[int, int], block_format: GpuBlockFormat) -> int:
    """Return the number of bytes of the blocks of (width, height) texels, those over the edge included."""
    return -(-size[0] // 4) * -(-size[1] // 4) * BLOCK_BYTES[block_format]


class BlockArray:
    """Array of `layers` textures in blocks that the hardware decodes, each with its whole mip chain."""

    def __init__(
        self,
        context: GraphicsContext,
        size: tuple[int, int],
        layers: int,
        levels: int,
        block_format: GpuBlockFormat,
        srgb: bool,
        components: range,
    ) -> None:
        """Allocate the array with `levels` mips, uninitialised.

        Samplers see what is stored in `components` of RGBA, and 0 in the others. `srgb`: of BC7. Raises GpuMemoryError.
        """
        self._call, self._format = context.functions, block_format
        self._kind = names.GL_COMPRESSED_SRGB_ALPHA_BPTC_UNORM if srgb else _BLOCK_KINDS[block_format]
        sizes = [(max(1, size[0] >> level), max(1, size[1] >> level)) for level in range(levels)]
        self.bytes_on_gpu = layers * sum(blocks_bytes(each, block_format) for each in sizes)
        """Number of bytes of all blocks."""
        what = f"{layers} textures of {size[0]} x {size[1]} in {block_format.upper()}"
        context.memory.check_size(what, size)
        self._array = context.memory.made(
            what, self.bytes_on_gpu, lambda: _TextureArray(context, size, layers, self._kind, levels)
        )
        self.use(0)
        for component in range(4):
            stored = component - components.start if component in components else None
            source = names.GL_ZERO if stored is None else names.GL_RED + stored
            self._call("glTexParameteri", names.GL_TEXTURE_2D_ARRAY, names.GL_TEXTURE_SWIZZLE_R + component, source)

    def use(self, unit: int) -> None:
        """Bind to a texture unit: samplers see linear light."""
        self._array.use(unit)

    def write(
        self, layer: int, level: int, top: int, size: tuple[int, int], blocks: moderngl.Buffer, first: int
    ) -> None:
        """Copy blocks from byte `first` of a buffer to the rows of a mip from texel `top` on; `size` in texels, the mip's width."""
        self.use(0)
        self._call("glBindBuffer", names.GL_PIXEL_UNPACK_BUFFER, blocks.glo)
        part = (level, 0, top, layer, *size, 1, self._kind, blocks_bytes(size, self._format))
        self._call("glCompressedTexSubImage3D", names.GL_TEXTURE_2D_ARRAY, *part, first)
        self._call("glBindBuffer", names.GL_PIXEL_UNPACK_BUFFER, 0)

    def release(self) -> None:
        """Free the textures."""
        self._array.release()


class TileAtlas:
    """Layers of `side` x `side` texels. Shaders cannot store into sRGB formats: they write sRGB-coded numbers through a view of the
    same memory as GL_RGBA8, or draw them, for which the format does not count. Grows without losing its content."""

    def __init__(self, context: GraphicsContext, side: int, srgb: bool = True) -> None:
        self._context, self._memory, self._call, self._side = context, context.memory, context.functions, side
        self._srgb = srgb
        self._array: _TextureArray | None = None

    @property
    def layers(self) -> int:
        """Number of layers."""
        return 0 if self._array is None else self._array.layers

    @property
    def bytes_on_gpu(self) -> int:
        """Number of bytes of all layers."""
        return self.layers * self._side * self._side * 4

    def grow(self, layers: int) -> bool:
        """Grow to at least this many layers; return False, with nothing changed, without memory or where the driver allows fewer."""
        if layers <= self.layers:
            return True
        if layers > self._memory.limits.array_layers:
            return False
        side, old = self._side, self._array
        try:
            made = self._memory.made(
                "decoded tiles",
                layers * side * side * 4,
                lambda: _TextureArray(self._context, (side, side), layers, _rgba_kind(self._srgb)),
            )
        except GpuMemoryError:
            return False
        made.make_view()
        self._array = made
        if old is not None:
            self._copy(old, made)
            old.release()
        return True

    def _copy(self, old: _TextureArray, made: _TextureArray) -> None:
        side, target = self._side, names.GL_TEXTURE_2D_ARRAY
        place = (target, 0, 0, 0, 0)
        self._call("glCopyImageSubData", old.texture, *place, made.texture, *place, side, side, old.layers)

    def use(self, unit: int) -> None:
        """Bind to a texture unit: samplers see linear light."""
        if self._array is not None:
            self._array.use(unit)

    def use_stored(self, unit: int) -> None:
        """Bind to a texture unit: samplers see the numbers as they are stored."""
        if self._array is not None:
            self._array.use_view(unit)

    def bind_image(self, unit: int) -> None:
        """Bind all layers to an image unit, for writing sRGB-coded numbers."""
        view = self._array.view if self._array is not None else 0
        self._call("glBindImageTexture", unit, view, 0, 1, 0, names.GL_WRITE_ONLY, names.GL_RGBA8)

    def release(self) -> None:
        """Free the layers."""
        if self._array is not None:
            self._array.release()
            self._array = None
