"""Decode path `deferred`: a compute pass decodes every visible pixel once, over the visibility buffer."""

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.passes.decode_pass import DecodePass, filter_defines
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.decoder_ranges import DecoderRanges
from viewer.render.resources.layout import GROUP_SIDE, ImageUnit
from viewer.render.resources.pack_buffers import PackBuffers
from viewer.render.resources.visibility_buffer import PlaneReading, VisibilityInputs
from viewer.state.view_state import TexelFilter


class DecodeDeferredPass(DecodePass):
    """Where the scene's textures have one decoder between them (`shared_decoder`), an invocation decodes several pixels.

    `ranges` may be None where they have not.
    """

    name = "decode_deferred"

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        buffers: PackBuffers,
        ranges: DecoderRanges | None,
        reading: PlaneReading,
        shared_decoder: int | None,
        texel_filter: TexelFilter = "exact",
    ) -> None:
        self._gl = context.gl
        self._buffers, self._shared_decoder = buffers, shared_decoder
        self._ranges = ranges if shared_decoder is not None else None
        defines = {**reading.defines(), **buffers.defines, **filter_defines(texel_filter)}
        if self._ranges is None:
            self._program = programs.compute("passes/decode_deferred/decode.comp", defines)
        else:
            shared = {**defines, **self._ranges.defines}
            self._program = programs.compute("passes/decode_deferred/decode_shared.comp", shared)

    def run(self, inputs: VisibilityInputs, target: ColorTarget) -> None:
        """Decode the whole picture."""
        inputs.bind()
        self._buffers.bind()
        target.texture.bind_to_image(int(ImageUnit.TARGET), read=False, write=True)
        set_uniforms(self._program, {"network_blocks": self._buffers.network_blocks, "sample_number": inputs.sample})
        rows = GROUP_SIDE
        if self._ranges is not None and self._shared_decoder is not None:
            self._ranges.bind(self._shared_decoder)
            rows = GROUP_SIDE * self._ranges.pixels
        self._program.run(-(-target.size[0] // GROUP_SIDE), -(-target.size[1] // rows))
        self._gl.memory_barrier()
