"""Decode path `binned`: pixels are sorted by decoder, and each decoder decodes its own, several in each invocation.

The counts never come back to the CPU: dispatches take their size from the bins.
"""

from collections.abc import Sequence

import moderngl
import numpy as np

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.passes.decode_pass import DecodePass, filter_defines
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.decoder_ranges import DecoderRanges
from viewer.render.resources.layout import BIN_GROUP, BIN_RECORD, GROUP_SIDE, BinBinding, ImageUnit
from viewer.render.resources.pack_buffers import PackBuffers
from viewer.render.resources.visibility_buffer import PlaneReading, VisibilityInputs
from viewer.state.view_state import TexelFilter

FOLDER = "passes/decode_binned"
PIXEL_BYTES = 4


class DecodeBinnedPass(DecodePass):
    """Count, scan and scatter fill the bins; then one indirect dispatch for each decoder that may be visible."""

    name = "decode_binned"

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        buffers: PackBuffers,
        ranges: DecoderRanges,
        reading: PlaneReading,
        texel_filter: TexelFilter = "exact",
    ) -> None:
        self._gl, self._memory, self._buffers, self._ranges = context.gl, context.memory, buffers, ranges
        self._bin_count = len(buffers.pack.decoders)
        defines = {**buffers.defines, **filter_defines(texel_filter), **ranges.defines}
        sorting = {**reading.defines(), "SHARED_SUMS": int(context.features.shared_sums)}
        self._count = programs.compute(f"{FOLDER}/count.comp", sorting)
        self._scan = programs.compute(f"{FOLDER}/scan.comp")
        self._scatter = programs.compute(f"{FOLDER}/scatter.comp", sorting)
        self._decode = programs.compute(f"{FOLDER}/decode.comp", {**reading.defines(), **defines})
        what = "path binned"
        with self._memory.transaction():
            self._bins = self._memory.buffer(what, np.zeros(max(1, self._bin_count), BIN_RECORD).tobytes())
            self._pixels = self._memory.buffer(what, reserve=PIXEL_BYTES)

    def run(self, inputs: VisibilityInputs, target: ColorTarget) -> None:
        """Decode the whole picture."""
        needed = target.size[0] * target.size[1] * PIXEL_BYTES
        self._pixels = self._memory.grown("pixels of path binned", self._pixels, needed, storage=True)
        inputs.bind()
        self._buffers.bind()
        target.texture.bind_to_image(int(ImageUnit.TARGET), read=False, write=True)
        self._bins.bind_to_storage_buffer(int(BinBinding.BINS))
        self._pixels.bind_to_storage_buffer(int(BinBinding.BIN_PIXELS))
        blocks = tuple(-(-side // GROUP_SIDE) for side in target.size)
        self._count.run(*blocks)
        self._gl.memory_barrier()
        set_uniforms(self._scan, {"bin_count": self._bin_count, "pixels_per_group": BIN_GROUP * self._ranges.pixels})
        self._scan.run(1)
        self._gl.memory_barrier()
        self._scatter.run(*blocks)
        self._gl.memory_barrier()
        set_uniforms(self._decode, {"network_blocks": self._buffers.network_blocks, "sample_number": inputs.sample})
        decoders = np.unique(self._buffers.decoder_of_texture[list(inputs.textures)])
        for decoder in decoders[decoders >= 0].tolist():
            self._ranges.bind(decoder)
            set_uniforms(self._decode, {"bin": decoder})
            self._decode.run_indirect(self._bins, decoder * BIN_RECORD.itemsize)
        self._gl.memory_barrier()

    def bins(self) -> bytes:
        """BIN_RECORD of every decoder after the last frame: reads them back, which drawing never does."""
        content: bytes = self._bins.read()
        return content

    def own_buffers(self) -> Sequence[moderngl.Buffer]:
        """Bins and the list of pixels."""
        return self._bins, self._pixels
