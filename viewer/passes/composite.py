"""Composite: slots A and B side by side, as the 8-bit sRGB picture that is shown."""

from collections.abc import Mapping
from dataclasses import dataclass

import moderngl

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.passes.albedo_target import AlbedoTarget
from viewer.passes.divergence import DivergenceTarget
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


@dataclass(frozen=True, eq=False)
class HeatmapOverlay:
    """Decoders per block, to lie over the picture."""

    first: DivergenceTarget
    """For the slot that is shown alone, or left of the divider."""
    second: DivergenceTarget
    """For the slot right of the divider."""
    most: int
    """Decoders at the red end of the scale."""
    opacity: float


class CompositePass:
    """Inputs: linear albedo of one slot, or of A and B with the divider; a heatmap. Output: an 8-bit sRGB picture."""

    def __init__(self, context: GraphicsContext, programs: ProgramFactory) -> None:
        self._gl = context.gl
        self._programs = programs
        self._triangles: dict[moderngl.Program, moderngl.VertexArray] = {}

    def run_single(self, albedo: AlbedoTarget, target: CompositeTarget, overlay: HeatmapOverlay | None = None) -> None:
        """One slot over the whole picture."""
        self._run({TextureUnit.ALBEDO_A: albedo}, None, target, overlay)

    def run_wipe(
        self,
        albedo_a: AlbedoTarget,
        albedo_b: AlbedoTarget,
        divider: float,
        target: CompositeTarget,
        overlay: HeatmapOverlay | None = None,
    ) -> None:
        """A left of `divider` (pixels from the left), B right of it."""
        self._run({TextureUnit.ALBEDO_A: albedo_a, TextureUnit.ALBEDO_B: albedo_b}, divider, target, overlay)

    def _run(
        self,
        albedo: Mapping[TextureUnit, AlbedoTarget],
        divider: float | None,
        target: CompositeTarget,
        overlay: HeatmapOverlay | None,
    ) -> None:
        program = self._programs.program(
            "common/fullscreen.vert",
            "passes/composite/composite.frag",
            {"WIPE": int(divider is not None), "OVERLAY": int(overlay is not None)},
        )
        if program not in self._triangles:
            self._triangles[program] = self._gl.vertex_array(program, [])
        target.framebuffer.use()
        self._gl.enable_only(moderngl.NOTHING)
        for unit, source in albedo.items():
            source.texture.use(int(unit))
        set_uniforms(program, {"depth": 0.0} if divider is None else {"depth": 0.0, "divider": divider})
        if overlay is not None:
            overlay.first.texture.use(int(TextureUnit.DIVERGENCE_A))
            overlay.second.texture.use(int(TextureUnit.DIVERGENCE_B))
            block, opacity = overlay.first.block, overlay.opacity
            scale = {"picture": target.size, "block": block, "most": float(overlay.most), "opacity": opacity}
            set_uniforms(program, scale)
        self._triangles[program].render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free the vertex arrays."""
        for triangle in self._triangles.values():
            triangle.release()
