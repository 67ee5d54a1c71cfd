"""Coarse pictures of large groups, before they are encoded."""

from typing import cast

import numpy as np

from ntc.codec.block.config import BlockOptions
from ntc.codec.block.encoding.blocks import reduced
from ntc.codec.block.encoding.stages import BlockEncoder
from ntc.codec.block.model import BlockTexture
from ntc.codec.encoding import EncodingTask
from ntc.codec.model import Grouping
from ntc.training.encode import encode_textures
from tests.support.textures import waves
from tests.unit.ntc.codec.block.test_encoding import SMALL


def test_large_groups_are_shown_coarse_first_and_come_out_the_same() -> None:
    """A preview of every group comes before the groups, and changes nothing of them."""
    textures = [waves(96, 96, seed=seed) for seed in range(2)]
    grouping = Grouping("baseline", (0, 1))
    plain = encode_textures(textures, grouping, SMALL, BlockOptions(groups_apart=True))
    task = EncodingTask(tuple(textures), grouping, SMALL, BlockOptions(groups_apart=True, preview_side=12), (0, 1))
    encoder = BlockEncoder(task)
    seen: list[tuple[int, int, float | None]] = []
    ended: dict[int, BlockTexture] = {}
    for piece in encoder.pieces():
        for found in encoder.encoded(piece.groups):
            (texture,) = found.textures
            seen.append((found.group, texture.width, texture.psnr_db))
        for found in encoder.encoded(piece.ended):
            ended[found.group] = cast(BlockTexture, found.textures[0])
    assert seen == [(0, 12, None), (1, 12, None)]
    assert encoder.figures().share == 1.0
    for group, texture in enumerate(plain.textures):
        np.testing.assert_array_equal(ended[group].words, cast(BlockTexture, texture).words)
    assert reduced(textures[0], 12).size == (12, 12)
    assert reduced(textures[0], 96) is textures[0]
