"""What coarse mips of codec `block` can do without: random codes, which are as hostile as any, change by at most the bound."""

from typing import cast

import numpy as np
import pytest

from lab.bench.random_pack import random_block_pack, random_pack
from lab.benchmarks.coarse_mips import HALF_STEP, changed_values, changes, left_out, rows_of
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.model import BlockDecoder, BlockTexture
from ntc.errors import InputError

CONFIG = BlockConfig(block_words=(2, 16), mean_words=9.0, coefficients=150, modes=16, mips=4)


@pytest.mark.parametrize("mip", [1, 2, 3])
def test_values_without_small_coefficients_stay_within_half_a_step(mip: int) -> None:
    pack = random_block_pack([(64, 64)], (0,), CONFIG)
    texture, decoder = cast(BlockTexture, pack.textures[0]), cast(BlockDecoder, pack.decoders[0])
    own = changes(texture, decoder, CONFIG, mip)
    every = own.mean > 0.0
    changed = changed_values(texture, decoder, CONFIG, mip, left_out(own))
    assert np.abs(changed).max() <= HALF_STEP
    # The same bound holds for all of them, and is not far off.
    largest = np.abs(changed_values(texture, decoder, CONFIG, mip, every)).max()
    assert 0.02 * own.most.sum(axis=-1).max() < largest <= own.most.sum(axis=-1).max()


def test_fewer_are_needed_on_average_than_in_the_worst_case() -> None:
    rows = rows_of(random_block_pack([(64, 64)], (0,), CONFIG))
    assert [row["mip of the code"] for row in rows] == [1, 2, 3]
    for row in rows:
        assert row["needed on average"] <= row["needed"] <= row["coefficients"]
    with pytest.raises(InputError, match="format 2"):
        rows_of(random_pack())
