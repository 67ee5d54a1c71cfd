"""Decoding of tiles of one plane of a pack into pages of a tile atlas, by compute shaders."""

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.gl.texture_arrays import TileAtlas
from viewer.render.resources.layout import BIN_GROUP, PAGE_SIDE, PAGE_SQUARES, ImageUnit
from viewer.render.resources.pack_buffers import DecoderRanges, PackBuffers
from viewer.render.resources.tile_cache.budget import TILES_AT_ONCE
from viewer.render.resources.visibility_buffer import PlaneReading


class TileDecoder:
    """Decoder of tiles, with their borders, of one plane of a pack."""

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        buffers: PackBuffers,
        ranges: DecoderRanges,
        reading: PlaneReading,
    ) -> None:
        """Compile the usual program; the one for coarse latents is compiled at its first use. Raises ShaderError."""
        self._gl, self._limits = context.gl, context.memory.limits
        self._programs, self._buffers, self._ranges = programs, buffers, ranges
        self._defines = {**reading.defines(), **buffers.defines, **ranges.defines}
        self._program(buffers.decodes_quads)

    def _program(self, by_squares: bool) -> moderngl.ComputeShader:
        """Return the program that decodes squares of 2x2 texels, or single texels."""
        if by_squares and self._buffers.decodes_together:
            return self._programs.compute("passes/decode_cached/decode_together.comp", self._defines)
        defines = {**self._defines, "BY_SQUARES": int(by_squares)}
        return self._programs.compute("passes/decode_cached/decode.comp", defines)

    def run(self, decoders: NDArray[np.int64], too_coarse: NDArray[np.bool_], atlas: TileAtlas) -> None:
        """Decode the tiles that are bound to StorageBinding.REQUESTS as TILE_RECORDs; TileBinding.TILE_ENTRIES gets their pages.

        `decoders` [N]: decoder of each tile, ascending. `too_coarse` [N]: whether the mip's latents are not on the GPU; then texels
        of the next mip are filtered.
        """
        self._buffers.bind()
        atlas.bind_image(int(ImageUnit.ATLAS))
        by_squares = ~too_coarse & self._buffers.decodes_quads
        if not self._buffers.shares_decoders:
            # Programs look up the decoder of each tile, so one dispatch decodes tiles of all decoders.
            decoders = np.zeros_like(decoders)
        starts = np.nonzero(np.diff(2 * decoders + by_squares, prepend=-1))[0].tolist()
        for start, end in zip(starts, [*starts[1:], len(decoders)], strict=True):
            self._ranges.bind(int(decoders[start]))
            program = self._program(bool(by_squares[start]))
            set_uniforms(program, {"network_blocks": self._buffers.network_blocks})
            for first in range(start, end, TILES_AT_ONCE):
                number = min(TILES_AT_ONCE, end - first)
                set_uniforms(program, {"first_tile": first, "tile_count": number})
                program.run(*self._work_groups(number, bool(by_squares[start])))
        self._gl.memory_barrier()

    def _work_groups(self, tiles: int, by_squares: bool) -> tuple[int, int]:
        """Return the (width, height) of the dispatch that decodes `tiles` tiles."""
        if by_squares:
            return tiles, 1 if self._buffers.decodes_together else -(-PAGE_SQUARES // BIN_GROUP)
        groups = -(-tiles * PAGE_SIDE * PAGE_SIDE // (BIN_GROUP * self._ranges.pixels))
        return self._limits.rows_of_work_groups(groups)
