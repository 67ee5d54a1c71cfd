"""What of a set of textures decides about the settings of a codec, before any of them is encoded."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

from ntc.codec.maps import BASE_ALONE, MapName, joint_maps
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture

HEADER_BYTES, TEXTURE_HEADER_BYTES, DECODER_HEADER_BYTES = 3000, 800, 320
"""Of a file, at most, besides codes, tables, names and the grouping's parameters."""
Sizes = Sequence[tuple[int, int]]


@dataclass(frozen=True)
class TextureSet:
    """What of the textures to encode decides about bits."""

    sizes: Sizes
    """(width, height) of mip 0 in texels."""
    groups: int
    """Decoders that are stored with them; 0: the one that ships with the program serves them."""
    channels: int
    """Of `maps`."""
    levels: int | None = None
    """Encoded mips; None: all."""
    maps: tuple[MapName, ...] = BASE_ALONE
    """Those that any of the textures has."""
    header_bytes: int = 0
    """Bytes of the file at most that are neither latents nor decoders (`file_header_bytes`)."""


def texture_set(
    textures: Sequence[SourceTexture], groups: int, levels: int | None = None, header_bytes: int = 0
) -> TextureSet:
    """What of `textures` in so many groups decides about bits; `levels` is the most encoded mips, None: all."""
    maps, channels = joint_maps((texture.maps, texture.channels) for texture in textures)
    return TextureSet([texture.size for texture in textures], groups, channels, levels, maps, header_bytes)


def file_header_bytes(textures: Sequence[SourceTexture], grouping: Grouping) -> int:
    """Bytes of a pack's file at most that are neither codes nor tables."""
    texts = [json.dumps([texture.name, texture.category]) for texture in textures]
    texts.append(json.dumps(dict(grouping.parameters)))
    fixed = HEADER_BYTES + TEXTURE_HEADER_BYTES * len(textures) + DECODER_HEADER_BYTES * grouping.stored_decoders
    # Texts within a text: each quote and backslash may be written twice.
    return fixed + 2 * sum(map(len, texts))


def common_channels(channels: int) -> int:
    """Channels with which base colours of `channels` channels are encoded where many share settings: 3, or 4 with alpha."""
    return 3 if channels <= 3 else 4
