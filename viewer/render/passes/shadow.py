"""Shadow pass: the sun's shadow map."""

from dataclasses import dataclass, field

import moderngl

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.pass_scheduler import RenderPass
from viewer.render.resources.culling import DrawList
from viewer.render.resources.light import ShadowMap, ShadowView
from viewer.render.resources.scene_buffers import SceneBuffers

SLOPE_BIAS = 1.5
"""Slope factor of the depth bias (glPolygonOffset): multiples of a triangle's steepest depth change between texels."""
CONSTANT_BIAS = 4.0
"""Constant depth bias (glPolygonOffset), in smallest steps of depth."""


@dataclass(frozen=True)
class ShadowInputs:
    """Inputs of the shadow map: direction of the sun, pose and coverage."""

    direction: tuple[float, float, float]
    pose: int
    """Version of the pose."""
    coverage: int
    """Version of the textures' coverage (`SceneBuffers.coverage`)."""
    view: ShadowView = field(compare=False)
    draw_list: DrawList = field(compare=False)


class ShadowPass(RenderPass[ShadowInputs, ShadowMap]):
    """Pass that draws the shadow map. Output: the depth of the surface nearest to the sun.

    Single-sided triangles that face away from the sun cast no shadow.
    """

    name = "shadow"

    def __init__(self, context: GraphicsContext, programs: ProgramFactory, scene_buffers: SceneBuffers) -> None:
        self._gl, self._programs, self._buffers = context.gl, programs, scene_buffers

    def run(self, inputs: ShadowInputs, output: ShadowMap) -> None:
        """Draw the whole map; the scene buffers' draw list is the same afterwards."""
        gl = self._gl
        output.framebuffer.use()
        output.framebuffer.clear(depth=1.0)
        gl.enable_only(moderngl.DEPTH_TEST)
        gl.depth_func = "<"
        self._buffers.bind_materials()
        matrix = inputs.view.matrix.T.astype("<f4").tobytes()
        colors = int(self._buffers.has_colors)
        programs = []
        for alpha_test in (False, True):
            defines = {"VERTEX_COLORS": colors, "ALPHA_TEST": int(alpha_test)}
            programs.append(self._programs.program("common/scene.vert", "passes/shadow/shadow.frag", defines))
            set_uniforms(programs[-1], {"view_projection": matrix})
        gl.polygon_offset = SLOPE_BIAS, CONSTANT_BIAS
        try:
            with self._buffers.drawing(inputs.draw_list):
                self._buffers.draw(*programs)
        finally:
            gl.polygon_offset = 0.0, 0.0
