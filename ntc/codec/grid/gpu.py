"""Packs of codec `grid` as shaders/ntc/grid.glsl reads them: cells of latents, and the network's weights in a precision."""

from typing import cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import LARGEST_HALF, Precision
from ntc.codec.gpu import DecoderVariant, GpuTables, StoredRows, TextureFields
from ntc.codec.grid.config import LOD_INPUT_SCALE, GridConfig
from ntc.codec.grid.model import GridDecoder, GridTexture
from ntc.codec.grid.network import NetworkLayout, arrange_adapter, network_glsl, shared_network_glsl
from ntc.codec.grid.quantize import packed_cells
from ntc.codec.latents import latent_levels
from ntc.codec.model import Decoder, EncodedTexture


class GridTables(GpuTables):
    """Weights as fp32 or, for every other precision, as halves; those beyond the range of halves become the largest one."""

    shares_decoders = True
    filters_texels = False
    shader = "ntc/grid.glsl"

    def __init__(self, settings: GridConfig, precision: Precision) -> None:
        super().__init__(settings)
        self._config, self.precision = settings, precision
        self.number_type = "f4" if precision == "fp32" else "f2"
        self._network = NetworkLayout(settings)
        self.decoder_blocks, self.adapter_blocks = self._network.blocks, self._network.adapter_blocks
        self.loop_length = self._network.hidden_blocks
        self.row_words = -(-settings.cell_bytes // 4)

    def _data(self, numbers: NDArray[np.float32]) -> bytes:
        if self.precision != "fp32":
            return np.clip(numbers, -LARGEST_HALF, LARGEST_HALF).astype("<f2").tobytes()
        return numbers.astype("<f4").tobytes()

    def decoder_data(self, decoder: Decoder) -> bytes:
        return self._data(self._network.arrange(cast(GridDecoder, decoder)))

    def adapter_data(self, texture: EncodedTexture) -> bytes:
        adapter = cast(GridTexture, texture).adapter
        return b"" if adapter is None else self._data(arrange_adapter(adapter))

    @property
    def record_fields(self) -> TextureFields:
        words = self._config.latent_channels // 4
        return (("scale", "<f4", (words, 4)), ("offset", "<f4", (words, 4)))

    def fill_own_fields(self, record: np.void, texture: EncodedTexture) -> None:
        own = cast(GridTexture, texture)
        record["scale"] = own.scale.reshape(-1, 4)
        record["offset"] = own.offset.reshape(-1, 4)

    def level_rows(self, texture: EncodedTexture) -> tuple[StoredRows, ...]:
        levels = latent_levels(texture.width, texture.height, self._config)
        return tuple(StoredRows(level.first_cell, level.cells) for level in levels)

    def latent_words(self, texture: EncodedTexture, rows: slice) -> NDArray[np.uint32]:
        """Cells as files hold them, padded to whole words."""
        packed = packed_cells(cast(GridTexture, texture).latents[rows], self._config.latent_bits)
        padding = 4 * self.row_words - packed.shape[1]
        return np.ascontiguousarray(np.pad(packed, ((0, 0), (0, padding)))).view("<u4")

    def shape_text(self) -> str:
        config = self._config
        layers = "-".join(str(inputs) for _, inputs in config.layer_shapes)
        adapters = (
            " with adapters and outputs" if config.adapter_output else " with adapters" if config.adapters else ""
        )
        return f"{layers}-{config.output_channels}{adapters}, {config.latent_channels} x {config.latent_bits} bits"

    def defines(self) -> list[str]:
        config = self._config
        values = {
            "LATENT_WORDS": config.latent_channels // 4,
            "LATENT_BITS": config.latent_bits,
            "LATENT_CHANNELS": config.latent_channels,
            "POSITIONAL_OCTAVES": config.positional_octaves,
            "POSITIONAL_INPUTS": config.positional_inputs,
            "LOD_INPUTS": config.lod_inputs,
            "LOD_INPUT_SCALE": LOD_INPUT_SCALE,
            "DECODER_INPUTS": config.decoder_inputs,
        }
        return [f"#define {name} {value}" for name, value in values.items()]

    def includes(self, variant: DecoderVariant) -> dict[str, str]:
        return {
            **super().includes(variant),
            "generated/network.glsl": network_glsl(self._config),
            "generated/shared_decoder.glsl": shared_network_glsl(self._config, variant),
        }
