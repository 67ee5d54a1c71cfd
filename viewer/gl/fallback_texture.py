"""What the user interface shows in place of a picture that the GPU has no memory for."""

from collections.abc import Callable

import moderngl

from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext

GREY = bytes((128, 128, 128))


class SpareTexture:
    """One grey texel, made beforehand: the user interface cannot stop in the middle of a frame."""

    def __init__(self, context: GraphicsContext) -> None:
        """Raises GpuMemoryError."""
        self._texture = context.memory.texture("a grey texel", (1, 1), 3, GREY)
        self._problem: str | None = None

    def unless(self, make: Callable[[], moderngl.Texture]) -> moderngl.Texture:
        """What `make` makes, else the grey texel, and a problem to tell of."""
        try:
            return make()
        except GpuMemoryError as error:
            self._problem = str(error)
            return self._texture

    def take_problem(self) -> str | None:
        """What there was no memory for last; None where there was no problem since the last call."""
        problem, self._problem = self._problem, None
        return problem

    def release_other(self, texture: moderngl.Texture) -> None:
        """Free a texture that `unless` gave, unless it is the grey texel."""
        if texture is not self._texture:
            texture.release()

    def release(self) -> None:
        """Free the grey texel."""
        self._texture.release()
