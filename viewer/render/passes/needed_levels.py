"""Which mips of which textures the visible pixels read: what has to be on the GPU."""

import numpy as np

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.render.resources.layout import GROUP_SIDE, StorageBinding
from viewer.render.resources.pack_buffers import PackBuffers
from viewer.render.resources.visibility_buffer import PlaneReading, VisibilityInputs

NOT_VISIBLE = 127


class NeededLevelsPass:
    """Inputs: visibility buffer, materials, a pack's tables. Output, read back: the finest mip that is visible, by texture."""

    def __init__(
        self, context: GraphicsContext, programs: ProgramFactory, textures: int, reading: PlaneReading
    ) -> None:
        self._gl = context.gl
        self._program = programs.compute("passes/needed_levels/needed_levels.comp", reading.defines())
        self._none = np.full(max(1, textures), NOT_VISIBLE, np.int32).tobytes()
        self._levels = context.memory.buffer("finest mips in sight", self._none)

    @property
    def bytes_on_gpu(self) -> int:
        """Size of the buffer."""
        return self._levels.size

    def run(self, inputs: VisibilityInputs, buffers: PackBuffers) -> dict[int, int]:
        """Finest mip by texture id; textures that are not visible are absent."""
        inputs.bind()
        buffers.bind_records()
        self._levels.write(self._none)
        self._levels.bind_to_storage_buffer(int(StorageBinding.RESULTS))
        self._program.run(*(-(-side // GROUP_SIDE) for side in inputs.visibility.size))
        self._gl.memory_barrier()
        levels = np.frombuffer(self._levels.read(), np.int32)
        return {int(index): int(levels[index]) for index in np.nonzero(levels < NOT_VISIBLE)[0]}

    def release(self) -> None:
        """Free the buffer."""
        self._levels.release()
