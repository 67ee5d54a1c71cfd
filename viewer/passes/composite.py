"""Composite: slots A and B side by side, as the 8-bit sRGB picture that is shown."""

import moderngl

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.passes.albedo_target import AlbedoTarget
from viewer.passes.layout import TextureUnit


class CompositeTarget:
    """RGBA8 of one picture size (width, height); sRGB-coded numbers in a plain texture, row 0 at the bottom."""

    def __init__(self, context: GraphicsContext, size: tuple[int, int]) -> None:
        self.size = size
        self.texture = context.gl.texture(size, 4)
        self.framebuffer = context.gl.framebuffer([self.texture])
        # A software renderer maps fresh memory at its first use: here, not in the first timed pass.
        self.framebuffer.clear()

    def release(self) -> None:
        """Free the texture."""
        self.framebuffer.release()
        self.texture.release()


class CompositePass:
    """Inputs: linear albedo of A and B, the divider. Output: an 8-bit sRGB picture."""

    def __init__(self, context: GraphicsContext, programs: ProgramFactory) -> None:
        self._gl = context.gl
        self._program = programs.program("common/fullscreen.vert", "passes/composite/composite.frag")
        self._triangle = context.gl.vertex_array(self._program, [])

    def run(self, albedo_a: AlbedoTarget, albedo_b: AlbedoTarget, divider: float, target: CompositeTarget) -> None:
        """A left of `divider` (pixels from the left), B right of it."""
        target.framebuffer.use()
        self._gl.enable_only(moderngl.NOTHING)
        albedo_a.texture.use(int(TextureUnit.ALBEDO_A))
        albedo_b.texture.use(int(TextureUnit.ALBEDO_B))
        set_uniforms(self._program, {"divider": divider, "depth": 0.0})
        self._triangle.render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free the vertex array."""
        self._triangle.release()
