"""New textures in old groups: the best decoder is taken, decoders stay as they are, and what that loses is told."""

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.block.config import BlockOptions
from ntc.codec.block.encoding.frozen import encode_with_decoders
from ntc.codec.block.encoding.rate import config_for_bits
from ntc.codec.block.model import block_parts
from ntc.codec.encoding import texture_set
from ntc.codec.model import Grouping
from ntc.codec.registry import codec_named
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from ntc.training.encode import encode_textures


def stripes(phase: int, horizontal: bool) -> SourceTexture:
    """64 x 64 texels of waves along one axis, and a little noise."""
    y, x = np.mgrid[0:64, 0:64]
    wave = np.sin((y if horizontal else x) * (0.9 + 0.05 * phase) + phase) * 70.0 + 128.0
    noise = np.random.default_rng(phase).normal(0.0, 4.0, (64, 64))
    pixels: NDArray[np.uint8] = np.repeat((wave + noise)[..., None], 3, axis=-1).clip(0, 255).astype(np.uint8)
    return SourceTexture(f"{'rows' if horizontal else 'columns'} {phase}", pixels, hash_pixels(pixels))


def test_each_texture_takes_the_decoder_of_its_kind() -> None:
    old = [stripes(number, horizontal) for horizontal in (True, False) for number in range(4)]
    config = config_for_bits(2.0, texture_set(old, 2, None))
    pack = encode_textures(old, Grouping("clustered", (0, 0, 0, 0, 1, 1, 1, 1)), config, BlockOptions())
    new = [stripes(7, False), stripes(8, True), stripes(9, False)]
    found = encode_with_decoders(new, block_parts(pack).decoders, config, "clustered")
    assert found.grouping.groups == (0, 1, 0)
    assert found.config == config
    for own, expected in zip(
        block_parts(found).decoders, (block_parts(pack).decoders[1], block_parts(pack).decoders[0]), strict=True
    ):
        assert np.array_equal(own.basis, expected.basis)
        assert np.array_equal(own.scales, expected.scales)
    fresh = encode_textures(new, Grouping("single", (0, 0, 0)), config, BlockOptions())
    wrong = encode_with_decoders(new[:1], block_parts(pack).decoders[:1], config, "clustered")
    assert (found.textures[0].psnr_db or 0.0) > (wrong.textures[0].psnr_db or 0.0) + 1.0
    drift = codec_named("block").encode_with_decoders(new, [pack], 64)
    assert (drift.tried, drift.compared) == (2, 3)
    assert drift.pack.grouping.groups == found.grouping.groups
    # Waves of other lengths than those that the old decoder was fitted to.
    assert 0.0 < drift.fresh_db - drift.frozen_db < 8.0
    assert drift.fresh_db == pytest.approx(_of_mean_mse([each.psnr_db or 0.0 for each in fresh.textures]), abs=0.01)


def _of_mean_mse(values: list[float]) -> float:
    return float(10.0 * np.log10(255.0**2 / np.mean([255.0**2 / 10.0 ** (value / 10.0) for value in values])))


def test_the_same_seed_gives_the_same_pack() -> None:
    old = [stripes(number, True) for number in range(3)]
    config = config_for_bits(2.0, texture_set(old, 1, None))
    decoders = block_parts(encode_textures(old, Grouping("single", (0, 0, 0)), config, BlockOptions())).decoders
    packs = [encode_with_decoders([stripes(5, True)], decoders, config, "single", threads=n) for n in (1, 2)]
    one, two = (block_parts(pack).textures[0].words for pack in packs)
    assert np.array_equal(one, two)


def test_without_decoders_it_is_refused() -> None:
    old = [stripes(0, True)]
    config = config_for_bits(2.0, texture_set(old, 1, None))
    with pytest.raises(InputError, match="no decoder"):
        encode_with_decoders(old, [], config, "single")
