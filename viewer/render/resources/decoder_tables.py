"""What decoders and adapters hold, as bytes of the GPU's weights: one interface for all codecs."""

from typing import Literal, Protocol

import numpy as np

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.maps import PLANES, plane_channels
from ntc.codec.model import Adapter, EncodedTexture, Pack
from viewer.render.resources.block_tables import BlockTables, block_glsl
from viewer.render.resources.network import (
    NetworkLayout,
    network_glsl,
    shared_network_glsl,
    weight_bytes,
)
from viewer.render.resources.variant import DecoderVariant
from viewer.state.view_state import Precision


class DecoderTables(Protocol):
    """Where decoders and adapters of a pack lie, in blocks of four numbers: what all decoders share, decoders, adapters."""

    kind: Literal["f4", "f2", "u4"]
    """Type of the numbers, as moderngl names it."""
    block_bytes: int
    first_block: int
    """Where the first decoder begins."""
    blocks: int
    """Of one decoder."""
    adapter_blocks: int
    loop_length: int
    """What shaders get as `network_blocks`."""

    def everything(self, pack: Pack, adapters: list[Adapter]) -> bytes:
        """All blocks."""

    def of_decoder(self, pack: Pack, group: int) -> bytes:
        """Those of one decoder."""

    def of_adapter(self, pack: Pack, adapter: Adapter) -> bytes:
        """Those of one adapter."""

    def fill_record(self, record: np.void, texture: EncodedTexture) -> None:
        """Write what a texture's latents stand for into its record (`layout.texture_record`)."""


class GridTables:
    """Codec `grid`: the network's weights in the pack's precision."""

    kind: Literal["f4", "f2", "u4"]
    first_block = 0

    def __init__(self, pack: Pack, precision: Precision) -> None:
        network = NetworkLayout(pack.grid_config)
        self._precision = precision
        self.kind = "f4" if precision == "fp32" else "f2"
        self.block_bytes = 16 if precision == "fp32" else 8
        self.blocks, self.adapter_blocks = network.blocks, network.adapter_blocks
        self.loop_length = network.hidden_blocks

    def everything(self, pack: Pack, adapters: list[Adapter]) -> bytes:
        """All blocks."""
        return weight_bytes(pack.grid_config, pack.grid_decoders, adapters, self._precision)

    def of_decoder(self, pack: Pack, group: int) -> bytes:
        """Those of one decoder."""
        return weight_bytes(pack.grid_config, [pack.grid_decoders[group]], [], self._precision)

    def of_adapter(self, pack: Pack, adapter: Adapter) -> bytes:
        """Those of one adapter."""
        return weight_bytes(pack.grid_config, [], [adapter], self._precision)

    def fill_record(self, record: np.void, texture: EncodedTexture) -> None:
        """Write the texture's value range into its record."""
        record["scale"] = texture.scale.reshape(-1, 4)
        record["offset"] = texture.offset.reshape(-1, 4)


class BlockPackTables(BlockTables):
    """Codec `block`: tables of the transform, the same for every precision."""

    def everything(self, pack: Pack, _adapters: list[Adapter]) -> bytes:
        """All blocks."""
        return self.all_bytes(pack.block_decoders)

    def of_decoder(self, pack: Pack, group: int) -> bytes:
        """Those of one decoder."""
        return self.decoder_bytes(pack.block_decoders[group])

    def of_adapter(self, _pack: Pack, _adapter: Adapter) -> bytes:
        """Block packs have no adapters."""
        return b""

    def fill_record(self, record: np.void, texture: EncodedTexture) -> None:
        """Write the texture's mean and axes into its record; components that the codec lacks stay 0."""
        first, planes = 0, plane_channels(self._config.maps, self._config.output_channels)
        for place, channels in enumerate(planes.values()):
            components, count = list(channels), len(channels)
            record["mean"][place][components] = texture.offset[list(channels.values())]
            axes = texture.scale[first : first + count * count].reshape(count, count)
            # GLSL reads an axis at a time: a column.
            record["axes"][4 * place : 4 * place + 4][np.ix_(components, components)] = axes.T
            first += count * count


def fill_texture_record(record: np.void, texture: EncodedTexture, levels: tuple[int, int], adapter: int) -> None:
    """Write what every codec tells of a texture into its record: `levels` are the row of its finest mip and their number, `adapter`
    the first block of its adapter."""
    record["first_level"], record["levels"] = levels
    record["decoder"], record["channels"] = texture.group, texture.channels
    record["srgb"] = texture.color_space == "srgb"
    record["components"] = sum(
        1 << (4 * PLANES.index(plane) + component)
        for plane, channels in plane_channels(texture.maps, texture.channels).items()
        for component in channels
    )
    record["adapter"] = adapter


def decoder_tables(pack: Pack, precision: Precision) -> DecoderTables:
    """How the decoders of `pack` lie on the GPU."""
    if isinstance(pack.config, BlockCodecConfig):
        return BlockPackTables(pack.config)
    return GridTables(pack, precision)


def decoder_glsl(pack: Pack, variant: DecoderVariant) -> dict[str, str]:
    """The generated includes of the decoding shaders, but for `generated/codec.glsl`."""
    if isinstance(pack.config, BlockCodecConfig):
        return {
            "generated/block.glsl": block_glsl(pack.config),
            "generated/network.glsl": "",
            "generated/shared_network.glsl": f"#define PIXELS {variant.pixels}\n",
        }
    return {
        "generated/block.glsl": "",
        "generated/network.glsl": network_glsl(pack.grid_config),
        "generated/shared_network.glsl": shared_network_glsl(pack.grid_config, variant),
    }
