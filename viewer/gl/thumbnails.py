"""Small pictures of textures for the user interface, made when they are first asked for."""

from collections.abc import Callable

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext
from viewer.gl.fallback_texture import SpareTexture

SIDE = 48
"""Texels of the longer side."""


class Thumbnails:
    """GPU textures with few texels of images."""

    def __init__(self, context: GraphicsContext, image_of: Callable[[int], NDArray[np.uint8]]) -> None:
        self._memory = context.memory
        self.spare = SpareTexture(context)
        self._image_of = image_of
        self._made: dict[int, moderngl.Texture] = {}

    def __getitem__(self, texture_id: int) -> moderngl.Texture:
        """RGB8 texture, row 0 on top, sRGB-coded: every n-th texel of the image [H, W, 3] uint8 of a texture; grey without memory."""
        if texture_id not in self._made:
            image = self._image_of(texture_id)
            # Thumbnails only need to be recognised: means of a few texels would cost a pass over each large image.
            step = max(1, -(-max(image.shape[:2]) // SIDE))
            small = np.ascontiguousarray(image[step // 2 :: step, step // 2 :: step][:SIDE, :SIDE])
            if small.size == 0:
                small = np.ascontiguousarray(image[:1, :1])
            height, width = small.shape[:2]
            texture = self.spare.unless(
                lambda: self._memory.texture(f"thumbnail {texture_id}", (width, height), 3, small.tobytes())
            )
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            self._made[texture_id] = texture
        return self._made[texture_id]

    def __len__(self) -> int:
        """Thumbnails that have been made."""
        return len(self._made)

    def release(self) -> None:
        """Free all textures."""
        for texture in self._made.values():
            texture.release()
        self.spare.release()
        self._made.clear()
