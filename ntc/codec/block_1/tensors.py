"""The tensors of format 1 of codec `block` in a file (docs/reference/pack-format.md). "{}" stands for a number."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec import block_storage
from ntc.codec.block_1.config import BlockConfig
from ntc.codec.block_1.model import BlockDecoder
from ntc.codec.block_1.universal import universal_decoder
from ntc.codec.codec import Tensors, TensorShape
from ntc.codec.config import UNIVERSAL
from ntc.codec.maps import BASE_ALONE
from ntc.errors import InputError


def decoder_shapes(config: BlockConfig) -> dict[str, TensorShape]:
    """Type and shape of the tensors of a decoder. Rows of a basis for material sets are of one channel."""
    rows: tuple[int, ...] = (config.coefficients, config.block_texels)
    shapes: dict[str, TensorShape] = {}
    if config.has_sets:
        shapes["decoder.{}.channels"] = ("U8", (config.coefficients,))
    else:
        rows = (*rows, config.output_channels)
    return shapes | {
        "decoder.{}.basis": ("I8", rows),
        "decoder.{}.basis_scale": ("F32", (config.coefficients,)),
        "decoder.{}.scales": ("U8", (config.modes, config.coefficients)),
    }


def decoder_tensors(decoder: BlockDecoder, config: BlockConfig) -> dict[str, NDArray[Any]]:
    """The tensors of a decoder, contiguous."""
    tensors = {f"decoder.{{}}.{part}": getattr(decoder, part) for part in ("basis", "basis_scale", "scales")}
    if config.has_sets:
        channels = decoder.row_channels
        tensors["decoder.{}.channels"] = channels
        tensors["decoder.{}.basis"] = decoder.basis[np.arange(len(decoder.basis)), :, channels]
    return {name: np.ascontiguousarray(array) for name, array in tensors.items()}


def read_decoder(tensors: Tensors, config: BlockConfig) -> BlockDecoder:
    """The decoder of these tensors. Raises ValueError for channels that the codec lacks, and numbers that no encoder writes."""
    decoder = BlockDecoder(*(tensors[f"decoder.{{}}.{part}"] for part in ("basis", "basis_scale", "scales")))
    if config.has_sets:
        name = "decoder.{}.channels"
        decoder = replace(decoder, basis=_spread_rows(name, decoder.basis, tensors[name], config))
    block_storage.check_numbers(decoder.basis_scale, "decoder.{}.basis_scale")
    return decoder


def _spread_rows(
    name: str, rows: NDArray[np.int8], channels: NDArray[np.uint8], config: BlockConfig
) -> NDArray[np.int8]:
    """[coefficients, texels, channels] int8: `rows` [coefficients, texels], each in the one of `channels` [coefficients] that it is
    of. Raises ValueError, naming the tensor `name`, for a channel that the codec lacks."""
    if int(channels.max(initial=0)) >= config.output_channels:
        raise ValueError(f"{name}: a row of the basis is of channel {channels.max()}")
    basis = np.zeros((*rows.shape, config.output_channels), np.int8)
    basis[np.arange(len(rows)), :, channels] = rows
    return basis


def shipped_decoder(decoders: int, parameters: Mapping[str, Any], config: BlockConfig) -> BlockDecoder:
    """The one decoder that textures of grouping `universal` with these parameters were encoded for.

    Raises ValueError where they do not name one that ships.
    """
    version = parameters.get("version")
    if decoders != 1 or not isinstance(version, int):
        raise ValueError(f"grouping {UNIVERSAL}: names {decoders} decoders of version {version!r}, not one that ships")
    if config.maps != BASE_ALONE:
        raise ValueError(f"grouping {UNIVERSAL}: no decoder for maps {', '.join(config.maps)} ships")
    try:
        decoder = universal_decoder(config.output_channels, version)
    except InputError as error:
        raise ValueError(str(error)) from error
    shapes = {
        "basis": (config.coefficients, config.block_texels, config.output_channels),
        "scales": (config.modes, config.coefficients),
    }
    for part, shape in shapes.items():
        found: NDArray[Any] = getattr(decoder, part)
        if found.shape != shape:
            raise ValueError(f"{part}: {found.dtype} {list(found.shape)}, not {found.dtype} {list(shape)}")
    return decoder
