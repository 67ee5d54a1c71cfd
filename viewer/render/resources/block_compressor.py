"""Compression of texels on the GPU to the blocks that hardware samples: BC7, BC5 and BC4."""

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext
from viewer.gl.context_loss import checks_context
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.gl.texture_arrays import GpuBlockFormat, blocks_bytes
from viewer.render.resources.layout import TEXEL_GROUP, StorageBinding, TextureUnit


class BlockCompressor:
    """Compressor of one format. Each invocation of a compute shader compresses one block."""

    def __init__(
        self, context: GraphicsContext, programs: ProgramFactory, block_format: GpuBlockFormat, from_tiles: bool
    ) -> None:
        """Compile the shader. `from_tiles`: texels lie on the pages of a tile atlas, else in layer 0 of a texture array.

        Raises ShaderError.
        """
        self._gl, self._memory, self.block_format = context.gl, context.memory, block_format
        defines = {"BLOCK_FORMAT": int(block_format[2]), "FROM_TILES": int(from_tiles)}
        self._program = programs.compute("passes/compress/compress.comp", defines)

    def run(
        self,
        size: tuple[int, int],
        blocks: moderngl.Buffer,
        errors: moderngl.Buffer,
        first_component: int = 0,
        error_place: int = 0,
        first_byte: int = 0,
        tiles: tuple[int, int] = (0, 1),
        has_alpha: bool = True,
    ) -> None:
        """Write the blocks of `size` texels of the array that is bound to TextureUnit.ATLAS, row by row, and add their errors.

        `errors`: [places, 2] uint32 sums of squared errors of blocks, in steps of 1/255: of their low 11 bits, and of the bits above.
        `first_component` is for BC5 and BC4, `has_alpha` for BC7. `tiles`: page of the first tile, and number of tiles in a row.
        """
        blocks.bind_to_storage_buffer(int(StorageBinding.RESULTS))
        errors.bind_to_storage_buffer(int(StorageBinding.DECODERS))
        places = {"first_component": first_component, "error_place": error_place, "first_word": first_byte // 4}
        set_uniforms(self._program, {"size": size, "tiles": tiles, "has_alpha": int(has_alpha), **places})
        groups = -(-(-(-size[0] // 4) * -(-size[1] // 4)) // TEXEL_GROUP)
        self._program.run(*self._memory.limits.rows_of_work_groups(groups))
        self._gl.memory_barrier()


def total_errors(words: NDArray[np.uint32]) -> NDArray[np.float64]:
    """Return [places] float64 squared errors in steps of 1/255 from the sums [places, 2] of `BlockCompressor.run`."""
    return words[:, 0].astype(np.float64) + 2048.0 * words[:, 1].astype(np.float64)


class ImageCompressor:
    """Compressor of images in CPU memory by the same shaders, for exports."""

    def __init__(self, context: GraphicsContext, programs: ProgramFactory) -> None:
        self._context, self._programs, self.reset = context, programs, context.reset
        self._compressors: dict[GpuBlockFormat, BlockCompressor] = {}

    @checks_context
    def blocks(self, rgba: NDArray[np.uint8], block_format: GpuBlockFormat, first_component: int = 0) -> bytes:
        """Return the blocks of `rgba` [H, W, 4]; blocks over the edge are padded with the last texels.

        `first_component` is for BC5 and BC4. Raises GpuMemoryError, ShaderError.
        """
        if block_format not in self._compressors:
            self._compressors[block_format] = BlockCompressor(self._context, self._programs, block_format, False)
        memory, gl = self._context.memory, self._context.gl
        height, width = rgba.shape[:2]
        size = (width, height)
        memory.check_size("image to compress", size)
        data = np.ascontiguousarray(rgba)
        with memory.transaction():
            what = "image to compress"
            texels = memory.made(what, data.nbytes, lambda: gl.texture_array((width, height, 1), 4, data))
            blocks = memory.buffer(what, reserve=blocks_bytes(size, block_format), storage=True)
            errors = memory.buffer(what, bytes(8))
        try:
            texels.use(int(TextureUnit.ATLAS))
            self._compressors[block_format].run(size, blocks, errors, first_component)
            return bytes(blocks.read())
        finally:
            for made in (texels, blocks, errors):
                made.release()
