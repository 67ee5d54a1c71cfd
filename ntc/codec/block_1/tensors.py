"""The tensors of format 1 of codec `block` in a file (docs/reference/pack-format.md). "{}" stands for a number."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block_1.config import BlockConfig
from ntc.codec.block_1.model import BlockDecoder, BlockTexture
from ntc.codec.block_1.storage import level_rows
from ntc.codec.block_1.universal import universal_decoder
from ntc.codec.codec import Tensors, TensorShape
from ntc.codec.config import UNIVERSAL
from ntc.codec.latents import texture_levels
from ntc.codec.maps import BASE_ALONE, plane_channels
from ntc.errors import InputError

WORD = np.dtype("<u4")
LARGEST_NUMBER = 16.0
"""Size at most of means, axes and basis scales: an encoder's are below 2, and no code decodes beyond fp32."""


def _axes_shape(config: BlockConfig) -> tuple[int, ...]:
    """Of a texture's axes in a file: one matrix, or of material sets the matrices of all planes, one after the other."""
    channels = config.output_channels
    return (channels, channels) if config.maps == BASE_ALONE else (config.axis_numbers,)


def texture_shapes(config: BlockConfig) -> dict[str, TensorShape]:
    """Type and shape of the tensors of a texture: words of codes, mean and axes."""
    return {
        "latents.{}": ("U8", (None, WORD.itemsize)),
        "latents.{}.mean": ("F32", (config.output_channels,)),
        "latents.{}.axes": ("F32", _axes_shape(config)),
    }


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


def _plane_blocks(config: BlockConfig) -> list[tuple[NDArray[np.intp], ...]]:
    """By plane: what picks its part out of a matrix of channels."""
    planes = plane_channels(config.maps, config.output_channels).values()
    return [np.ix_(list(channels.values()), list(channels.values())) for channels in planes]


def _axes_matrix(parts: NDArray[np.float32], config: BlockConfig) -> NDArray[np.float32]:
    """[channels, channels] float32: `BlockTexture.axes` of its `parts` as files hold them."""
    axes, first = np.zeros((config.output_channels, config.output_channels), np.float32), 0
    for own in _plane_blocks(config):
        count = own[0].size
        axes[own] = parts[first : first + count * count].reshape(count, count)
        first += count * count
    return axes


def texture_tensors(texture: BlockTexture, config: BlockConfig) -> dict[str, NDArray[Any]]:
    """The tensors of a texture, contiguous. Of the axes, for each plane the rows of its part."""
    axes = np.concatenate([texture.axes[own].reshape(-1) for own in _plane_blocks(config)])
    words = np.ascontiguousarray(texture.words, WORD)
    return {
        "latents.{}": words.view(np.uint8).reshape(-1, WORD.itemsize),
        "latents.{}.mean": np.ascontiguousarray(texture.mean),
        "latents.{}.axes": axes.reshape(_axes_shape(config)),
    }


def read_texture(tensors: Tensors, known: Mapping[str, Any], config: BlockConfig) -> BlockTexture:
    """The texture of these tensors. Raises ValueError for directories, means or axes that no encoder writes; all codes are valid."""
    parts = tensors["latents.{}.axes"].reshape(-1)
    _check_numbers(tensors["latents.{}.mean"], "latents.{}.mean")
    _check_numbers(parts, "latents.{}.axes")
    words = np.ascontiguousarray(tensors["latents.{}"]).view(WORD).reshape(-1)
    texture = BlockTexture(
        **known,
        words=words.astype(np.uint32, copy=False),
        mean=tensors["latents.{}.mean"],
        axes=_axes_matrix(parts, config),
    )
    try:
        level_rows(texture.words, texture_levels(texture, config), config)
    except ValueError as error:
        raise ValueError(f"latents.{{}}.{error}") from error
    return texture


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
    _check_numbers(decoder.basis_scale, "decoder.{}.basis_scale")
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


def _check_numbers(array: NDArray[Any], name: str) -> None:
    if float(np.abs(array).max(initial=0.0)) > LARGEST_NUMBER:
        raise ValueError(f"{name}: a number is beyond {LARGEST_NUMBER:g}")


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
