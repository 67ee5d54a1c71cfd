"""Images for the user interface under a few names, uploaded when there is another one under a name."""

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext


class NamedImages:
    """GPU textures of whole images; each name has one."""

    def __init__(self, context: GraphicsContext) -> None:
        self._gl = context.gl
        self._held: dict[str, tuple[NDArray[np.uint8], moderngl.Texture]] = {}

    def get(self, name: str, pixels: NDArray[np.uint8]) -> moderngl.Texture:
        """RGB8 texture of `pixels` [h, w, 3] uint8, row 0 on top, sRGB-coded."""
        held = self._held.get(name)
        if held is not None and held[0] is pixels:
            return held[1]
        if held is not None:
            held[1].release()
        texture = self._gl.texture(pixels.shape[1::-1], 3, np.ascontiguousarray(pixels).data, alignment=1)
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._held[name] = (pixels, texture)
        return texture

    def release(self) -> None:
        """Free all textures."""
        for _, texture in self._held.values():
            texture.release()
        self._held.clear()
