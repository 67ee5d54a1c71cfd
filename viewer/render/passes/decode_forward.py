"""Decode path `forward`: the material's fragment shader decodes, behind an equal-depth test."""

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.resources.albedo_target import AlbedoTarget
from viewer.render.resources.pack_buffers import PackBuffers
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.render.resources.visibility_buffer import VisibilityTarget


class DecodeForwardPass:
    """Inputs: the draw list that made the visibility buffer, its depth and ids, a pack. Output: linear albedo."""

    def __init__(self, context: GraphicsContext, programs: ProgramFactory, pack: PackBuffers, colors: bool) -> None:
        self._gl = context.gl
        self._pack = pack
        self._program = programs.program(
            "common/scene.vert",
            "passes/decode_forward/decode.frag",
            {"VERTEX_COLORS": int(colors), **pack.defines},
        )

    def run(
        self,
        visibility: VisibilityTarget,
        scene_buffers: SceneBuffers,
        target: AlbedoTarget,
        matrix: NDArray[np.float64],
    ) -> None:
        """Draw the uploaded list again with the same world-to-clip `matrix` [4, 4]."""
        gl = self._gl
        framebuffer = target.framebuffer_with_depth(visibility.depth)
        try:
            framebuffer.use()
            framebuffer.color_mask = (True, True, True, True)
            framebuffer.depth_mask = False
            target.framebuffer.clear()
            framebuffer.use()
            gl.enable_only(moderngl.DEPTH_TEST)
            gl.depth_func = "=="
            visibility.bind()
            scene_buffers.bind_materials()
            self._pack.bind()
            set_uniforms(
                self._program,
                {"network_blocks": self._pack.hidden_blocks, "view_projection": matrix.T.astype("<f4").tobytes()},
            )
            scene_buffers.draw(self._program, self._program)
        finally:
            gl.depth_func = "<"
            framebuffer.release()
