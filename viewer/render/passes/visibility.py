"""The visibility pass: which surface each pixel shows. All later passes read only this."""

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.render.resources.visibility_buffer import VisibilityTarget


class VisibilityPass:
    """Inputs: scene buffers with an uploaded draw list, a matrix. Output: a VisibilityTarget."""

    def __init__(self, context: GraphicsContext, programs: ProgramFactory, scene_buffers: SceneBuffers) -> None:
        self._gl = context.gl
        self._programs = programs
        self._scene_buffers = scene_buffers

    def _program(self, target: VisibilityTarget, alpha_test: bool) -> moderngl.Program:
        defines = {**target.content.defines(), "ALPHA_TEST": int(alpha_test)}
        return self._programs.program("common/scene.vert", "passes/visibility/visibility.frag", defines)

    def run(self, target: VisibilityTarget, matrix: NDArray[np.float64]) -> None:
        """Draw the uploaded list with the world-to-clip `matrix` [4, 4]."""
        gl = self._gl
        target.clear()
        gl.enable_only(moderngl.DEPTH_TEST)
        gl.depth_func = "<"
        self._scene_buffers.bind_materials()
        opaque, alpha_tested = (self._program(target, alpha_test) for alpha_test in (False, True))
        for program in (opaque, alpha_tested):
            program["view_projection"].write(matrix.T.astype("<f4").tobytes())  # type: ignore[union-attr]
        self._scene_buffers.draw(opaque, alpha_tested)
