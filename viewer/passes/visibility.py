"""The visibility pass: what surface is seen at each pixel. All later passes read only this."""

import ctypes

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl import functions as names
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.passes.layout import MATERIAL_SHIFT, TextureUnit
from viewer.passes.scene_buffers import SceneBuffers


class VisibilityTarget:
    """The visibility buffer of one picture size (width, height): two integer textures and depth."""

    def __init__(self, context: GraphicsContext, size: tuple[int, int]) -> None:
        gl = context.gl
        self._functions = context.functions
        self.size = size
        self._first = gl.texture(size, 4, dtype="u4")
        self._second = gl.texture(size, 2, dtype="u4")
        for texture in (self._first, self._second):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.depth = gl.depth_texture(size)
        self.framebuffer = gl.framebuffer([self._first, self._second], self.depth)
        # A software renderer maps fresh memory at its first use: here, not in the first timed pass.
        self.clear()

    def clear(self) -> None:
        """Background everywhere: zero ids, farthest depth."""
        self.framebuffer.use()
        self.framebuffer.clear(depth=1.0)
        # glClear is undefined for integer targets.
        zero = (ctypes.c_uint * 4)()
        for index in (0, 1):
            self._functions("glClearBufferuiv", names.GL_COLOR, index, ctypes.addressof(zero))

    def bind(self) -> None:
        """Bind for reading by `common/visibility.glsl`."""
        self._first.use(int(TextureUnit.SURFACE_FIRST))
        self._second.use(int(TextureUnit.SURFACE_SECOND))

    def _ids(self) -> NDArray[np.uint32]:
        words = np.frombuffer(self._first.read(), np.uint32).reshape(self.size[1], self.size[0], 4)
        return words[::-1, :, 0]

    def texture_ids(self) -> NDArray[np.int32]:
        """[H, W] int32, row 0 on top: texture id of each pixel, -1 where no texture is seen."""
        return (self._ids() & np.uint32((1 << MATERIAL_SHIFT) - 1)).astype(np.int32) - 1

    def materials(self) -> NDArray[np.int32]:
        """[H, W] int32, row 0 on top: material of each pixel, -1 for the background."""
        return (self._ids() >> np.uint32(MATERIAL_SHIFT)).astype(np.int32) - 1

    def release(self) -> None:
        """Free the textures."""
        for part in (self.framebuffer, self._first, self._second, self.depth):
            part.release()


class VisibilityPass:
    """Inputs: scene buffers with an uploaded draw list, a matrix. Output: a VisibilityTarget."""

    def __init__(self, context: GraphicsContext, programs: ProgramFactory, scene_buffers: SceneBuffers) -> None:
        self._gl = context.gl
        self._scene_buffers = scene_buffers
        colors = int(scene_buffers.has_colors)
        self._opaque, self._alpha_tested = (
            programs.program(
                "common/scene.vert",
                "passes/visibility/visibility.frag",
                {"VERTEX_COLORS": colors, "ALPHA_TEST": alpha},
            )
            for alpha in (0, 1)
        )

    def run(self, target: VisibilityTarget, matrix: NDArray[np.float64]) -> None:
        """Draw the uploaded list with the world-to-clip `matrix` [4, 4]."""
        gl = self._gl
        target.clear()
        gl.enable_only(moderngl.DEPTH_TEST)
        gl.depth_func = "<"
        self._scene_buffers.bind_materials()
        for program in (self._opaque, self._alpha_tested):
            program["view_projection"].write(matrix.T.astype("<f4").tobytes())  # type: ignore[union-attr]
        self._scene_buffers.draw(self._opaque, self._alpha_tested)
