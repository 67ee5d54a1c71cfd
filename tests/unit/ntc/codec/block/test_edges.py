"""Edge parts of codec `block`: two colours and an index a texel, and what flat graphics gain by them."""

import itertools
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.block import reference
from ntc.codec.block.config import BlockConfig, BlockOptions
from ntc.codec.block.encoding import edges
from ntc.codec.block.encoding.blocks import Axes
from ntc.codec.block.encoding.encoder import encode_group
from ntc.codec.block.encoding.measuring import finest_image
from ntc.codec.block.encoding.rate import config_for_bits
from ntc.codec.block.encoding.stages import BlockEncoder
from ntc.codec.config import ColorSpace
from ntc.codec.encoding import EncodingTask, texture_set
from ntc.codec.mips import mip_chain
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture, hash_pixels
from tests.unit.ntc.codec.block.test_block import smooth_texture


def flat_graphic(side: int, seed: int = 0, colours: int = 6) -> SourceTexture:
    """Overlapping discs and rectangles of a few colours, without any gradient."""
    random = np.random.default_rng(seed)
    palette = random.integers(0, 256, (colours, 3)).astype(np.uint8)
    pixels = np.empty((side, side, 3), np.uint8)
    pixels[:] = palette[0]
    y, x = np.mgrid[0:side, 0:side]
    for number in range(40):
        cx, cy, radius = random.uniform(0, side), random.uniform(0, side), random.uniform(2, side / 6)
        disc = (x - cx) ** 2 + (y - cy) ** 2 < radius**2
        square = (np.abs(x - cx) < radius) & (np.abs(y - cy) < radius / 2)
        pixels[disc if number % 2 else square] = palette[number % colours]
    return SourceTexture(f"flat {seed}", pixels, hash_pixels(pixels))


def quality_at(source: SourceTexture, bits: float) -> float:
    """PSNR of mip 0 at `bits` a texel."""
    config = config_for_bits(bits, texture_set([source], 1))
    grouping = Grouping("single", (0,))
    encoder = BlockEncoder(EncodingTask((source,), grouping, config, BlockOptions(), (0,)))
    for _ in encoder.pieces():
        pass
    (group,) = encoder.encoded((0,))
    return group.textures[0].psnr_db or 0.0


@pytest.mark.parametrize("source", [flat_graphic(64, 3, 3), smooth_texture(64, 64)])
def test_more_bits_never_make_a_texture_worse(source: SourceTexture) -> None:
    found = [quality_at(source, bits) for bits in (2.0, 3.0, 6.0)]
    assert all(more >= less - 0.05 for less, more in itertools.pairwise(found)), found


def test_flat_graphics_take_edge_parts_and_waves_do_not() -> None:
    config = BlockConfig(coefficients=60, modes=16)
    flat, _ = encode_group([flat_graphic(128)], config)
    waves, _ = encode_group([smooth_texture(128, 128)], config)
    assert flat.edges.any()
    assert not waves.edges.any()


@pytest.mark.parametrize("source", [flat_graphic(96), smooth_texture(40, 24)])
def test_what_measures_quality_decodes_as_the_reference_does(source: SourceTexture) -> None:
    config = BlockConfig(coefficients=60, modes=16)
    decoder, (texture,) = encode_group([source], config)
    found = finest_image(texture, decoder, config).astype(int)
    difference = np.abs(found - reference.decode_image(texture, decoder, config))
    assert difference.max() <= 1
    assert (difference > 0).mean() < 1e-3


def checks(color_space: ColorSpace) -> SourceTexture:
    """A board of squares of 3x3 texels in two colours."""
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[(np.indices((64, 64)) // 3).sum(0) % 2 == 0] = (200, 30, 90)
    return SourceTexture("checks", pixels, hash_pixels(pixels), color_space=color_space)


def test_two_srgb_colours_are_averaged_near_to_linear_light() -> None:
    source = checks("srgb")
    config = BlockConfig(mips=4, block_words=(4, 5), mean_words=5.0, coefficients=24, modes=8)
    decoder, (texture,) = encode_group([source], config)
    truth = mip_chain(source.pixels, "srgb", source.maps)
    for level in (1, 2):
        difference = reference.decode_image(texture, decoder, config, level).astype(int) - truth[level]
        # Averages of stored values are up to 53 steps darker.
        assert np.abs(difference).max() <= 8, level


def test_blocks_of_two_colours_are_exact_at_both_mips() -> None:
    source = checks("linear")
    pixels = source.pixels
    config = BlockConfig(block_words=(4, 5), mean_words=5.0, coefficients=24, modes=8)
    decoder, (texture,) = encode_group([source], config)
    np.testing.assert_array_equal(reference.decode_image(texture, decoder, config), pixels)
    halved = pixels.reshape(32, 2, 32, 2, 3).mean(axis=(1, 3))
    assert np.abs(reference.decode_image(texture, decoder, config, 1) - halved).max() <= 1.0


@pytest.mark.parametrize(("side", "bits"), [(8, (1, 0)), (8, (2, 3)), (4, (0, 1)), (4, (3, 2))])
def test_edge_parts_and_the_cost_of_a_derived_mip_are_what_the_reference_shows(
    side: Literal[4, 8], bits: tuple[int, int]
) -> None:
    config = BlockConfig(block_side=side, coefficients=16, output_channels=5, maps=("base", "normal"))
    random = np.random.default_rng(side + bits[0])
    axes = random_axes(random, config)
    blocks = random.normal(0.0, 0.5, (60, config.block_values)).astype(np.float32)
    blocks[:20] = np.sign(blocks[:20])
    blocks[20] = 0.0
    found = edges.fitted_edges(blocks, axes, bits, config)
    costs = edges.derived_costs(blocks, found, axes, config)
    np.testing.assert_allclose(costs, derived_costs(blocks, found, axes, config), rtol=1e-3, atol=1e-4)
    for part, own, channels in zip(found.parts, bits, config.planes, strict=True):
        assert len(part.blocks) == (len(blocks) if own else 0)
        if own:
            values = (axes.mean[0] + blocks.reshape(60, -1, 5) @ axes.axes.T)[..., list(channels)]
            left = values - reference.edge_values(part, config, 0)
            rest = found.rest.reshape(60, -1, 5)[..., list(channels)]
            np.testing.assert_allclose(rest, left @ axes.inverse[np.ix_(channels, channels)], atol=1e-4)


def derived_costs(
    blocks: NDArray[np.float32], fit: edges.EdgeFit, axes: Axes, config: BlockConfig
) -> NDArray[np.float64]:
    """[blocks] squared error of mip 1 in units of the axes, in float64: averages of mip 0 against what codes show."""

    def halved(texels: NDArray[np.floating]) -> NDArray[np.float64]:
        half = config.block_side // 2
        return texels.astype(np.float64).reshape(-1, half, 2, half, 2, 5).mean((2, 4)).reshape(-1, half * half, 5)

    values = axes.mean[0] + blocks.reshape(60, -1, 5).astype(np.float64) @ axes.axes.T
    missed = np.where(axes.colours, np.sqrt(halved(np.square(values))), halved(values)) - axes.mean[1]
    for channels, part in zip(config.planes, fit.parts, strict=True):
        if len(part.blocks):
            own = list(channels)
            missed[..., own] += axes.mean[1][own] - reference.edge_values(part, config, 1, axes.colours[own])
    return np.square(missed @ axes.inverse - halved(fit.rest)).sum((1, 2))


def random_axes(random: np.random.Generator, config: BlockConfig) -> Axes:
    """Axes of a plane of colours and one of two numbers."""
    turned = np.zeros((5, 5))
    turned[:3, :3], turned[3:, 3:] = np.linalg.qr(random.normal(size=(3, 3)))[0], np.eye(2)
    weights = random.uniform(0.5, 2.0, 5)
    means = random.uniform(0.3, 0.7, (config.mips, 5)).astype(np.float32)
    matrix, back = 0.3 * turned / weights[:, None], turned * weights[:, None] / 0.3
    colours = np.array([True, True, True, False, False])
    return Axes(means, matrix.astype(np.float32), back.astype(np.float32), colours, True, 0.3)
