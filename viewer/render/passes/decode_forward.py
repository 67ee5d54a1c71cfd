"""Decode path `forward`: the material's fragment shader decodes, behind an equal-depth test."""

import moderngl

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.passes.decode_pass import DecodePass, filter_defines
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.pack_buffers import PackBuffers
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.render.resources.visibility_buffer import PlaneReading, VisibilityInputs
from viewer.state.view_state import TexelFilter


class DecodeForwardPass(DecodePass):
    """Draws the draw list of the visibility buffer again, with its matrix."""

    name = "decode_forward"

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        buffers: PackBuffers,
        scene_buffers: SceneBuffers,
        reading: PlaneReading,
        texel_filter: TexelFilter = "exact",
    ) -> None:
        self._gl, self._buffers, self._scene_buffers = context.gl, buffers, scene_buffers
        defines = {**reading.defines(), **buffers.defines, **filter_defines(texel_filter)}
        self._program = programs.program("common/scene.vert", "passes/decode_forward/decode.frag", defines)

    def run(self, inputs: VisibilityInputs, target: ColorTarget) -> None:
        """Decode in the fragments that lie at the visible depth."""
        gl = self._gl
        framebuffer = target.framebuffer_with_depth(inputs.visibility.depth)
        try:
            framebuffer.use()
            framebuffer.color_mask = (True, True, True, True)
            framebuffer.depth_mask = False
            target.framebuffer.clear()
            framebuffer.use()
            gl.enable_only(moderngl.DEPTH_TEST)
            gl.depth_func = "=="
            inputs.bind()
            self._buffers.bind()
            matrix = inputs.matrix.T.astype("<f4").tobytes()
            blocks = self._buffers.network_blocks
            values = {"network_blocks": blocks, "view_projection": matrix, "sample_number": inputs.sample}
            set_uniforms(self._program, values)
            self._scene_buffers.draw(self._program, self._program)
        finally:
            gl.depth_func = "<"
