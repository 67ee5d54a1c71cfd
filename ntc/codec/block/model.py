"""Stored content of codec `block`: tables of a group, codes and colour axes of a texture."""

from dataclasses import dataclass
from functools import lru_cache
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.trellis import SCALE_ORIGIN, SCALE_STEPS_PER_OCTAVE, share_out_bits
from ntc.codec.mips import srgb_channels
from ntc.codec.model import Decoder, EncodedTexture, Pack
from ntc.errors import InputError


@dataclass(frozen=True, eq=False)
class BlockDecoder(Decoder):
    """The tables that the textures of a group share."""

    basis: NDArray[np.int8]
    """[coefficients, texels of a block] int8: rows of the transform, -127 to 127. Rows of a plane lie together, in the
    order of planes."""
    channels: NDArray[np.uint8]
    """[coefficients] uint8: the channel that each row adds to."""
    basis_scale: NDArray[np.uint8]
    """[coefficients] uint8: logarithmic scale of what a row's integers are multiplied by (`scale_values`)."""
    scales: NDArray[np.uint8]
    """[modes, coefficients] uint8: logarithmic scale of each coefficient's levels (`scale_values`)."""
    edges: NDArray[np.uint8]
    """[modes, planes] uint8: index bits a texel of the edge part of each plane, 0 to LARGEST_EDGE_BITS; 0: there is none."""
    gains: NDArray[np.int8] | None = None
    """[coefficients] or [bands] int8: stored in place of tables where `scales` are the shipped ones times these gains
    (`ntc.codec.block.universal`)."""

    def depths(self, config: BlockConfig) -> NDArray[np.uint8]:
        """[sizes of codes, modes, coefficients] uint8: bits of each coefficient, 0 to LARGEST_DEPTH; they follow from the scales."""
        room = np.array(config.block_words) * 32 - config.mode_bits
        left = room[:, None] - self.edge_bits(config)
        key = np.ascontiguousarray(self.scales, np.uint8).tobytes()
        return _depths(key, len(self.scales), tuple(map(tuple, left.tolist())))

    def fitting_edges(self, config: BlockConfig) -> NDArray[np.uint8]:
        """[sizes of codes, modes, planes] uint8: `edges`, and 0 for modes whose edge parts a size has no room for."""
        bits = self._edge_bits(config)
        fits = bits <= (np.array(config.block_words) * 32 - config.mode_bits)[:, None]
        return np.where(fits[..., None], self.edges, 0).astype(np.uint8)

    def edge_bits(self, config: BlockConfig) -> NDArray[np.int64]:
        """[sizes of codes, modes] int64: bits of the edge parts that a code has."""
        bits = self._edge_bits(config)
        fits = bits <= (np.array(config.block_words) * 32 - config.mode_bits)[:, None]
        return np.where(fits, bits, 0)

    def _edge_bits(self, config: BlockConfig) -> NDArray[np.int64]:
        rows = self.edges.tolist()
        return np.array([sum(config.edge_part_bits(p, bits) for p, bits in enumerate(row)) for row in rows], np.int64)

    def stored_bits(self, config: BlockConfig) -> int:
        """Bits of the tables in a pack."""
        if self.gains is not None:
            return 8 * self.gains.size
        return 8 * (len(self.basis) * config.row_bytes + self.scales.size + self.edges.size)


@dataclass(frozen=True, eq=False, kw_only=True)
class BlockTexture(EncodedTexture):
    """One texture under a group's tables: value = mean + axes @ (normalised value of the block)."""

    words: NDArray[np.uint32]
    """[words] uint32: directories and codes of all levels (`ntc.codec.block.storage`)."""
    mean: NDArray[np.float32]
    """[mips of a code, channels] float32, in the texture's colour space."""
    axes: NDArray[np.float32]
    """[channels, channels] float32: principal axes of the texture's values in columns, as long as its contrast; 0 where row and
    column are channels of different planes (`ntc.codec.maps.plane_channels`)."""

    def colours(self, config: BlockConfig) -> NDArray[np.bool_]:
        """[channels] bool: which are sRGB-coded."""
        return np.array(srgb_channels(config.maps, config.output_channels, self.color_space))


@dataclass(frozen=True, eq=False)
class BlockParts:
    """The typed parts of a pack of codec `block`."""

    config: BlockConfig
    textures: tuple[BlockTexture, ...]
    decoders: tuple[BlockDecoder, ...]


def block_parts(pack: Pack) -> BlockParts:
    """Return the parts of a pack of codec `block`. Raises InputError for another codec."""
    if not isinstance(pack.config, BlockConfig):
        raise InputError(f"{pack.name}: codec {pack.config.kind} has no basis; use a pack of codec block here")
    textures, decoders = cast(tuple[BlockTexture, ...], pack.textures), cast(tuple[BlockDecoder, ...], pack.decoders)
    return BlockParts(pack.config, textures, decoders)


@lru_cache(maxsize=256)
def _depths(scales: bytes, modes: int, bits: tuple[tuple[int, ...], ...]) -> NDArray[np.uint8]:
    """Return `BlockDecoder.depths`, read-only and cached, because decoding a few texels needs them each time. `bits` by size and
    mode."""
    rows = np.frombuffer(scales, np.uint8).reshape(modes, -1)
    depths = share_out_bits(rows, np.array(bits))
    depths.setflags(write=False)
    return depths


def averaged_rows(rows: NDArray[np.floating], config: BlockConfig, mip: int) -> NDArray[np.float64]:
    """[coefficients, texels of a code's mip `mip`] float64: `rows` [coefficients, texels of a block] averaged over squares of
    texels."""
    side, count = config.code_sides[mip], 1 << mip
    averaged = rows.reshape(len(rows), side, count, side, count).mean(axis=(2, 4), dtype=np.float64)
    return np.asarray(averaged.reshape(len(rows), side * side))


def stored_scales(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return the nearest stored scales of positive `values`, uint8 of their shape."""
    steps = np.rint(np.log2(np.maximum(values, 1e-9)) * SCALE_STEPS_PER_OCTAVE) + SCALE_ORIGIN
    stored: NDArray[np.uint8] = np.clip(steps, 0, 255).astype(np.uint8)
    return stored
