"""Composite: slots A and B side by side, as the 8-bit sRGB picture that is shown."""

from collections.abc import Mapping

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
    """Inputs: linear albedo of one slot, or of A and B with the divider. Output: an 8-bit sRGB picture."""

    def __init__(self, context: GraphicsContext, programs: ProgramFactory) -> None:
        self._gl = context.gl
        self._programs = {
            wipe: programs.program("common/fullscreen.vert", "passes/composite/composite.frag", {"WIPE": int(wipe)})
            for wipe in (False, True)
        }
        self._triangles = {wipe: context.gl.vertex_array(program, []) for wipe, program in self._programs.items()}

    def run_single(self, albedo: AlbedoTarget, target: CompositeTarget) -> None:
        """One slot over the whole picture."""
        self._run(False, target, {TextureUnit.ALBEDO_A: albedo}, {})

    def run_wipe(self, albedo_a: AlbedoTarget, albedo_b: AlbedoTarget, divider: float, target: CompositeTarget) -> None:
        """A left of `divider` (pixels from the left), B right of it."""
        textures = {TextureUnit.ALBEDO_A: albedo_a, TextureUnit.ALBEDO_B: albedo_b}
        self._run(True, target, textures, {"divider": divider})

    def _run(
        self,
        wipe: bool,
        target: CompositeTarget,
        textures: Mapping[TextureUnit, AlbedoTarget],
        uniforms: Mapping[str, object],
    ) -> None:
        target.framebuffer.use()
        self._gl.enable_only(moderngl.NOTHING)
        for unit, albedo in textures.items():
            albedo.texture.use(int(unit))
        set_uniforms(self._programs[wipe], {"depth": 0.0, **uniforms})
        self._triangles[wipe].render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free the vertex arrays."""
        for triangle in self._triangles.values():
            triangle.release()
