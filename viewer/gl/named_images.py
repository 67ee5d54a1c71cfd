"""Images for the user interface under a few names, uploaded when there is another one under a name."""

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext
from viewer.gl.fallback_texture import SpareTexture


class NamedImages:
    """GPU textures of whole images; each name has one."""

    def __init__(self, context: GraphicsContext) -> None:
        self._memory = context.memory
        self.spare = SpareTexture(context)
        self._held: dict[str, tuple[NDArray[np.uint8], moderngl.Texture]] = {}

    def get(self, name: str, pixels: NDArray[np.uint8]) -> moderngl.Texture:
        """RGB8 texture of `pixels` [h, w, 3] uint8, row 0 on top, sRGB-coded; a grey one where there is no memory."""
        held = self._held.get(name)
        if held is not None and held[0] is pixels:
            return held[1]
        if held is not None:
            del self._held[name]
            self.spare.release_other(held[1])
        height, width = pixels.shape[:2]
        texture = self.spare.unless(
            lambda: self._memory.texture(f"image {name!r}", (width, height), 3, np.ascontiguousarray(pixels).data)
        )
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._held[name] = (pixels, texture)
        return texture

    def release(self) -> None:
        """Free all textures."""
        for _, texture in self._held.values():
            texture.release()
        self.spare.release()
        self._held.clear()
