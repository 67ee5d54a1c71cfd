"""Checks of packs, and of parts of one, that came from another process. Files are checked by `ntc.pack.file`."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.block.model import BlockDecoder
from ntc.codec.block_pack import latent_rows
from ntc.codec.config import CodecConfig
from ntc.codec.latents import latent_cell_count
from ntc.codec.model import Adapter, AnyCodec, AnyDecoder, Decoder, EncodedTexture, Grouping, Pack
from ntc.pack.schema import LARGEST_DECIBELS, LARGEST_DEGREES, LARGEST_SIDE

LARGEST_BLOCK_NUMBER = 16.0
"""Size at most of means, axes and basis scales of codec `block`: an encoder's are below 2, and no code decodes beyond fp32."""


def check_grouping(grouping: Grouping, textures: int) -> None:
    """Raises ValueError unless each of so many textures has a group, numbered from 0 without gaps. Takes time and memory
    for the textures alone, whatever the numbers."""
    used = set(grouping.groups)
    if len(grouping.groups) != textures or used != set(range(len(used))):
        raise ValueError(f"grouping {grouping.name}: needs a group for each texture, numbered from 0 without gaps")


def check_decibels(psnr_db: float) -> None:
    """Raises ValueError for a PSNR out of range or NaN; infinity, of equal pictures, is valid."""
    if not -LARGEST_DECIBELS <= psnr_db <= LARGEST_DECIBELS and psnr_db != math.inf:
        raise ValueError(f"a PSNR of {psnr_db} dB")


def _check_texture(texture: EncodedTexture, config: AnyCodec) -> None:
    if not (1 <= texture.width <= LARGEST_SIDE and 1 <= texture.height <= LARGEST_SIDE):
        raise ValueError(f"{texture.name}: is {texture.width} x {texture.height} texels")
    texture.places(config)
    for decibels in (texture.psnr_db, *texture.map_psnr_db):
        if decibels is not None:
            check_decibels(decibels)
    if len(texture.map_psnr_db) not in (0, len(texture.maps)):
        raise ValueError(f"{texture.name}: has {len(texture.map_psnr_db)} PSNRs of {len(texture.maps)} maps")
    if not all(0.0 <= angle <= LARGEST_DEGREES for angle in texture.normal_degrees or ()):
        raise ValueError(f"{texture.name}: normals are off by {texture.normal_degrees} degrees")


def check_encoded(texture: EncodedTexture, config: CodecConfig) -> None:
    """Raises ValueError for a size, latents or an adapter that do not fit `config`."""
    _check_texture(texture, config)
    channels = config.latent_channels
    _check(texture.latents, (latent_cell_count(texture.width, texture.height, config), channels), np.uint8, "latents")
    if config.latent_bits < 8 and texture.latents.max(initial=0) > config.largest_stored:
        raise ValueError(f"latents have values of more than {config.latent_bits} bits")
    _check(texture.scale, (channels,), np.float32, "scale")
    _check(texture.offset, (channels,), np.float32, "offset")
    if (texture.adapter is not None) != config.adapters:
        raise ValueError("textures must have an adapter exactly if codec.adapters is set")
    if texture.adapter is not None:
        _check_adapter(texture.adapter, config)


def _check_adapter(adapter: Adapter, config: CodecConfig) -> None:
    shapes = config.layer_shapes
    hidden = (len(shapes) - 1, config.hidden_width)
    _check(adapter.scales, hidden, np.float32, "adapter.scales")
    _check(adapter.biases, hidden, np.float32, "adapter.biases")
    output = (adapter.output_weight, adapter.output_bias)
    if any((array is not None) != config.adapter_output for array in output):
        raise ValueError("adapters must have an output layer exactly if codec.adapter_output is set")
    for array, shape, name in zip(output, (shapes[-1], shapes[-1][:1]), ("output_weight", "output_bias"), strict=True):
        if array is not None:
            _check(array, shape, np.float32, f"adapter.{name}")


def check_decoder(decoder: Decoder, config: CodecConfig) -> None:
    """Raises ValueError for weights of other shapes than the codec's, or that are not finite."""
    shapes = config.layer_shapes
    _check_all(decoder.weights, shapes, "weights")
    _check_all(decoder.biases, [shape[:1] for shape in shapes], "biases")


def _check_all(arrays: tuple[NDArray[Any], ...], shapes: Iterable[tuple[int, ...]], name: str) -> None:
    expected = list(shapes)
    if len(arrays) != len(expected):
        raise ValueError(f"{name}: {len(arrays)} layers, not {len(expected)}")
    for array, shape in zip(arrays, expected, strict=True):
        _check(array, shape, np.float32, name)


def _check(array: NDArray[Any], shape: tuple[int, ...], kind: type, name: str) -> None:
    if array.shape != shape or array.dtype != kind:
        raise ValueError(f"{name}: {array.dtype} {list(array.shape)}, not {np.dtype(kind)} {list(shape)}")
    if kind is np.float32 and not np.isfinite(array).all():
        raise ValueError(f"{name}: values are not finite")


def check_block_texture(texture: EncodedTexture, config: BlockCodecConfig) -> None:
    """Raises ValueError for a size, directories, mean or axes that do not fit `config`. All codes are valid."""
    _check_texture(texture, config)
    _check(texture.latents, (len(texture.latents), config.cell_bytes), np.uint8, "latents")
    latent_rows(texture, config)
    _check_block_numbers(texture.offset, (config.output_channels,), "mean")
    _check_block_numbers(texture.scale, (config.axis_numbers,), "axes")
    if texture.adapter is not None:
        raise ValueError("textures of codec block have no adapter")


def check_block_decoder(decoder: BlockDecoder, config: BlockCodecConfig) -> None:
    """Raises ValueError for tables of other shapes than the codec's, or numbers that no encoder writes."""
    _check(decoder.basis, (config.coefficients, config.block_texels, config.output_channels), np.int8, "basis")
    if config.has_sets and bool((decoder.basis.any(axis=1).sum(axis=1) > 1).any()):
        raise ValueError("basis: a row is of several channels, which those of material sets never are")
    _check_block_numbers(decoder.basis_scale, (config.coefficients,), "basis_scale")
    _check(decoder.scales, (config.modes, config.coefficients), np.uint8, "scales")


def _check_block_numbers(array: NDArray[Any], shape: tuple[int, ...], name: str) -> None:
    _check(array, shape, np.float32, name)
    if float(np.abs(array).max(initial=0.0)) > LARGEST_BLOCK_NUMBER:
        raise ValueError(f"{name}: a number is beyond {LARGEST_BLOCK_NUMBER:g}")


def check_texture(texture: EncodedTexture, config: AnyCodec) -> None:
    """Raises ValueError for what a pack of the codec of `config` cannot hold."""
    if isinstance(config, BlockCodecConfig):
        check_block_texture(texture, config)
    else:
        check_encoded(texture, config)


def check_any_decoder(decoder: AnyDecoder, config: AnyCodec) -> None:
    """Raises ValueError for a decoder of another codec than that of `config`, and for one that does not fit it."""
    if isinstance(config, BlockCodecConfig) and isinstance(decoder, BlockDecoder):
        check_block_decoder(decoder, config)
    elif isinstance(config, CodecConfig) and isinstance(decoder, Decoder):
        check_decoder(decoder, config)
    else:
        raise ValueError(f"a {type(decoder).__name__} is none of codec {config.kind}")


def check_pack(pack: Pack) -> None:
    """Raises ValueError for a pack that cannot be decoded. Unused decoders are allowed."""
    if len(pack.grouping.groups) != len(pack.textures):
        raise ValueError(f"{len(pack.grouping.groups)} groups are named for {len(pack.textures)} textures")
    for texture, group in zip(pack.textures, pack.grouping.groups, strict=True):
        if texture.group != group or not 0 <= group < len(pack.decoders):
            raise ValueError(f"{texture.name}: has group {texture.group} and {group} of {len(pack.decoders)}")
    for texture in pack.textures:
        check_texture(texture, pack.config)
    for decoder in pack.decoders:
        check_any_decoder(decoder, pack.config)
