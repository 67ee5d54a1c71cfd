"""Codec `two_colors`, which tests add to the registry: two colours and an index of two bits a texel for blocks of 4x4 texels.

It is the least that a codec must have, and shows that nothing outside of a codec knows which codecs there are: 6 bits per texel of
each plane of maps, nothing that a group shares, no target. CONTRIBUTING.md describes its files.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from ntc.codec.encoding import EncodingChoices
from ntc.codec.model import Grouping, Pack
from ntc.codec.registry import MODULES, codec_named
from ntc.codec.textures import SourceTexture

NAME = "two_colors"


@contextmanager
def registered() -> Iterator[None]:
    """The registry has the codec."""
    MODULES[NAME] = f"{__name__}.codec"
    try:
        yield
    finally:
        del MODULES[NAME]
        codec_named.cache_clear()


def encoded(textures: Sequence[SourceTexture], groups: tuple[int, ...], name: str = "clustered") -> Pack:
    """`textures` in these groups."""
    from ntc.training.encode import encode_chosen

    return encode_chosen(textures, Grouping(name, groups), codec_named(NAME), EncodingChoices())
