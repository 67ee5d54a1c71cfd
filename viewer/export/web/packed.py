"""A pack as the page reads it: for each texture its records and latents, the decoders as rows of a picture, and shaders."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.block_pack import latent_rows
from ntc.codec.latents import latent_levels
from ntc.codec.maps import PLANES, Plane, plane_channels
from ntc.codec.model import Pack
from viewer.gl.older_glsl import GLSL_ES_300, older_source
from viewer.gl.program import ShaderLibrary
from viewer.locations import shaders_folder
from viewer.render.resources.decoder_tables import decoder_glsl, decoder_tables, fill_texture_record
from viewer.render.resources.latent_store import level_records, stored_words
from viewer.render.resources.layout import (
    WEIGHT_COLUMN_BITS,
    codec_layout_glsl,
    scene_layout_glsl,
    texture_record,
)
from viewer.render.resources.variant import SOFTWARE

SHADER = "web/decode_mip.frag"


@dataclass(frozen=True)
class PackedTexture:
    """One texture: what its three samplers of words hold, little-endian."""

    record: bytes
    """`texture_record` of the codec; its finest mip has row 0 of `levels`."""
    levels: bytes
    """LEVEL_RECORDs, finest first; `first_cell` counts in `latents`."""
    latents: bytes


@dataclass(frozen=True)
class PackedDecoders:
    """What all textures share."""

    data: bytes
    """Rows of 2^WEIGHT_COLUMN_BITS blocks of four numbers, the last one padded with zeros."""
    is_integer: bool
    """Whether the numbers are uint32 (codec `block`), not float32."""
    loop_length: int
    """The shaders' uniform `network_blocks`."""

    @property
    def rows(self) -> int:
        """Rows of the picture."""
        return len(self.data) >> (WEIGHT_COLUMN_BITS + 4)


def packed_decoders(pack: Pack, chosen: Sequence[int]) -> PackedDecoders:
    """All decoders of `pack`, then the adapters of its textures `chosen`, in single precision."""
    tables = decoder_tables(pack, "fp32")
    own = (pack.textures[index].adapter for index in chosen)
    data = tables.everything(pack, [adapter for adapter in own if adapter is not None])
    row = tables.block_bytes << WEIGHT_COLUMN_BITS
    return PackedDecoders(data.ljust(-(-len(data) // row) * row, b"\0"), tables.kind == "u4", tables.loop_length)


def packed_textures(pack: Pack, chosen: Sequence[int]) -> Iterator[PackedTexture]:
    """The textures `chosen` of `pack`, whose adapters lie as `packed_decoders` puts them."""
    tables = decoder_tables(pack, "fp32")
    adapter = tables.first_block + len(pack.decoders) * tables.blocks
    for index in chosen:
        texture = pack.textures[index]
        pyramid = latent_levels(texture.width, texture.height, pack.config)
        record = np.zeros(1, texture_record(pack.config))
        fill_texture_record(record[0], texture, (0, len(pyramid)), adapter)
        tables.fill_record(record[0], texture)
        levels = level_records(pyramid)
        levels["first_cell"] = [row.first for row in latent_rows(texture, pack.config)]
        latents = stored_words(texture, pack.config, slice(None))
        yield PackedTexture(record.tobytes(), levels.tobytes(), latents.tobytes())
        adapter += tables.adapter_blocks


def decoding_shaders(pack: Pack) -> dict[Plane, str]:
    """GLSL ES 3.00 of the fragment shader that decodes a mip, for each plane that the codec of `pack` has."""
    config = pack.config
    generated = {"generated/layout.glsl": scene_layout_glsl(), "generated/codec.glsl": codec_layout_glsl(config)}
    library = ShaderLibrary(shaders_folder(), {**generated, **decoder_glsl(pack, SOFTWARE)})
    found: dict[Plane, str] = {}
    for plane in plane_channels(config.maps, config.output_channels):
        defines = {"WEIGHTS_IN_IMAGE": 1, "PRECISION_FP16": 0, "PLANE": PLANES.index(plane)}
        if isinstance(config, BlockCodecConfig):
            # At the centre of a texel there is nothing to filter: that texel alone.
            defines["FILTER_STOCHASTIC"] = 1
        found[plane] = older_source(library.assemble(SHADER, defines).text, GLSL_ES_300).text
    return found
