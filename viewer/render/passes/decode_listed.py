"""Decode path `binned` by a back end that is not in GLSL: every pixel's texel is listed, and the back end sorts them itself."""

from collections.abc import Sequence

import moderngl

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.render.passes.decode_pass import DecodePass, filter_defines
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.layout import ImageUnit
from viewer.render.resources.pack_buffers import PackBuffers
from viewer.render.resources.texel_lists import ListDecoder, TexelLists
from viewer.render.resources.visibility_buffer import PlaneReading, VisibilityInputs
from viewer.state.view_state import TexelFilter

FOLDER = "passes/decode_listed"


class DecodeListedPass(DecodePass):
    """List the pixels' texels, decode them elsewhere, and write the plane."""

    name = "decode_binned"

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        buffers: PackBuffers,
        decoder: ListDecoder,
        reading: PlaneReading,
        texel_filter: TexelFilter = "exact",
    ) -> None:
        self._buffers = buffers
        defines = {**reading.defines(), **buffers.defines, **filter_defines(texel_filter)}
        self._lists = TexelLists(context, programs, FOLDER, defines, decoder, reading.plane)

    def run(self, inputs: VisibilityInputs, target: ColorTarget) -> None:
        """Decode the whole picture. Waits for the back end, and it for OpenGL."""
        inputs.bind()
        self._buffers.bind()
        target.texture.bind_to_image(int(ImageUnit.TARGET), read=False, write=True)
        self._lists.run(target.size[0] * target.size[1], {"sample_number": inputs.sample})

    def own_buffers(self) -> Sequence[moderngl.Buffer]:
        """The lists."""
        return self._lists.buffers

    def release(self) -> None:
        """Free the lists."""
        self._lists.release()
