"""Checks of what is to be encoded, for every codec."""

from collections.abc import Sequence

import numpy as np

from ntc.codec.config import UNIVERSAL
from ntc.codec.maps import BASE_ALONE, channel_places, maps_fit
from ntc.codec.model import CodecSettings, Grouping
from ntc.codec.registry import codec_of, shipping_codec
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError


def check_textures(textures: Sequence[SourceTexture], grouping: Grouping, codec: CodecSettings) -> None:
    """Raises InputError for textures and groups that cannot be trained."""
    if not textures:
        raise InputError("there is no texture to train")
    used = set(grouping.groups)
    if len(grouping.groups) != len(textures) or used != set(range(len(used))):
        raise InputError(f"grouping {grouping.name}: needs a group for each texture, numbered from 0 without gaps")
    if grouping.name == UNIVERSAL and not codec_of(codec).shipped:
        raise InputError(
            f"grouping {UNIVERSAL}: no decoder of codec {codec.kind} ships with the program; use codec {shipping_codec()}"
        )
    whole = codec_of(codec).stored_decoders(grouping.name, 1, codec) == 0
    for texture in textures:
        if texture.pixels.dtype != np.uint8 or texture.pixels.ndim != 3 or texture.pixels.size == 0:
            raise InputError(
                f"{texture.name}: is {texture.pixels.dtype} {list(texture.pixels.shape)}; textures are 8-bit "
                "[height, width, channels], and at least one texel large"
            )
        if whole and texture.maps != BASE_ALONE:
            raise InputError(
                f"grouping {UNIVERSAL}: these settings are of a decoder that serves base colours alone; take settings for whole "
                "materials, use another grouping, or --maps base"
            )
        _check_channels(texture, codec)


def _check_channels(texture: SourceTexture, codec: CodecSettings) -> None:
    """Raises InputError for channels that the codec has no room for."""
    try:
        channel_places(texture.maps, texture.channels, codec.maps, codec.output_channels)
    except ValueError as error:
        if not maps_fit(texture.maps, texture.channels):
            raise InputError(f"{texture.name}: {error}") from error
        raise InputError(
            f"{texture.name}: has {texture.channels} channels of {', '.join(texture.maps)}; set codec.output_channels to "
            f"at least that, not {codec.output_channels} of {', '.join(codec.maps)}"
        ) from error
