"""The visibility pass: which surface each pixel shows. All later passes read only this."""

from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.resources.scene_buffers import AnyDrawList, SceneBuffers
from viewer.render.resources.visibility_buffer import VisibilityTarget
from viewer.scene.model import Camera


@dataclass(frozen=True)
class CulledScene:
    """Inputs of the visibility pass: the draw list that the scene buffers hold. Equal for equal views of one scene."""

    camera: Camera
    size: tuple[int, int]
    """(width, height) in pixels."""
    matrix: NDArray[np.float64] = field(compare=False)
    """[4, 4] float64, world to clip."""
    draw_list: AnyDrawList = field(compare=False)
    sample: int = 0
    """Number of the pattern of thresholds that BLEND surfaces are drawn against, 0 to 15."""
    coverage: int = 0
    """Version of what textures cover (`SceneBuffers.coverage`)."""


class VisibilityPass:
    """Pass that draws the visibility buffer. Output: a VisibilityTarget."""

    name = "visibility"

    def __init__(self, context: GraphicsContext, programs: ProgramFactory, scene_buffers: SceneBuffers) -> None:
        self._gl = context.gl
        self._programs = programs
        self._scene_buffers = scene_buffers

    def run(self, inputs: CulledScene, output: VisibilityTarget) -> None:
        """Draw the list that the scene buffers hold."""
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
