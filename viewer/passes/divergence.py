"""The divergence pass: distinct decoders of each block, from the visibility buffer and a texture -> decoder table."""

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc import divergence
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.passes.layout import GROUP_SIDE, ImageUnit, StorageBinding
from viewer.passes.visibility import VisibilityTarget

BLOCK = divergence.BLOCK[::-1]
"""(width, height) of a block in pixels."""


class DivergenceTarget:
    """D of every block of a picture of `size` (width, height) pixels; row 0 is at the top."""

    def __init__(self, context: GraphicsContext, size: tuple[int, int], block: tuple[int, int] = BLOCK) -> None:
        self.picture = size
        self.block = block
        self.size = (-(-size[0] // block[0]), -(-size[1] // block[1]))
        self.texture = context.gl.texture(self.size, 1, dtype="u4")
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def read(self) -> NDArray[np.uint16]:
        """[ceil(H / block height), ceil(W / block width)] uint16, as `ntc.divergence.divergence_map`."""
        words = np.frombuffer(self.texture.read(), np.uint32)
        return words.reshape(self.size[1], self.size[0]).astype(np.uint16)

    def release(self) -> None:
        """Free the texture."""
        self.texture.release()


class DecoderTable:
    """Decoder of every texture of a scene under one grouping; -1 where nothing is decoded."""

    def __init__(self, context: GraphicsContext, decoders: Sequence[int]) -> None:
        numbers = np.array([*decoders, -1], "<i4")
        self._buffer = context.gl.buffer(numbers.tobytes())

    def bind(self) -> None:
        """Bind to its storage binding."""
        self._buffer.bind_to_storage_buffer(int(StorageBinding.DECODERS))

    def release(self) -> None:
        """Free the buffer."""
        self._buffer.release()


class DivergencePass:
    """Inputs: visibility buffer, a decoder table. Output: a DivergenceTarget."""

    def __init__(self, context: GraphicsContext, programs: ProgramFactory) -> None:
        self._gl = context.gl
        self._programs = programs

    def run(self, visibility: VisibilityTarget, table: DecoderTable, target: DivergenceTarget) -> None:
        """Count the decoders of every block."""
        defines = {"BLOCK_WIDTH": target.block[0], "BLOCK_HEIGHT": target.block[1]}
        program = self._programs.compute("passes/divergence/divergence.comp", defines)
        visibility.bind()
        table.bind()
        target.texture.bind_to_image(int(ImageUnit.DIVERGENCE), read=False, write=True)
        set_uniforms(program, {"picture": target.picture})
        program.run(*(-(-side // GROUP_SIDE) for side in target.size))
        self._gl.memory_barrier()
