"""Composite: slots A and B side by side, as the 8-bit sRGB picture that is shown."""

from dataclasses import dataclass

import moderngl
import numpy as np

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.palettes import PaletteName, palette_colors
from viewer.passes.albedo_target import AlbedoTarget
from viewer.passes.divergence import DivergenceTarget
from viewer.passes.layout import PALETTE_STEPS, TextureUnit
from viewer.zoom import WHOLE, Zoom


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

    maps: DivergenceTarget
    first: int
    """Which map is for the slot that is shown alone, or left of the divider."""
    second: int
    """Which map is for the slot right of the divider."""
    most: int
    """Decoders at the far end of the palette."""
    opacity: float
    palette: PaletteName

    def uniforms(self) -> dict[str, object]:
        """Values of the shader's uniforms."""
        rows = self.maps.size[1]
        colors = palette_colors(self.palette, np.linspace(0.0, 1.0, PALETTE_STEPS))
        return {
            "picture": self.maps.picture,
            "block": self.maps.block,
            "first_rows": (self.first * rows, self.second * rows),
            "most": float(self.most),
            "opacity": self.opacity,
            "palette": colors.astype("<f4").tobytes(),
        }


@dataclass(frozen=True)
class Look:
    """How the slots come together in one picture."""

    divider: float | None = None
    """Pixels from the left: A left of it, B right of it. None: A alone."""
    overlay: HeatmapOverlay | None = None
    zoom: Zoom = WHOLE


class CompositePass:
    """Inputs: linear albedo of one slot, or of A and B with a divider; a heatmap. Output: an 8-bit sRGB picture."""

    def __init__(self, context: GraphicsContext, programs: ProgramFactory) -> None:
        self._gl = context.gl
        self._programs = programs
        self._triangles: dict[moderngl.Program, moderngl.VertexArray] = {}

    def run(self, albedo_a: AlbedoTarget, albedo_b: AlbedoTarget, look: Look, target: CompositeTarget) -> None:
        """Draw the picture; without a divider `albedo_b` is not read."""
        overlay, zoom = look.overlay, look.zoom
        wipes, zooms = look.divider is not None, not zoom.is_whole
        program = self._programs.program(
            "common/fullscreen.vert",
            "passes/composite/composite.frag",
            {"WIPE": int(wipes), "OVERLAY": int(overlay is not None), "ZOOM": int(zooms)},
        )
        if program not in self._triangles:
            self._triangles[program] = self._gl.vertex_array(program, [])
        target.framebuffer.use()
        self._gl.enable_only(moderngl.NOTHING)
        albedo_a.texture.use(int(TextureUnit.ALBEDO_A))
        values: dict[str, object] = {"depth": 0.0}
        if wipes:
            albedo_b.texture.use(int(TextureUnit.ALBEDO_B))
            values["divider"] = look.divider
        if zooms:
            left, top = zoom.corner
            values["zoom"] = zoom.factor
            values["corner"] = (left * target.size[0], (1.0 - top - 1.0 / zoom.factor) * target.size[1])
        if overlay is not None:
            overlay.maps.texture.use(int(TextureUnit.DIVERGENCE))
            values |= overlay.uniforms()
        set_uniforms(program, values)
        self._triangles[program].render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free the vertex arrays."""
        for triangle in self._triangles.values():
            triangle.release()
