"""The weights of each decoder as a buffer range of its own, so that a shader can read one decoder at constant places."""

from collections.abc import Collection

import moderngl
import numpy as np

from ntc.codec.gpu import DecoderVariant, DecodingUniform
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from viewer.gl.context import GraphicsContext
from viewer.render.resources.variant import default_variant
from viewer.state.view_state import Precision

LARGEST_ALIGNMENT = 256
"""Bytes: OpenGL lets no implementation ask for more (OpenGL 4.3, table 23.57)."""
SHARED_BYTES = 1 << 15
"""Of shared memory, which every implementation has (likewise, table 23.64)."""


class DecoderRanges:
    """All decoders of a pack, each at an aligned place of a uniform buffer: its weights, or where they are among all weights."""

    def __init__(
        self, context: GraphicsContext, pack: Pack, precision: Precision, variant: DecoderVariant | None = None
    ) -> None:
        """`variant` is what the programs are generated for; None: the default of the device."""
        codec = codec_of(pack.config)
        tables = codec.gpu_tables(pack.config, precision)
        variant = variant or default_variant(context, pack.config)
        self.pixels = variant.pixels
        self._memory, self._tables = context.memory, tables
        blocks, block_bytes = tables.decoder_blocks, tables.block_bytes
        # Halves are read in pairs of blocks, and there may be an odd number of those.
        stored = blocks * 16 if precision == "fp32" else (blocks + 1) // 2 * 16
        fits = {
            "uniforms": stored <= context.features.uniform_block_bytes,
            "shared": blocks * block_bytes <= SHARED_BYTES,
        }
        place = variant.weights if tables.shares_decoders and fits.get(variant.weights, True) else "storage"
        self.defines = {"DECODER_PLACE": {"uniforms": 0, "shared": 2}.get(place, 1)}
        """Of the shaders that read ranges (shaders/ntc/decoder_weights.glsl)."""
        self._places_only = place != "uniforms"
        self._size = 16 if self._places_only else stored
        self._stride = -(-self._size // LARGEST_ALIGNMENT) * LARGEST_ALIGNMENT
        self._count = len(pack.decoders)
        self._buffer = self._make(codec.stored_pack(pack, precision))

    def _range(self, pack: Pack, decoder: int) -> bytes:
        if self._places_only:
            start = self._tables.first_block + decoder * self._tables.decoder_blocks
            return np.array([start, 0, 0, 0], "<i4").tobytes()
        return self._tables.decoder_data(pack.decoders[decoder])

    def _make(self, pack: Pack) -> moderngl.Buffer:
        ranges = [self._range(pack, decoder).ljust(self._stride, b"\0") for decoder in range(len(pack.decoders))]
        return self._memory.buffer("decoders", b"".join(ranges) or bytes(self._stride))

    def replace(self, pack: Pack, groups: Collection[int]) -> int:
        """Hold the decoders of `pack`, stored as `Codec.stored_pack` gives it, in which those of `groups` differ; the bytes uploaded.

        Raises GpuMemoryError, with nothing changed.
        """
        if len(pack.decoders) != self._count:
            made = self._make(pack)
            self._buffer.release()
            self._buffer, self._count = made, len(pack.decoders)
            return made.size
        parts = {} if self._places_only else {group: self._range(pack, group) for group in groups}
        for group, part in parts.items():
            self._buffer.write(part, offset=group * self._stride)
        return sum(map(len, parts.values()))

    @property
    def bytes_on_gpu(self) -> int:
        """Size of the buffer."""
        return self._buffer.size

    def bind(self, decoder: int) -> None:
        """Let shaders read this decoder."""
        place = {"offset": decoder * self._stride, "size": self._size}
        self._buffer.bind_to_uniform_block(int(DecodingUniform.DECODER), **place)

    def release(self) -> None:
        """Free the buffer."""
        self._buffer.release()
