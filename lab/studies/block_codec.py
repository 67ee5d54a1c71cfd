"""Codec `block` on a set of textures at a number of bits: encoded, decoded again, measured."""

import time
from collections.abc import Sequence
from dataclasses import replace

from lab.studies.set_quality import (
    PictureQuality,
    SetQuality,
    capped_psnr_db,
    pack_bits_per_texel,
    pack_file_bits_per_texel,
    picture_quality,
)
from lab.studies.settings import BlockSide
from ntc.codec.block.config import BlockOptions
from ntc.codec.block.encoding.rate import config_for_bits
from ntc.codec.encoding import texture_set
from ntc.codec.mips import mip_chain
from ntc.codec.model import Grouping, Pack
from ntc.codec.registry import codec_of
from ntc.codec.textures import SourceTexture
from ntc.training.encode import encode_textures


def measured_pack(
    pack: Pack, textures: Sequence[SourceTexture], cpu_seconds: float, flip_every: int = 1, mips: int = 1
) -> tuple[tuple[PictureQuality, ...], SetQuality]:
    """Each texture's quality in `pack`, which encodes `textures`, and the set's. FLIP is of every `flip_every`-th texture; PSNR is
    that of so many `mips` each."""
    codec = codec_of(pack.config).torch_twin(pack, "cpu")
    pictures = []
    for index, texture in enumerate(textures):
        quality = picture_quality(texture.pixels, codec.decode_image(index), index % flip_every == 0)
        chain = mip_chain(texture.pixels, texture.color_space, texture.maps)[:mips]
        coarse = [capped_psnr_db(mip, codec.decode_image(index, level)) for level, mip in enumerate(chain) if level]
        pictures.append(replace(quality, coarse_db=tuple(coarse)))
    return tuple(pictures), SetQuality.of(
        pictures, pack_bits_per_texel(pack), cpu_seconds, pack_file_bits_per_texel(pack)
    )


def measured_block_codec(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    bits: float,
    flip_every: int = 1,
    side: BlockSide = 8,
    mips: int = 1,
) -> tuple[tuple[PictureQuality, ...], SetQuality]:
    """Encode in blocks of `side` texels, in the settings whose bits come nearest to `bits` a texel.

    Raises InputError for bits that cannot be had.
    """
    config = config_for_bits(bits, texture_set(textures, grouping.stored_decoders), side)
    began = time.process_time()
    pack = encode_textures(textures, grouping, config, BlockOptions())
    return measured_pack(pack, textures, time.process_time() - began, flip_every, mips)
