"""Decoding single texels and whole images with the GLSL codec, without a scene."""

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import WrapMode
from ntc.codec.gpu import WRAP_CODES, DecoderVariant
from ntc.codec.maps import Plane, plane_channels
from ntc.codec.model import Pack
from ntc.codec.reference import image_of_texels
from viewer.gl.context import GraphicsContext
from viewer.gl.context_loss import checks_context
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.resources.layout import REQUEST_RECORD, TEXEL_GROUP, StorageBinding
from viewer.render.resources.pack_buffers import PackBuffers, codec_programs, scene_programs
from viewer.render.resources.visibility_buffer import PlaneReading
from viewer.state.view_state import Precision

TEXELS_AT_ONCE = 1 << 18


class GlTexelDecoder:
    """Decoder of single texels of one pack in GLSL, the twin of `ntc.codec.reference`."""

    def __init__(
        self,
        context: GraphicsContext,
        pack: Pack,
        precision: Precision = "fp32",
        emulate_half: bool = False,
        programs: ProgramFactory | None = None,
        rescale: bool = True,
        variant: DecoderVariant | None = None,
    ) -> None:
        """Upload the pack. `programs`: factory that several decoders share (None: a new one). `rescale` and `variant` are
        those of PackBuffers."""
        self._context, self.reset = context, context.reset
        self._gl: moderngl.Context = context.gl
        self._memory = context.memory
        self._pack = pack
        if programs is None:
            programs = scene_programs(context)
        self._buffers = PackBuffers(
            context, pack, range(len(pack.textures)), precision, emulate_half, variant, rescale=rescale
        )
        self._programs = codec_programs(programs, pack, self._buffers.variant)

    def decode_texels(
        self, texture_index: int, uv: NDArray[Any], lod: NDArray[Any], wrap: tuple[WrapMode, WrapMode] | None = None
    ) -> NDArray[np.float32]:
        """Return [N, channels] float32 in [0, 1] of all maps at `uv` [N, 2] and `lod` [N]. `wrap` None: the texture's modes."""
        texture = self._pack.textures[texture_index]
        modes = texture.wrap if wrap is None else wrap
        code = texture_index * 16 + WRAP_CODES[modes[0]] * 4 + WRAP_CODES[modes[1]]
        values = np.zeros((len(uv), texture.channels), np.float32)
        for plane, channels in plane_channels(texture.maps, texture.channels).items():
            for start in range(0, len(uv), TEXELS_AT_ONCE):
                part = slice(start, start + TEXELS_AT_ONCE)
                decoded = self._decode(np.asarray(uv[part]), np.asarray(lod[part]), code, plane)
                values[part, list(channels.values())] = decoded[:, list(channels)]
        return values

    @checks_context
    def _decode(self, uv: NDArray[Any], lod: NDArray[Any], code: int, plane: Plane) -> NDArray[np.float32]:
        """Return the plane's components: [N, 4] float32."""
        defines = {**self._buffers.defines, **PlaneReading(plane).defines()}
        program = self._programs.compute("passes/decode_texels/decode.comp", defines)
        requests = np.zeros(len(uv), REQUEST_RECORD)
        requests["uv"], requests["lod"], requests["texture_wrap"] = uv, lod, code
        with self._memory.transaction():
            request_buffer = self._memory.buffer("texels to decode", requests.tobytes())
            result_buffer = self._memory.buffer("decoded texels", reserve=16 * len(uv))
        try:
            self._buffers.bind()
            request_buffer.bind_to_storage_buffer(int(StorageBinding.REQUESTS))
            result_buffer.bind_to_storage_buffer(int(StorageBinding.RESULTS))
            set_uniforms(program, {"count": len(uv), "network_blocks": self._buffers.network_blocks})
            program.run(-(-len(uv) // TEXEL_GROUP))
            self._gl.memory_barrier()
            return np.frombuffer(result_buffer.read(), np.float32).reshape(-1, 4).copy()
        finally:
            request_buffer.release()
            result_buffer.release()

    def decode_image(self, texture_index: int, level: int = 0) -> NDArray[np.uint8]:
        """Return mip `level`, decoded at its texel centres: [h, w, channels] uint8 in the texture's colour space."""
        return image_of_texels(self._pack, texture_index, level, self.decode_texels)

    def release(self) -> None:
        """Free the buffers."""
        self._buffers.release()
