"""Textures that the user interface shows: whole images under names, and thumbnails."""

from collections.abc import Callable
from typing import Generic, TypeVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext

Key = TypeVar("Key")
GREY = bytes((128, 128, 128))
THUMBNAIL_SIDE = 48
"""Longer side of a thumbnail in texels."""


class UiTextures(Generic[Key]):
    """GPU textures of images by key. A grey texel stands in for images that the GPU has no memory for: a frame cannot stop halfway."""

    def __init__(self, context: GraphicsContext) -> None:
        """Upload the grey texel. Raises GpuMemoryError."""
        self._memory = context.memory
        self._grey = context.memory.texture("a grey texel", (1, 1), 3, GREY)
        self._textures: dict[Key, moderngl.Texture] = {}
        self._problem: str | None = None

    def _upload(self, key: Key, what: str, pixels: NDArray[np.uint8]) -> moderngl.Texture:
        """Return an RGB8 texture of `pixels` [h, w, 3] (row 0 on top, sRGB) in place of the one before; `what` is for messages."""
        before = self._textures.pop(key, self._grey)
        if before is not self._grey:
            before.release()
        height, width = pixels.shape[:2]
        try:
            texture = self._memory.texture(what, (width, height), 3, np.ascontiguousarray(pixels).data)
        except GpuMemoryError as error:
            self._problem, texture = str(error), self._grey
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._textures[key] = texture
        return texture

    def take_problem(self) -> str | None:
        """Return the message of the last upload that failed since the last call; None where none did."""
        problem, self._problem = self._problem, None
        return problem

    def __len__(self) -> int:
        """Return the number of textures that have been made."""
        return len(self._textures)

    def release(self) -> None:
        """Free all textures."""
        for texture in (*self._textures.values(), self._grey):
            texture.release()
        self._textures.clear()


class NamedImages(UiTextures[str]):
    """GPU textures of whole images, one for each name."""

    def __init__(self, context: GraphicsContext) -> None:
        """Hold no images yet. Raises GpuMemoryError."""
        super().__init__(context)
        self._pixels: dict[str, NDArray[np.uint8]] = {}

    def get(self, name: str, pixels: NDArray[np.uint8]) -> moderngl.Texture:
        """Return the texture of `pixels`; uploaded where it is not the array that was given last for `name`."""
        if self._pixels.get(name) is not pixels:
            self._upload(name, f"image {name!r}", pixels)
            self._pixels[name] = pixels
        return self._textures[name]


class Thumbnails(UiTextures[int]):
    """GPU textures with few texels of a scene's images, each made when it is first asked for."""

    def __init__(self, context: GraphicsContext, image_of: Callable[[int], NDArray[np.uint8]]) -> None:
        """Take `image_of`: texture id -> [H, W, 3] uint8, sRGB-coded. Raises GpuMemoryError."""
        super().__init__(context)
        self._image_of = image_of

    def __getitem__(self, texture_id: int) -> moderngl.Texture:
        """Return the texture of every n-th texel of a texture's image."""
        if texture_id not in self._textures:
            image = self._image_of(texture_id)
            # Thumbnails only need to be recognised: means of a few texels would cost a pass over each large image.
            step = max(1, -(-max(image.shape[:2]) // THUMBNAIL_SIDE))
            small = image[step // 2 :: step, step // 2 :: step][:THUMBNAIL_SIDE, :THUMBNAIL_SIDE]
            self._upload(texture_id, f"thumbnail {texture_id}", small if small.size else image[:1, :1])
        return self._textures[texture_id]
