"""Codes of blocks whose modes are chosen: by the compiled search where numba is installed, else by torch. Both write the same bits
but where two paths are as good as each other to rounding."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ntc.codec.block.codes import bit_places, joined_words, packed_codes, start_states
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.quantizer import TrellisQuantizer
from ntc.codec.block.model import BlockDecoder
from ntc.codec.block.trellis import indices_of, scale_values

compiled: Any
try:
    from ntc.codec.block.encoding import compiled
except ImportError:
    compiled = None


def coded(
    values: NDArray[np.float32],
    modes: NDArray[np.int64],
    size: int,
    bits: NDArray[np.uint8],
    decoder: BlockDecoder,
    config: BlockConfig,
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """(codes [blocks, words of the largest code] uint32, squared errors [blocks]) of size class `size` for coefficients `values`
    [blocks, coefficients].

    `bits` [blocks, bits of the largest code] hold modes and edge parts (`bits_before_branches`).
    """
    if compiled is None:
        return coded_by_torch(values, modes, size, bits, decoder, config)
    words = joined_words(bits)
    errors = np.empty(len(values), np.float32)
    tables = compiled.search_tables(decoder, config, size)
    compiled.write_codes(np.ascontiguousarray(values), modes, words, errors, *tables)
    return words, errors


def coded_by_torch(
    values: NDArray[np.float32],
    modes: NDArray[np.int64],
    size: int,
    bits: NDArray[np.uint8],
    decoder: BlockDecoder,
    config: BlockConfig,
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """As `coded`, without compiled code."""
    places = bit_places(modes, np.full(len(modes), size), decoder, config)
    starts = start_states(bits, places.first)
    depths = torch.from_numpy(places.depths.astype(np.int64))
    scales = torch.from_numpy(scale_values(decoder.scales).astype(np.float32)[modes])
    given = torch.from_numpy(values)
    numbers, decoded = TrellisQuantizer().quantize(given, depths, scales, torch.from_numpy(starts))
    errors = (decoded - given).square().sum(1).numpy()
    return packed_codes(bits, places, indices_of(numbers.numpy(), places.depths, starts)), errors
