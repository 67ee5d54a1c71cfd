"""What decoders of codec `block` hold, as shaders/ntc/block.glsl reads it: blocks of four 32-bit words.

First the levels of the trellis, which all decoders share. Then for each decoder
- for each mode the list of its coefficients that have bits: where the coefficient's basis begins, its depth, its scale
  as float32, the first of its bits in a block's code; a depth of 0 ends the list;
- for each coefficient, for each texel of a block, the rows of the basis of it and of its neighbours at (1, 0), (0, 1), (1, 1): a
  signed byte for each channel. So one fetch serves a bilinear footprint. Beyond the block's edge they are 0.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import LARGEST_DEPTH, BlockCodecConfig
from ntc.codec.block.model import BlockDecoder, scale_values
from ntc.codec.block.trellis import branch_tables, level_table

Words = NDArray[np.uint32]


@lru_cache(maxsize=1)
def trellis_blocks() -> Words:
    """[blocks, 4] uint32: levels as float32. Depth b begins at block 2^(b - 1) - 1; each block holds one level of each subset."""
    levels = level_table()
    parts = [levels[depth, : 2 << depth].reshape(-1, 4) for depth in range(1, LARGEST_DEPTH + 1)]
    return np.concatenate(parts).astype("<f4").view("<u4")


def trellis_subsets() -> int:
    """Subset by state and branch bit, two bits each, that of branch 0 of state 0 in the lowest ones.

    The next state needs no table: it is (2 state + branch) modulo 8.
    """
    _, subsets = branch_tables()
    return sum(int(subset) << (2 * place) for place, subset in enumerate(subsets.reshape(-1)))


class BlockTables:
    """Where the tables of one decoder lie."""

    kind: Literal["f4", "f2", "u4"] = "u4"
    block_bytes = 16
    loop_length = 1
    adapter_blocks = 0

    def __init__(self, config: BlockCodecConfig) -> None:
        self._config = config
        self.first_block = len(trellis_blocks())
        self.list_blocks = min(config.coefficients, config.coefficient_bits) + 1
        self.basis = config.modes * self.list_blocks
        self.blocks = self.basis + config.coefficients * config.block_texels

    def _lists(self, decoder: BlockDecoder) -> Words:
        config, depths = self._config, decoder.depths.astype(np.uint32)
        scales = (scale_values(decoder.scales) * decoder.basis_scale.astype(np.float64)).astype("<f4").view("<u4")
        starts = config.mode_bits + np.cumsum(depths, axis=1, dtype=np.uint32) - depths
        lists = np.zeros((config.modes, self.list_blocks, 4), np.uint32)
        for mode in range(config.modes):
            active = np.nonzero(depths[mode])[0]
            columns = (active * config.block_texels, depths[mode, active], scales[mode, active], starts[mode, active])
            lists[mode, : len(active)] = np.stack(columns, axis=-1)
        return lists.reshape(-1, 4)

    def _basis(self, decoder: BlockDecoder) -> Words:
        side, channels = self._config.block_side, self._config.output_channels
        rows = np.zeros((self._config.coefficients, side + 1, side + 1, 4), np.int8)
        rows[:, :side, :side, :channels] = decoder.basis.reshape(-1, side, side, channels)
        words = rows.view("<u4")[..., 0]
        corners = [words[:, y : y + side, x : x + side] for y in (0, 1) for x in (0, 1)]
        return np.stack(corners, axis=-1).reshape(-1, 4)

    def decoder_bytes(self, decoder: BlockDecoder) -> bytes:
        """The tables of one decoder."""
        return np.concatenate([self._lists(decoder), self._basis(decoder)]).astype("<u4").tobytes()

    def all_bytes(self, decoders: Sequence[BlockDecoder]) -> bytes:
        """The whole buffer."""
        return b"".join([trellis_blocks().tobytes(), *(self.decoder_bytes(decoder) for decoder in decoders)])


def block_glsl(config: BlockCodecConfig) -> str:
    """Defines of shaders/ntc/block.glsl."""
    tables = BlockTables(config)
    values = {
        "BLOCK_SIDE": config.block_side,
        "MODES": config.modes,
        "FIRST_TABLE_BLOCK": tables.first_block,
        "TABLE_BLOCKS": tables.blocks,
        "LIST_BLOCKS": tables.list_blocks,
        "TRELLIS_SUBSETS": f"{trellis_subsets()}u",
    }
    lines = [f"#define {name} {value}" for name, value in values.items()]
    return "\n".join(
        ["// Generated from viewer/render/resources/block_tables.py for one BlockCodecConfig.", *lines, ""]
    )
