"""Textures that the user interface shows: whole images under names, and thumbnails."""

from collections.abc import Callable

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext

GREY = bytes((128, 128, 128))
THUMBNAIL_SIDE = 48
"""Texels of the longer side of a thumbnail."""


class FallbackTexture:
    """One grey texel, shown in place of images that the GPU has no memory for: the user interface cannot stop within a frame."""

    def __init__(self, context: GraphicsContext) -> None:
        """Raises GpuMemoryError."""
        self._memory = context.memory
        self._texture = context.memory.texture("a grey texel", (1, 1), 3, GREY)
        self._problem: str | None = None

    def upload(self, what: str, pixels: NDArray[np.uint8]) -> moderngl.Texture:
        """RGB8 texture of `pixels` [h, w, 3] uint8, row 0 on top, sRGB-coded; the grey texel where there is no memory.

        `what` names the texture in `take_problem`'s message.
        """
        height, width = pixels.shape[:2]
        try:
            texture = self._memory.texture(what, (width, height), 3, np.ascontiguousarray(pixels).data)
        except GpuMemoryError as error:
            self._problem = str(error)
            texture = self._texture
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        return texture

    def take_problem(self) -> str | None:
        """Message of the last upload that failed since the last call; None where none did."""
        problem, self._problem = self._problem, None
        return problem

    def release_other(self, texture: moderngl.Texture) -> None:
        """Free a texture that `upload` returned, unless it is the grey texel."""
        if texture is not self._texture:
            texture.release()

    def release(self) -> None:
        """Free the grey texel."""
        self._texture.release()


class NamedImages:
    """GPU textures of whole images, one for each name."""

    def __init__(self, context: GraphicsContext) -> None:
        """Raises GpuMemoryError."""
        self.fallback = FallbackTexture(context)
        self._textures: dict[str, tuple[NDArray[np.uint8], moderngl.Texture]] = {}

    def get(self, name: str, pixels: NDArray[np.uint8]) -> moderngl.Texture:
        """Texture of `pixels`, as FallbackTexture.upload; uploaded where it is not the array that was given last for `name`."""
        held = self._textures.get(name)
        if held is not None and held[0] is pixels:
            return held[1]
        if held is not None:
            del self._textures[name]
            self.fallback.release_other(held[1])
        texture = self.fallback.upload(f"image {name!r}", pixels)
        self._textures[name] = (pixels, texture)
        return texture

    def release(self) -> None:
        """Free all textures."""
        for _, texture in self._textures.values():
            texture.release()
        self.fallback.release()
        self._textures.clear()


class Thumbnails:
    """GPU textures with few texels of a scene's images, each made when it is first asked for."""

    def __init__(self, context: GraphicsContext, image_of: Callable[[int], NDArray[np.uint8]]) -> None:
        """`image_of`: texture id -> [H, W, 3] uint8, sRGB-coded. Raises GpuMemoryError."""
        self.fallback = FallbackTexture(context)
        self._image_of = image_of
        self._textures: dict[int, moderngl.Texture] = {}

    def __getitem__(self, texture_id: int) -> moderngl.Texture:
        """Texture of every n-th texel of a texture's image, as FallbackTexture.upload."""
        if texture_id not in self._textures:
            image = self._image_of(texture_id)
            # Thumbnails only need to be recognised: means of a few texels would cost a pass over each large image.
            step = max(1, -(-max(image.shape[:2]) // THUMBNAIL_SIDE))
            small = image[step // 2 :: step, step // 2 :: step][:THUMBNAIL_SIDE, :THUMBNAIL_SIDE]
            if small.size == 0:
                small = image[:1, :1]
            self._textures[texture_id] = self.fallback.upload(f"thumbnail {texture_id}", small)
        return self._textures[texture_id]

    def __len__(self) -> int:
        """Thumbnails that have been made."""
        return len(self._textures)

    def release(self) -> None:
        """Free all textures."""
        for texture in self._textures.values():
            texture.release()
        self.fallback.release()
        self._textures.clear()
