"""Settings of codec `block` that come to a target: bits, a size, or a quality. Needs no torch."""

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.rate import config_for_bits, config_for_bytes, config_for_words, largest_words
from ntc.codec.targets import BitsTarget, SizeTarget, Target
from ntc.codec.texture_set import TextureSet
from ntc.errors import InputError


def settings_for_target(known: TextureSet, target: Target) -> BlockConfig:
    """The settings under which textures come to `target`; those of a quality are found while encoding, here are the largest.

    Raises InputError for bits or a size out of reach.
    """
    if isinstance(target, BitsTarget):
        return config_for_bits(target.bits, known, target.block_side, target.multiply_adds)
    if not isinstance(target, SizeTarget):
        return config_for_words(largest_words(known), known)
    header = known.header_bytes
    try:
        return config_for_bytes(1e6 * target.megabytes - header, known)
    except InputError as error:
        raise InputError(f"--size {target.megabytes:g}: {error}, and {header / 1e6:.3f} MB for names") from None
