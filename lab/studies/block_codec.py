"""Measurement of codec `block` on a set of textures at one bitrate."""

import time
from collections.abc import Sequence

from lab.studies.set_quality import (
    SetQuality,
    pack_bits_per_texel,
    pack_file_bits_per_texel,
    picture_quality,
)
from lab.studies.settings import BlockSide
from ntc.codec.block.config import BlockOptions
from ntc.codec.block.encoding.rate import config_for_bits
from ntc.codec.encoding import texture_set
from ntc.codec.model import Grouping
from ntc.codec.registry import codec_of
from ntc.codec.textures import SourceTexture
from ntc.training.encode import encode_textures


def measured_block_codec(
    textures: Sequence[SourceTexture], grouping: Grouping, bits: float, flip_every: int = 1, side: BlockSide = 8
) -> SetQuality:
    """Encode and decode textures in blocks of `side` texels at about `bits` per texel, and return their quality.

    FLIP is measured on every `flip_every`-th texture. Raises InputError for a bitrate that the codec cannot reach.
    """
    config = config_for_bits(bits, texture_set(textures, grouping.stored_decoders), side)
    began = time.process_time()
    pack = encode_textures(textures, grouping, config, BlockOptions())
    seconds = time.process_time() - began
    codec = codec_of(pack.config).torch_twin(pack, "cpu")
    pictures = [
        picture_quality(texture.pixels, codec.decode_image(index), index % flip_every == 0)
        for index, texture in enumerate(textures)
    ]
    return SetQuality.of(pictures, pack_bits_per_texel(pack), seconds, pack_file_bits_per_texel(pack))
