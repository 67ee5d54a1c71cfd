"""Visibility pass: draws the surface of each pixel. Later passes read only this, never the geometry."""

import moderngl

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.pass_scheduler import RenderPass
from viewer.render.resources.scene_buffers import CulledScene, SceneBuffers
from viewer.render.resources.visibility_buffer import VisibilityTarget


class VisibilityPass(RenderPass[CulledScene, VisibilityTarget]):
    """Pass that draws the visibility buffer. Output: a VisibilityTarget."""

    name = "visibility"

    def __init__(self, context: GraphicsContext, programs: ProgramFactory, scene_buffers: SceneBuffers) -> None:
        self._gl = context.gl
        self._programs = programs
        self._scene_buffers = scene_buffers

    def run(self, inputs: CulledScene, output: VisibilityTarget) -> None:
        """Draw the scene buffers' draw list."""
        gl = self._gl
        output.clear()
        gl.enable_only(moderngl.DEPTH_TEST)
        gl.depth_func = "<"
        self._scene_buffers.bind_materials()
        values = {"view_projection": inputs.matrix.T.astype("<f4").tobytes(), "blend_sample": inputs.sample}
        programs = []
        for alpha_test in (0, 1):
            defines = {**output.content.defines(), "ALPHA_TEST": alpha_test}
            programs.append(self._programs.program("common/scene.vert", "passes/visibility/visibility.frag", defines))
            set_uniforms(programs[-1], values)
        self._scene_buffers.draw(*programs)
