"""The tensors of codec `block` in a file (docs/reference/pack-format.md). "{}" in a name is the number of a texture or decoder."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import LARGEST_EDGE_BITS, BlockConfig
from ntc.codec.block.model import BlockDecoder
from ntc.codec.block.universal import scaled_decoder, set_tables, universal_decoder
from ntc.codec.codec import Tensors, TensorShape
from ntc.codec.config import UNIVERSAL
from ntc.codec.maps import BASE_ALONE
from ntc.errors import InputError

LARGEST_BASIS_SCALE = 192
"""Largest scale of a decoder's row: rows of an encoder have a length of 1."""
DECODER_PARTS = ("basis", "channels", "basis_scale", "scales", "edges")


def decoder_shapes(config: BlockConfig) -> dict[str, TensorShape]:
    """Return type and shape of the tensors of a decoder: its tables, or gains of the shipped ones."""
    if config.tables is not None:
        return {"decoder.{}.gains": ("I8", (None,))}
    return _table_shapes(config)


def _table_shapes(config: BlockConfig) -> dict[str, TensorShape]:
    return {
        "decoder.{}.basis": ("I8", (config.coefficients, config.block_texels)),
        "decoder.{}.channels": ("U8", (config.coefficients,)),
        "decoder.{}.basis_scale": ("U8", (config.coefficients,)),
        "decoder.{}.scales": ("U8", (config.modes, config.coefficients)),
        "decoder.{}.edges": ("U8", (config.modes, len(config.planes))),
    }


def decoder_tensors(decoder: BlockDecoder, config: BlockConfig) -> dict[str, NDArray[Any]]:
    """Return the tensors of a decoder, contiguous."""
    if config.tables is not None:
        return {"decoder.{}.gains": np.ascontiguousarray(decoder.gains)}
    return {f"decoder.{{}}.{part}": np.ascontiguousarray(getattr(decoder, part)) for part in DECODER_PARTS}


def read_decoder(tensors: Tensors, config: BlockConfig) -> BlockDecoder:
    """Return the decoder of these tensors. Raises ValueError for channels that the codec lacks, numbers that no encoder writes, and
    gains of tables that do not ship."""
    if config.tables is not None:
        try:
            tables = set_tables(config.maps, config.output_channels, config.tables)
        except InputError as error:
            raise ValueError(f"decoder.{{}}.gains: {error}") from error
        _check_shapes(tables.decoder, config)
        gains = tensors["decoder.{}.gains"]
        if len(gains) not in (len(tables.bands), len(tables.energies)):
            raise ValueError(
                f"decoder.{{}}.gains: has {len(gains)} gains, not {len(tables.bands)} or {len(tables.energies)}"
            )
        return scaled_decoder(tables, gains)
    decoder = BlockDecoder(**{part: tensors[f"decoder.{{}}.{part}"] for part in DECODER_PARTS})
    _check_decoder(decoder, config)
    return decoder


def _check_decoder(decoder: BlockDecoder, config: BlockConfig) -> None:
    if int(decoder.channels.max(initial=0)) >= config.output_channels:
        raise ValueError(f"decoder.{{}}.channels: a row of the basis is of channel {decoder.channels.max()}")
    plane_of = {channel: place for place, channels in enumerate(config.planes) for channel in channels}
    planes = [plane_of[channel] for channel in decoder.channels.tolist()]
    if planes != sorted(planes):
        raise ValueError("decoder.{}.channels: rows of a plane do not lie together")
    if int(decoder.edges.max(initial=0)) > LARGEST_EDGE_BITS:
        raise ValueError(f"decoder.{{}}.edges: an edge part has {decoder.edges.max()} bits a texel")
    if int(decoder.basis_scale.max(initial=0)) > LARGEST_BASIS_SCALE:
        raise ValueError(f"decoder.{{}}.basis_scale: a scale is beyond {LARGEST_BASIS_SCALE}")


def shipped_decoder(decoders: int, parameters: Mapping[str, Any], config: BlockConfig) -> BlockDecoder:
    """Return the shipped decoder that textures of grouping `universal` with these parameters were encoded for.

    Raises ValueError where the parameters name no shipped one.
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
    _check_shapes(decoder, config)
    return decoder


def _check_shapes(decoder: BlockDecoder, config: BlockConfig) -> None:
    """Check that shipped tables have the shapes of `config`. Raises ValueError where they do not."""
    for name, (_, shape) in _table_shapes(config).items():
        part = name.rpartition(".")[2]
        array: NDArray[Any] = getattr(decoder, part)
        if array.shape != shape:
            raise ValueError(f"{part}: {array.dtype} {list(array.shape)}, not {array.dtype} {list(shape)}")
