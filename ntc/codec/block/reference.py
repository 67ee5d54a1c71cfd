"""The float64 reference decoder of codec `block` in numpy, which every fast decoder is tested against."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.codes import EdgePart, UnpackedCodes, channel_indices, edge_parts, unpacked_codes
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.model import BlockDecoder, BlockTexture, averaged_rows
from ntc.codec.block.storage import BlockCodes, level_codes, level_rows
from ntc.codec.block.trellis import branch_tables, level_table, scale_values
from ntc.codec.config import WrapMode
from ntc.codec.latents import LatentLevel, texture_levels
from ntc.codec.sampling import bilinear, clamped_lod, trilinear

Array = NDArray[np.float64]


def decode_coefficients(codes: UnpackedCodes, decoder: BlockDecoder) -> Array:
    """Return [blocks, coefficients] float64: the coefficients of `codes`, without the scales of the basis."""
    levels = level_table()
    following, subsets = branch_tables()
    scales = scale_values(decoder.scales)[codes.modes]
    depths = codes.depths.astype(np.int64)
    values = np.zeros(depths.shape)
    state = codes.starts
    for k in range(depths.shape[1]):
        active = depths[:, k] > 0
        branch, place = (codes.indices[:, k] & 1).astype(np.int64), (codes.indices[:, k] >> 1).astype(np.int64)
        number = 4 * place + subsets[state, branch]
        values[:, k] = np.where(active, levels[depths[:, k], number] * scales[:, k], 0.0)
        state = np.where(active, following[state, branch], state)
    return values


def channel_coefficients(stored: BlockCodes, decoder: BlockDecoder, config: BlockConfig, channel: int) -> Array:
    """[blocks, coefficients of `channel`] float64: those of `decode_coefficients`, read without the others."""
    _, subsets = branch_tables()
    read = channel_indices(stored, decoder, config, channel)
    active = read.depths > 0
    number = np.where(active, 4 * read.others + subsets[read.states, read.branches], 0)
    scales = scale_values(decoder.scales[:, decoder.channels == channel])[read.modes]
    return np.where(active, level_table()[read.depths, number] * scales, 0.0)


def mixed(indices: NDArray[np.uint8], bits: NDArray[np.int64], config: BlockConfig, mip: int) -> tuple[Array, Array]:
    """Return ([parts, texels] float64, 0 to 1: share of an edge part's second colour in each texel of a code's mip `mip`; [parts,
    texels] variance of that share among the texels of mip 0 that it averages)."""
    side, count = config.code_sides[mip], 1 << mip
    numbers = indices.astype(np.int64).reshape(-1, side, count, side, count)
    sums, squares = (np.sum(power, axis=(2, 4)).reshape(-1, side * side) for power in (numbers, numbers * numbers))
    whole = (((1 << bits) - 1) * count * count)[:, None]
    return sums / whole, (squares * count * count - sums * sums) / (whole * whole)


def edge_values(part: EdgePart, config: BlockConfig, mip: int, colours: NDArray[np.bool_] | None = None) -> Array:
    """Return [parts, texels, channels of the plane] float64: values of edge parts at a code's mip `mip`. `colours` [channels of the
    plane]: which are sRGB-coded: their squares are averaged, which is near to linear light. None: none; mip 0 has no averages."""
    first, second = (part.colours[:, None, number].astype(np.float64) / 255.0 for number in (0, 1))
    share, variance = (each[..., None] for each in mixed(part.indices, part.bits, config, mip))
    values = first + (second - first) * share
    if colours is None:
        return np.asarray(values)
    return np.where(colours, np.sqrt(np.square(values) + np.square(second - first) * variance), values)


def block_values(
    texture: BlockTexture, stored: BlockCodes, decoder: BlockDecoder, config: BlockConfig, mip: int = 0
) -> Array:
    """[blocks, texels, channels] float64, not clamped, in the texture's colour space: values of codes at their mip `mip`.

    Any words are valid codes: whatever a file holds decodes to finite numbers.
    """
    codes = unpacked_codes(stored, decoder, config)
    coefficients = decode_coefficients(codes, decoder) * scale_values(decoder.basis_scale)
    rows = averaged_rows(decoder.basis.astype(np.float64), config, mip)
    transformed = np.zeros((len(coefficients), rows.shape[1], config.output_channels))
    for channel in range(config.output_channels):
        rows_of_channel = decoder.channels == channel
        transformed[..., channel] = coefficients[:, rows_of_channel] @ rows[rows_of_channel]
    values = np.zeros_like(transformed) + texture.mean[mip].astype(np.float64)
    colours = texture.colours(config)
    for plane, part in zip(config.planes, codes.edges, strict=True):
        channels = np.array(plane, np.int64)
        shown = edge_values(part, config, mip, colours[channels])
        if config.alpha in plane:
            # Means of coarse mips keep a mask's coverage, in edge parts too.
            shown = shown + (texture.mean[mip] - texture.mean[0]).astype(np.float64)[channels]
        values[np.ix_(part.blocks, np.arange(rows.shape[1]), channels)] = shown
    return np.asarray(values + transformed @ texture.axes.astype(np.float64).T)


def texture_codes(texture: BlockTexture, config: BlockConfig, level: int) -> BlockCodes:
    """Return the codes of all blocks that mip `level` is decoded from. Raises ValueError for words that no encoder writes."""
    levels = texture_levels(texture, config)
    first = level_rows(texture.words, levels, config)[level].first
    return level_codes(texture.words[first:], levels[level], config)


def texel_values(
    texture: BlockTexture,
    decoder: BlockDecoder,
    config: BlockConfig,
    level: int,
    column: NDArray[np.int64],
    row: NDArray[np.int64],
) -> Array:
    """[N, channels] float64, not clamped: the texels at `column` and `row` [N] of mip `level`."""
    geometry = texture_levels(texture, config)[level]
    side = config.code_sides[geometry.mip_of_cell]
    used, place = np.unique(row // side * geometry.width + column // side, return_inverse=True)
    stored = texture_codes(texture, config, level)
    part = BlockCodes(stored.codes[used], stored.sizes[used])
    values = block_values(texture, part, decoder, config, geometry.mip_of_cell)
    return np.asarray(values[place.reshape(-1), row % side * side + column % side])


def decode_mip(texture: BlockTexture, decoder: BlockDecoder, config: BlockConfig, level: int = 0) -> Array:
    """[h, w, channels] float64 in [0, 1], in the texture's colour space: mip `level`."""
    geometry = texture_levels(texture, config)[level]
    values = block_values(texture, texture_codes(texture, config, level), decoder, config, geometry.mip_of_cell)
    return np.asarray(image_of(np.clip(values, 0.0, 1.0), geometry, config))


def decode_image(
    texture: BlockTexture, decoder: BlockDecoder, config: BlockConfig, level: int = 0
) -> NDArray[np.uint8]:
    """[h, w, channels] uint8 in the texture's colour space: mip `level`."""
    return np.asarray(np.rint(decode_mip(texture, decoder, config, level) * 255.0), np.uint8)


def decode_alpha(
    texture: BlockTexture, decoder: BlockDecoder, config: BlockConfig, level: int = 0
) -> NDArray[np.uint8]:
    """[h, w] uint8: the map `alpha` of mip `level`, which the codec has. Only its coefficients are read."""
    geometry = texture_levels(texture, config)[level]
    values = channel_values(texture, texture_codes(texture, config, level), decoder, config, geometry.mip_of_cell)
    image = image_of(np.clip(values, 0.0, 1.0)[..., None], geometry, config)[..., 0]
    return np.asarray(np.rint(image * 255.0), np.uint8)


def channel_values(
    texture: BlockTexture, stored: BlockCodes, decoder: BlockDecoder, config: BlockConfig, mip: int
) -> Array:
    """[blocks, texels] float64, not clamped: the map `alpha` as `block_values` decodes it, which no axis joins with other maps."""
    channel = config.output_channels - 1
    coefficients = channel_coefficients(stored, decoder, config, channel)
    rows_of_channel = decoder.channels == channel
    rows = averaged_rows(
        decoder.basis[rows_of_channel].astype(np.float64) * scale_values(decoder.basis_scale[rows_of_channel])[:, None],
        config,
        mip,
    )
    base = np.full((len(stored.codes), rows.shape[1]), float(texture.mean[mip, channel]))
    part = edge_parts(stored, decoder, config)[-1]
    base[part.blocks] = edge_values(part, config, mip)[..., 0] + float(
        texture.mean[mip, channel] - texture.mean[0, channel]
    )
    return np.asarray(base + coefficients @ rows * float(texture.axes[channel, channel]))


def image_of(blocks: NDArray[np.floating], level: LatentLevel, config: BlockConfig) -> NDArray[np.floating]:
    """[height, width, C]: the image of `level` whose blocks [rows * columns, texels, C] `blocks` are."""
    side = config.code_sides[level.mip_of_cell]
    parts = blocks.reshape(level.height, level.width, side, side, -1).transpose(0, 2, 1, 3, 4)
    return parts.reshape(level.height * side, level.width * side, -1)[: level.texel_height, : level.texel_width]


def lookup_values(
    texture: BlockTexture,
    decoder: BlockDecoder,
    config: BlockConfig,
    uv: Array,
    lod: Array,
    wrap: tuple[WrapMode, WrapMode],
) -> Array:
    """[N, output_channels] float64, not clamped, at `uv` [N, 2] and `lod` [N]: decoded texels are blended."""
    levels = texture_levels(texture, config)

    def of_level(level: LatentLevel, at: Array) -> Array:
        def texel(column: NDArray[np.int64], row: NDArray[np.int64]) -> Array:
            return texel_values(texture, decoder, config, levels.index(level), column, row)

        return bilinear(texel, (level.texel_width, level.texel_height), at, wrap)

    return trilinear(levels, of_level, config.output_channels, uv, clamped_lod(lod, len(levels)), wrap)
