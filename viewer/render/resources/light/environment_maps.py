"""An environment on the GPU: the panorama itself, and what is prefiltered from it (viewer/lighting/prefilter.py)."""

import math

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext
from viewer.gl.program import set_uniforms
from viewer.lighting.brdf import brdf_table
from viewer.lighting.prefilter import PrefilterSize
from viewer.render.resources.layout import TextureUnit

LINEAR = (moderngl.LINEAR, moderngl.LINEAR)


class EnvironmentMaps:
    """Textures of one environment; `PrefilterPass` writes `maps`."""

    def __init__(self, context: GraphicsContext, size: PrefilterSize, panorama_width: int) -> None:
        """`panorama_width`: texels across, twice the height. Raises GpuMemoryError."""
        self.size, self.panorama_width = size, panorama_width
        what, memory = f"an environment of {panorama_width} x {panorama_width // 2}", context.memory
        table = np.ascontiguousarray(brdf_table(), np.float32)
        with memory.transaction():
            self.panorama = memory.texture(what, (panorama_width, panorama_width // 2), 3, dtype="f2", alignment=2)
            # Between maps are texels that nothing writes; what is kept on disk must not depend on what memory held before.
            zeros = bytes(16 * math.prod(size.texture_size))
            self.maps = memory.texture(what, size.texture_size, 4, zeros, dtype="f4")
            self.table = memory.texture(what, (table.shape[1], table.shape[0]), 2, table.tobytes(), dtype="f4")
        for texture in (self.panorama, self.maps, self.table):
            texture.filter = LINEAR
            texture.repeat_x = texture.repeat_y = False
        self.panorama.repeat_x = True

    @property
    def tiles(self) -> NDArray[np.float32]:
        """[levels + 1, 4]: left, top, width and height of each map's first face without its border, in shares of `maps`."""
        width, height = self.size.texture_size
        rows = [
            (1.0 / width, (top + 1) / height, side / width, side / height)
            for top, side in zip(self.size.tops, self.size.all_sides, strict=True)
        ]
        return np.array(rows, np.float32)

    def write_panorama(self, pixels: NDArray[np.float32]) -> None:
        """Replace the panorama by `pixels` [H, 2 H, 3], row 0 on top."""
        self.panorama.write(np.ascontiguousarray(pixels, np.float16).tobytes())

    def bind(self, program: moderngl.Program, turn: float) -> None:
        """Bind all for shaders/lighting/environment.glsl, turned by `turn` degrees from north towards east."""
        self.panorama.use(int(TextureUnit.PANORAMA))
        self.maps.use(int(TextureUnit.ENVIRONMENT))
        self.table.use(int(TextureUnit.BRDF_TABLE))
        values = {
            "environment_tiles": self.tiles.tobytes(),
            "face_gap": 2.0 / self.size.texture_size[0],
            "environment_turn": (math.cos(math.radians(turn)), math.sin(math.radians(turn))),
        }
        set_uniforms(program, values)

    def release(self) -> None:
        """Free the textures."""
        for texture in (self.panorama, self.maps, self.table):
            texture.release()
