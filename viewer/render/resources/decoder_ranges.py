"""The weights of each decoder as a buffer range of its own, so that a shader can read one decoder at constant places."""

import moderngl
import numpy as np

from ntc.codec.rescale import stored_pack
from ntc.pack.model import Pack
from viewer.gl.context import GraphicsContext
from viewer.render.resources.layout import StorageBinding, UniformBinding
from viewer.render.resources.network import DEFAULT_NETWORK, NetworkConfig, NetworkLayout, weight_bytes
from viewer.state.view_state import Precision

LARGEST_ALIGNMENT = 256
"""Bytes: OpenGL lets no implementation ask for more (OpenGL 4.3, table 23.57)."""


class DecoderRanges:
    """All decoders of a pack, each at an aligned place: a uniform buffer, or storage where a decoder is too large for one."""

    def __init__(
        self,
        context: GraphicsContext,
        pack: Pack,
        precision: Precision,
        network: NetworkConfig = DEFAULT_NETWORK,
        weights_in_image: bool | None = None,
    ) -> None:
        """`network` is what the programs are generated for, `weights_in_image` as for the PackBuffers: then a range holds
        only where the decoder begins among all weights."""
        self.pixels = network.pixels
        blocks = NetworkLayout(pack.config).blocks
        in_image = context.features.weights_in_image if weights_in_image is None else weights_in_image
        if in_image:
            parts = [np.array([number * blocks, 0, 0, 0], "<i4").tobytes() for number in range(len(pack.decoders))]
            self._size = 16
        else:
            decoders = stored_pack(pack, precision).decoders
            parts = [weight_bytes(pack.config, [decoder], [], precision) for decoder in decoders]
            # Halves are read in pairs of blocks, and there may be an odd number of those.
            self._size = blocks * 16 if precision == "fp32" else (blocks + 1) // 2 * 16
        self._stride = -(-self._size // LARGEST_ALIGNMENT) * LARGEST_ALIGNMENT
        table = np.zeros((max(1, len(parts)), self._stride), np.uint8)
        for row, part in zip(table, parts, strict=False):
            row[: len(part)] = np.frombuffer(part, np.uint8)
        self.in_storage = not in_image and self._size > context.features.uniform_block_bytes
        self._buffer: moderngl.Buffer = context.memory.buffer("decoders", table.tobytes())

    @property
    def bytes_on_gpu(self) -> int:
        """Size of the buffer."""
        return self._buffer.size

    def bind(self, decoder: int) -> None:
        """Let shaders read this decoder."""
        place = {"offset": decoder * self._stride, "size": self._size}
        if self.in_storage:
            self._buffer.bind_to_storage_buffer(int(StorageBinding.DECODER), **place)
        else:
            self._buffer.bind_to_uniform_block(int(UniformBinding.DECODER), **place)

    def release(self) -> None:
        """Free the buffer."""
        self._buffer.release()
