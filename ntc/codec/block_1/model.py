"""What codec `block` stores: tables of a group, codes and colour axes of a texture."""

from dataclasses import dataclass
from functools import lru_cache
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block_1.config import BlockConfig
from ntc.codec.block_trellis import share_out_bits
from ntc.codec.model import Decoder, EncodedTexture, Pack
from ntc.errors import InputError


@dataclass(frozen=True, eq=False)
class BlockDecoder(Decoder):
    """What the textures of a group share."""

    basis: NDArray[np.int8]
    """[coefficients, texels of a block, channels] int8: rows of the transform, -127 to 127. Of codecs for material sets each row is
    0 in all channels but one (`row_channels`)."""
    basis_scale: NDArray[np.float32]
    """[coefficients] float32: what a row's integers are multiplied by."""
    scales: NDArray[np.uint8]
    """[modes, coefficients] uint8: logarithmic scale of each coefficient's levels (`scale_values`)."""

    def depths(self, config: BlockConfig) -> NDArray[np.uint8]:
        """[sizes of codes, modes, coefficients] uint8: bits of each coefficient, 0 to LARGEST_DEPTH; they follow from the scales."""
        return _depths(np.ascontiguousarray(self.scales, np.uint8).tobytes(), len(self.scales), config.coefficient_bits)

    @property
    def row_channels(self) -> NDArray[np.uint8]:
        """[coefficients] uint8: the first channel that each row is not 0 in; 0 for a row of zeros."""
        return np.asarray(self.basis.any(axis=1).argmax(axis=1), np.uint8)

    def stored_bits(self, config: BlockConfig) -> int:
        """Bits of the tables in a pack."""
        return 8 * len(self.basis) * config.row_bytes + 32 * self.basis_scale.size + 8 * self.scales.size


@dataclass(frozen=True, eq=False, kw_only=True)
class BlockTexture(EncodedTexture):
    """One texture under a group's tables: value = mean + axes @ (what the block decodes to)."""

    words: NDArray[np.uint32]
    """[words] uint32: directories and codes of all levels (`ntc.codec.block_storage`)."""
    mean: NDArray[np.float32]
    """[channels] float32, in the texture's colour space, 0 to 1."""
    axes: NDArray[np.float32]
    """[channels, channels] float32: principal axes of the texture's values in columns, as long as its contrast; 0 where row and
    column are channels of different planes (`ntc.codec.maps.plane_channels`)."""


@dataclass(frozen=True, eq=False)
class BlockParts:
    """A pack of codec `block`, with its parts as what they are."""

    config: BlockConfig
    textures: tuple[BlockTexture, ...]
    decoders: tuple[BlockDecoder, ...]


def block_parts(pack: Pack) -> BlockParts:
    """The parts of a pack of codec `block`. Raises InputError for another codec."""
    if not isinstance(pack.config, BlockConfig):
        raise InputError(f"{pack.name}: codec {pack.config.kind} has no basis; use a pack of codec block here")
    textures, decoders = cast(tuple[BlockTexture, ...], pack.textures), cast(tuple[BlockDecoder, ...], pack.decoders)
    return BlockParts(pack.config, textures, decoders)


@lru_cache(maxsize=256)
def _depths(scales: bytes, modes: int, bits_of_sizes: tuple[int, ...]) -> NDArray[np.uint8]:
    """`BlockDecoder.depths`, which cannot be written to: whatever decodes a few texels asks for it again."""
    rows = np.frombuffer(scales, np.uint8).reshape(modes, -1)
    found = np.array([[share_out_bits(row, bits) for row in rows] for bits in bits_of_sizes], np.uint8)
    found.setflags(write=False)
    return found
