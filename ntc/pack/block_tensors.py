"""The tensors of packs of codec `block` (docs/pack-format.md)."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.block.model import BlockDecoder
from ntc.codec.block.universal import UNIVERSAL, universal_decoder
from ntc.codec.maps import BASE_ALONE
from ntc.codec.model import EncodedTexture, Pack
from ntc.errors import InputError
from ntc.pack.schema import PackMetadata
from ntc.pack.validate import check_block_decoder, check_block_texture

TensorShape = tuple[str, tuple[int | None, ...]]
"""(type, shape); None: any number."""


def axes_shape(config: BlockCodecConfig) -> tuple[int, ...]:
    """Of a texture's axes in a file: one matrix, or of material sets the matrices of all planes, one after the other."""
    channels = config.output_channels
    return (channels, channels) if config.maps == BASE_ALONE else (config.axis_numbers,)


def expected_block_tensors(textures: int, decoders: int, config: BlockCodecConfig) -> dict[str, TensorShape]:
    """Type and shape of every tensor of a pack of so many textures."""
    channels, expected = config.output_channels, dict[str, TensorShape]()
    for index in range(textures):
        expected[f"latents.{index}"] = ("U8", (None, config.cell_bytes))
        expected[f"latents.{index}.mean"] = ("F32", (channels,))
        expected[f"latents.{index}.axes"] = ("F32", axes_shape(config))
    for index in range(decoders):
        rows: TensorShape = ("I8", (config.coefficients, config.block_texels, channels))
        if config.has_sets:
            rows = ("I8", (config.coefficients, config.block_texels))
            expected[f"decoder.{index}.channels"] = ("U8", (config.coefficients,))
        expected[f"decoder.{index}.basis"] = rows
        expected[f"decoder.{index}.basis_scale"] = ("F32", (config.coefficients,))
        expected[f"decoder.{index}.scales"] = ("U8", (config.modes, config.coefficients))
    return expected


def stored_decoders(metadata: PackMetadata) -> int:
    """Decoders of codec `block` that a file with `metadata` holds."""
    return 0 if metadata.grouping.name == UNIVERSAL else metadata.decoders


def _shipped_decoder(metadata: PackMetadata, config: BlockCodecConfig) -> BlockDecoder:
    """The decoder that the textures were encoded for. Raises ValueError where the metadata does not fit one that ships."""
    version = metadata.grouping.parameters.get("version")
    if metadata.decoders != 1 or not isinstance(version, int):
        raise ValueError(
            f"grouping {UNIVERSAL}: names {metadata.decoders} decoders of version {version!r}, not one that ships"
        )
    if config.maps != BASE_ALONE:
        raise ValueError(f"grouping {UNIVERSAL}: no decoder for maps {', '.join(config.maps)} ships")
    try:
        decoder = universal_decoder(config.output_channels, version)
    except InputError as error:
        raise ValueError(str(error)) from error
    check_block_decoder(decoder, config)
    return decoder


def block_tensors(pack: Pack) -> dict[str, NDArray[Any]]:
    """The tensors of `pack`, contiguous."""
    config = pack.block_config
    tensors: dict[str, NDArray[Any]] = {}
    for index, texture in enumerate(pack.textures):
        tensors[f"latents.{index}"] = texture.latents
        tensors[f"latents.{index}.mean"] = texture.offset
        tensors[f"latents.{index}.axes"] = texture.scale.reshape(axes_shape(config))
    for index, decoder in enumerate(pack.block_decoders[: pack.grouping.stored_decoders]):
        for part in ("basis", "basis_scale", "scales"):
            tensors[f"decoder.{index}.{part}"] = getattr(decoder, part)
        if config.has_sets:
            tensors[f"decoder.{index}.channels"] = decoder.row_channels
            tensors[f"decoder.{index}.basis"] = decoder.basis[np.arange(len(decoder.basis)), :, decoder.row_channels]
    return {name: np.ascontiguousarray(array) for name, array in tensors.items()}


def read_block_parts(
    tensor: Callable[[str], NDArray[Any]], metadata: PackMetadata, config: BlockCodecConfig
) -> tuple[tuple[EncodedTexture, ...], tuple[BlockDecoder, ...]]:
    """Textures and decoders of a file whose tensors have the expected types and shapes.

    `tensor` gives them by name. Raises ValueError naming the texture's or decoder's tensors that hold what no encoder writes.
    """
    textures, decoders = [], []
    for index, (texture, group) in enumerate(zip(metadata.textures, metadata.grouping.groups, strict=True)):
        encoded = EncodedTexture(
            **msgspec.structs.asdict(texture),
            group=group,
            latents=tensor(f"latents.{index}"),
            scale=tensor(f"latents.{index}.axes").reshape(-1),
            offset=tensor(f"latents.{index}.mean"),
        )
        _named(f"latents.{index}", check_block_texture, encoded, config)
        textures.append(encoded)
    if metadata.grouping.name == UNIVERSAL:
        decoders.append(_shipped_decoder(metadata, config))
    for index in range(stored_decoders(metadata)):
        parts = ("basis", "basis_scale", "scales")
        decoder = BlockDecoder(*(tensor(f"decoder.{index}.{part}") for part in parts))
        if config.has_sets:
            name = f"decoder.{index}.channels"
            decoder = replace(decoder, basis=_spread_rows(name, decoder.basis, tensor(name), config))
        _named(f"decoder.{index}", check_block_decoder, decoder, config)
        decoders.append(decoder)
    return tuple(textures), tuple(decoders)


def _spread_rows(
    name: str, rows: NDArray[np.int8], channels: NDArray[np.uint8], config: BlockCodecConfig
) -> NDArray[np.int8]:
    """[coefficients, texels, channels] int8: `rows` [coefficients, texels], each in the one of `channels` [coefficients] that it is
    of. Raises ValueError, naming the tensor `name`, for a channel that the codec lacks."""
    if int(channels.max(initial=0)) >= config.output_channels:
        raise ValueError(f"{name}: a row of the basis is of channel {channels.max()}")
    basis = np.zeros((*rows.shape, config.output_channels), np.int8)
    basis[np.arange(len(rows)), :, channels] = rows
    return basis


def _named(name: str, check: Callable[[Any, BlockCodecConfig], None], part: Any, config: BlockCodecConfig) -> None:
    try:
        check(part, config)
    except ValueError as error:
        raise ValueError(f"{name}.{error}") from error
