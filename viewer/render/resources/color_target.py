"""Target for a plane of a slot's maps, or for its picture."""

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext
from viewer.gl.read_back import PicturePart


class ColorTarget:
    """RGBA target of one picture size (width, height); alpha is 1 where a surface is visible.

    Images use half floats: half the memory traffic, and an error of at most an eighth of an 8-bit step. Decoders write fp32.
    """

    def __init__(self, context: GraphicsContext, size: tuple[int, int], half: bool = False) -> None:
        self.size = size
        self._type: np.dtype[np.floating] = np.dtype(np.float16 if half else np.float32)
        what = f"the colours of a picture of {size[0]} x {size[1]}"
        with context.memory.transaction():
            self.texture = context.memory.texture(what, size, 4, dtype="f2" if half else "f4")
            self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self.framebuffer = context.memory.framebuffer(what, [self.texture])
        # A software renderer maps new memory at its first use, which should not be timed with a pass.
        self.framebuffer.clear()
        self._context = context
        self._with_depth: tuple[moderngl.Texture, moderngl.Framebuffer] | None = None

    def framebuffer_with_depth(self, depth: moderngl.Texture) -> moderngl.Framebuffer:
        """Return the framebuffer of this target with a depth texture; the same object while the depth texture is the same."""
        if self._with_depth is None or self._with_depth[0] is not depth:
            self._release_with_depth()
            # A framebuffer takes no memory, so there is nothing to check.
            self._with_depth = depth, self._context.gl.framebuffer([self.texture], depth)
        return self._with_depth[1]

    def _release_with_depth(self) -> None:
        if self._with_depth is not None:
            self._with_depth[1].release()
            self._with_depth = None

    def copy_from(self, other: "ColorTarget") -> None:
        """Copy the pixels of a target of the same size, which may have another float type."""
        # The viewport and scissor of another target must not limit the copy.
        self.framebuffer.use()
        self._context.gl.copy_framebuffer(self.framebuffer, other.framebuffer)

    @property
    def pixel_type(self) -> np.dtype[np.floating]:
        """Type of each of the four channels."""
        return self._type

    def read_bytes(self) -> bytes:
        """Return the texture's bytes: RGBA of `pixel_type`, row 0 at the bottom."""
        return bytes(self.texture.read())

    def part(self, pixels: tuple[int, int, int, int]) -> PicturePart:
        """Return a rectangle of linear RGBA; `pixels`: left, top, right, bottom from the upper left corner."""
        return PicturePart(self.framebuffer, pixels, "f2" if self._type.itemsize == 2 else "f4")

    def read_all(self) -> NDArray[np.float32]:
        """Return all four channels: [H, W, 4] float32, row 0 on top."""
        pixels = np.frombuffer(self.texture.read(), self._type).reshape(self.size[1], self.size[0], 4)
        return np.ascontiguousarray(pixels[::-1], np.float32)

    def read(self) -> NDArray[np.float32]:
        """Return the picture: [H, W, 3] float32 linear, row 0 on top, background 0."""
        return np.ascontiguousarray(self.read_all()[..., :3])

    def release(self) -> None:
        """Free the texture."""
        self._release_with_depth()
        self.framebuffer.release()
        self.texture.release()
