"""A pack on the GPU: records, latents and weights in storage buffers."""

from collections.abc import Sequence

import moderngl
import numpy as np

from ntc.config import CodecConfig
from ntc.latents import latent_levels
from ntc.pack import Adapter, Pack
from ntc.quantize import packed_cells
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.passes.layout import (
    LEVEL_RECORD,
    WEIGHT_COLUMN_BITS,
    ImageUnit,
    StorageBinding,
    cell_words,
    codec_layout_glsl,
    texture_record,
)
from viewer.passes.network import NetworkLayout, network_glsl, shared_network_glsl, weight_bytes
from viewer.passes.network_config import DEFAULT_NETWORK, NetworkConfig
from viewer.passes.precision import precision_defines
from viewer.view_state import Precision


def _cell_words(stored: np.ndarray, config: CodecConfig) -> np.ndarray:
    """[cells, words] uint32: the cells as files hold them, padded to whole words."""
    packed = packed_cells(stored, config.latent_bits)
    padding = 4 * cell_words(config) - packed.shape[1]
    return np.ascontiguousarray(np.pad(packed, ((0, 0), (0, padding)))).view("<u4")


class PackBuffers:
    """Buffers of one pack for a table of textures: slot i is the pack's texture `texture_index[i]`, or none for -1."""

    def __init__(
        self,
        context: GraphicsContext,
        pack: Pack,
        texture_index: Sequence[int],
        precision: Precision,
        emulate_half: bool = False,
        weights_in_image: bool | None = None,
    ) -> None:
        """`weights_in_image` None: on software renderers, which fetch from images several times faster than from buffers."""
        config = pack.config
        network = NetworkLayout(config)
        self.hidden_blocks = network.hidden_blocks
        self.precision = precision
        records = np.zeros(max(1, len(texture_index)), texture_record(config))
        records["decoder"] = -1
        levels: list[tuple[int, ...]] = []
        latents: list[np.ndarray] = []
        adapters: list[Adapter] = []
        first_cell = 0
        # Only what the table names is uploaded: latents of other scenes' textures cost nothing.
        for slot, index in enumerate(texture_index):
            if index < 0:
                continue
            texture = pack.textures[index]
            pyramid = latent_levels(texture.width, texture.height, config)
            records[slot]["first_level"], records[slot]["levels"] = len(levels), len(pyramid)
            records[slot]["decoder"], records[slot]["channels"] = texture.group, texture.channels
            records[slot]["srgb"] = texture.color_space == "srgb"
            records[slot]["adapter"] = len(pack.decoders) * network.blocks + len(adapters) * network.adapter_blocks
            if texture.adapter is not None:
                adapters.append(texture.adapter)
            records[slot]["scale"] = texture.scale.reshape(-1, 4)
            records[slot]["offset"] = texture.offset.reshape(-1, 4)
            for level in pyramid:
                sizes = (level.width, level.height, level.texel_width, level.texel_height)
                levels.append((*sizes, first_cell + level.first_cell, 0, 0, 0))
            latents.append(_cell_words(texture.latents, config))
            first_cell += len(texture.latents)
        cells = np.concatenate(latents) if latents else np.zeros((1, cell_words(config)), "<u4")
        gl = context.gl
        self._buffers: dict[StorageBinding, moderngl.Buffer] = {
            StorageBinding.TEXTURES: gl.buffer(records.tobytes()),
            StorageBinding.LEVELS: gl.buffer(np.array(levels or [(0,) * 8], LEVEL_RECORD).tobytes()),
            StorageBinding.LATENTS: gl.buffer(np.ascontiguousarray(cells).tobytes()),
        }
        weights = weight_bytes(config, pack.decoders, adapters, precision)
        self._weight_image: moderngl.Texture | None = None
        if context.info.is_software if weights_in_image is None else weights_in_image:
            self._weight_image = weight_image(gl, weights, precision)
        else:
            self._buffers[StorageBinding.WEIGHTS] = gl.buffer(weights)
        self.weights_in_image = self._weight_image is not None
        self.defines = {
            **precision_defines(context, precision, emulate_half),
            "WEIGHTS_IN_IMAGE": int(self.weights_in_image),
        }
        own_weights = len(weights) if self._weight_image is not None else 0
        self.bytes_on_gpu = sum(buffer.size for buffer in self._buffers.values()) + own_weights

    def bind(self) -> None:
        """Bind all buffers to their storage bindings."""
        for binding, buffer in self._buffers.items():
            buffer.bind_to_storage_buffer(int(binding))
        if self._weight_image is not None:
            self._weight_image.bind_to_image(int(ImageUnit.WEIGHTS), read=True, write=False)

    def release(self) -> None:
        """Free the buffers."""
        for buffer in self._buffers.values():
            buffer.release()
        if self._weight_image is not None:
            self._weight_image.release()


def weight_image(gl: moderngl.Context, weights: bytes, precision: Precision) -> moderngl.Texture:
    """`weights` as an image in rows of 2^WEIGHT_COLUMN_BITS blocks of four."""
    kind = "f4" if precision == "fp32" else "f2"
    block_bytes = 4 * np.dtype(kind).itemsize
    rows = -(-len(weights) // (block_bytes << WEIGHT_COLUMN_BITS))
    padded = weights.ljust(rows * (block_bytes << WEIGHT_COLUMN_BITS), b"\0")
    return gl.texture((1 << WEIGHT_COLUMN_BITS, rows), 4, padded, dtype=kind)


def codec_programs(factory: ProgramFactory, pack: Pack, network: NetworkConfig = DEFAULT_NETWORK) -> ProgramFactory:
    """`factory` with the includes that the decoding shaders need for the codec of `pack`."""
    return factory.with_generated(
        {
            "generated/codec.glsl": codec_layout_glsl(pack.config),
            "generated/network.glsl": network_glsl(pack.config),
            "generated/shared_network.glsl": shared_network_glsl(pack.config, network),
        }
    )
