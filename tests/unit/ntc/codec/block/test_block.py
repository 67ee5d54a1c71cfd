"""Codec `block`: codes, trellis, encoder and float64 decoding."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from ntc.codec.block import reference
from ntc.codec.block.codes import bit_places, bits_before_branches, unpacked_codes
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.blocks import blocks_of
from ntc.codec.block.encoding.compiled_trellis import coded
from ntc.codec.block.encoding.encoder import encode_group
from ntc.codec.block.encoding.measuring import coefficients_of
from ntc.codec.block.model import BlockDecoder, BlockTexture, stored_scales
from ntc.codec.block.reference import image_of
from ntc.codec.block.storage import BlockCodes
from ntc.codec.block.trellis import (
    BRANCHES,
    LARGEST_DEPTH,
    level_table,
    scale_values,
    share_out_bits,
)
from ntc.codec.codec import texture_fields
from ntc.codec.latents import latent_levels
from ntc.codec.mips import mip_chain
from ntc.codec.quality import psnr_db
from ntc.codec.textures import SourceTexture, hash_pixels
from tests.support.textures import of_pixels

SMALL = BlockConfig(coefficients=40, modes=8)


def smooth_texture(
    width: int, height: int, channels: int = 3, seed: int = 0, wrap: tuple[str, str] = ("repeat", "clamp")
) -> SourceTexture:
    """Waves and a little noise: what a transform compresses well."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width].astype(np.float64)
    waves = [
        np.sin(x * random.uniform(0.05, 0.6) + y * random.uniform(0.05, 0.6) + random.uniform(0, 6)) for _ in range(4)
    ]
    image = np.einsum("chw,cd->hwd", np.stack(waves), random.normal(size=(4, channels))) * 25 + 128
    pixels = np.clip(image + random.normal(size=image.shape) * 3, 0, 255).astype(np.uint8)
    return SourceTexture(f"waves {seed}", pixels, hash_pixels(pixels), wrap=wrap)  # type: ignore[arg-type]


def random_decoder(config: BlockConfig, seed: int = 0) -> BlockDecoder:
    """Valid tables without meaning."""
    random = np.random.default_rng(seed)
    count = config.coefficients
    return BlockDecoder(
        random.integers(-127, 128, (count, config.block_texels)).astype(np.int8),
        np.sort(random.integers(0, config.output_channels, count)).astype(np.uint8),
        random.integers(30, 80, count).astype(np.uint8),
        random.integers(100, 200, (config.modes, count)).astype(np.uint8),
        random.integers(0, 4, (config.modes, len(config.planes))).astype(np.uint8),
    )


def random_codes(count: int, config: BlockConfig, seed: int = 0) -> BlockCodes:
    """Codes of random words: all are valid."""
    random = np.random.default_rng(seed)
    sizes = random.integers(0, len(config.block_words), count)
    words = random.integers(0, 1 << 32, (count, config.block_words[-1]), np.uint32)
    return BlockCodes(words * (np.arange(words.shape[1]) < np.array(config.block_words)[sizes, None]), sizes)


@given(st.integers(1, 70), st.integers(1, 70), st.sampled_from([4, 8]), st.integers(1, 4))
@settings(max_examples=40, deadline=None)
def test_every_size_is_cut_into_blocks_and_put_together_again(w: int, h: int, side: int, channels: int) -> None:
    image = np.random.default_rng(w * h).random((h, w, channels), np.float32)
    config = BlockConfig(block_side=side, output_channels=channels, coefficients=4)  # type: ignore[arg-type]
    level = latent_levels(w, h, config)[0]
    blocks = blocks_of(image, side, ("repeat", "mirror"))
    assert blocks.shape == (level.cells, side * side, channels)
    np.testing.assert_array_equal(image_of(blocks, level, config), image)


def test_levels_end_with_the_first_mip_that_one_block_holds() -> None:
    levels = latent_levels(100, 20, BlockConfig())
    sizes = [(level.texel_width, level.texel_height) for level in levels]
    assert sizes == [(100, 20), (50, 10), (25, 5), (12, 2), (6, 1)]
    # Sides of 25 and 5 texels are not halved exactly: the mip below them has codes of its own.
    assert [level.mip_of_cell for level in levels] == [0, 1, 0, 0, 1]
    own = [level for level in levels if level.has_own_cells]
    begins = itertools.accumulate(level.cells for level in own[:-1])
    assert [level.first_cell for level in own] == [0, *begins]
    assert (levels[1].width, levels[1].height, levels[1].first_cell) == (13, 3, 0)
    assert latent_levels(1, 1, BlockConfig())[-1].cells == 1


@pytest.mark.parametrize("sizes", [(1,), (2,), (16,), (1, 2, 3), (2, 5, 9, 16)])
@pytest.mark.parametrize("modes", [8, 16, 64])
def test_codes_hold_modes_and_indices(sizes: tuple[int, ...], modes: int) -> None:
    config = BlockConfig(block_words=sizes, mean_words=sizes[0], modes=modes, coefficients=60)
    decoder, stored = random_decoder(config), random_codes(50, config, sizes[0])
    read = unpacked_codes(stored, decoder, config)
    np.testing.assert_array_equal(read.modes, stored.codes[:, 0] % modes)
    np.testing.assert_array_equal(read.depths, decoder.depths(config)[stored.sizes, read.modes])
    depths, edges = read.depths.astype(np.int64), decoder.edge_bits(config)[stored.sizes, read.modes]
    assert (depths.sum(1) + edges <= 32 * np.array(sizes)[stored.sizes] - config.mode_bits).all()
    assert (read.indices < 1 << depths).all()
    written = bits_before_branches(read.modes, stored.sizes, read.edges, decoder, config)
    places = bit_places(read.modes, stored.sizes, decoder, config)
    before = np.arange(written.shape[1]) < places.first[:, None]
    bits = np.unpackbits(stored.codes.astype("<u4").view(np.uint8), axis=1, bitorder="little")
    np.testing.assert_array_equal(written, bits * before)
    expected = reference.decode_coefficients(read, decoder)
    np.testing.assert_array_equal(coefficients_of(stored, decoder, config), expected)


def test_any_words_decode_to_finite_values() -> None:
    decoder = random_decoder(SMALL)
    random = np.random.default_rng(1)
    words = random.integers(0, 1 << 32, (500, SMALL.block_words[-1]), dtype=np.uint32)
    stored = BlockCodes(words, random.integers(0, len(SMALL.block_words), 500))
    known = texture_fields(smooth_texture(8, 8), 0)
    mean, axes = np.full((2, 3), 0.5, np.float32), np.eye(3, dtype=np.float32)
    texture = BlockTexture(**known, words=words[0], mean=mean, axes=axes)
    for mip in range(SMALL.mips):
        assert np.isfinite(reference.block_values(texture, stored, decoder, SMALL, mip)).all()


def shares(scales: NDArray[np.uint8], *bits: int) -> NDArray[np.uint8]:
    """Return the depths of one mode by numbers of bits."""
    return share_out_bits(scales[None], np.array(bits)[:, None])[:, 0]


def test_bits_go_where_they_lower_the_error_most() -> None:
    scales = stored_scales(np.array([10.0, 1.0, 1.0, 1e-3]))
    (depths,) = shares(scales, 9)
    assert depths.sum() == 9
    assert depths[0] > depths[1] >= depths[2] > depths[3]
    assert shares(scales[1:3], 100).tolist() == [[LARGEST_DEPTH, LARGEST_DEPTH]]
    assert shares(scales[:1], 0).tolist() == [[0]]
    # Every reader derives the same bits: falling with the scale, and written down, as files depend on it.
    many = np.arange(40, 240, 5, dtype=np.uint8)
    found = shares(many[::-1], 30, 90, 250).tolist()
    assert [sum(own) for own in found] == [30, 90, 250]
    assert all(own == sorted(own, reverse=True) for own in found)
    assert found[0][:12] == [5, 4, 4, 3, 3, 3, 2, 2, 2, 1, 1, 0]
    values = np.geomspace(1e-3, 8.0, 200)
    np.testing.assert_allclose(scale_values(stored_scales(values)), values, rtol=2 ** (0.5 / 16) - 1 + 1e-9)


def _best_by_trying_all(
    values: NDArray[np.float64], depths: list[int], scales: NDArray[np.float64], start: int
) -> float:
    """Least squared error over all paths and all levels, without dynamic programming."""
    levels = level_table()
    best = np.inf
    for branches in itertools.product((0, 1), repeat=len(values)):
        state, error = start, 0.0
        for value, depth, scale, branch in zip(values, depths, scales, branches, strict=True):
            if depth == 0:
                error += value**2
                continue
            state, subset = BRANCHES[state][branch]
            error += np.square(levels[depth, subset : 2 << depth : 4] * scale - value).min()
        best = min(best, error)
    return float(best)


def coded_values(
    values: NDArray[np.float64], modes: NDArray[np.int64], size: int, decoder: BlockDecoder, config: BlockConfig
) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """(coefficients that the reference decodes of the codes of `values`, squared errors that the search reports)."""
    sizes = np.full(len(modes), size)
    bits = bits_before_branches(modes, sizes, (), decoder, config)
    codes, errors = coded(values.astype(np.float32), modes, size, bits, decoder, config)
    assert not codes[:, config.block_words[size] :].any()
    return reference.decode_coefficients(unpacked_codes(BlockCodes(codes, sizes), decoder, config), decoder), errors


def test_the_search_finds_the_best_path() -> None:
    config = BlockConfig(block_words=(1,), mean_words=1.0, coefficients=9, modes=8)
    random, modes = np.random.default_rng(5), np.arange(8)
    scales = stored_scales(10.0 ** random.uniform(-1.5, 0.5, (8, 9)))
    decoder = replace(random_decoder(config), scales=scales, edges=np.zeros((8, 1), np.uint8))
    values = random.normal(size=(8, 9)) * 2.0
    depths = decoder.depths(config)[0]
    assert 0 in depths
    _, errors = coded_values(values, modes, 0, decoder, config)
    # A path starts in the state of the mode's three bits, the first one highest.
    starts = [int(f"{mode:03b}"[::-1], 2) for mode in modes]
    for value, depth, scale, start, error in zip(
        values, depths.tolist(), scale_values(scales), starts, errors, strict=True
    ):
        assert error == pytest.approx(_best_by_trying_all(value, depth, scale, start), abs=2e-3)


def test_codes_decode_to_the_error_that_the_search_reports() -> None:
    config = BlockConfig(coefficients=60, modes=8)
    decoder, random = random_decoder(config), np.random.default_rng(2)
    for size in range(len(config.block_words)):
        modes = random.integers(0, config.modes, 200)
        values = random.normal(size=(200, 60)) * scale_values(decoder.scales)[modes] * 1.5
        decoded, errors = coded_values(values, modes, size, decoder, config)
        np.testing.assert_allclose(np.square(decoded - values).sum(1), errors, rtol=1e-3)


@pytest.mark.parametrize("size", [(64, 64), (40, 24), (7, 3), (1, 1)])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_a_texture_of_any_size_and_channels_comes_back(size: tuple[int, int], channels: int) -> None:
    config = BlockConfig(output_channels=channels, coefficients=24, modes=8)
    source = smooth_texture(*size, channels=channels)
    decoder, (texture,) = encode_group([source], config)
    levels = latent_levels(*size, config)
    for number, (mip, level) in enumerate(zip(mip_chain(source.pixels, "srgb"), levels, strict=False)):
        decoded = reference.decode_image(texture, decoder, config, number)
        assert decoded.shape == (level.texel_height, level.texel_width, channels)
        if level.texel_width * level.texel_height >= 64:
            assert psnr_db(decoded, mip) > 25.0


def test_a_constant_texture_is_exact_and_the_same_seed_gives_the_same_bytes() -> None:
    pixels = np.full((16, 16, 3), (10, 200, 77), np.uint8)
    decoder, (texture,) = encode_group([of_pixels(pixels)], SMALL)
    np.testing.assert_array_equal(reference.decode_image(texture, decoder, SMALL), pixels)
    sources = [smooth_texture(48, 32, seed=seed) for seed in range(2)]
    first, second = (encode_group(sources, SMALL, seed=9) for _ in range(2))
    assert first[0].basis.tobytes() == second[0].basis.tobytes()
    assert all(a.words.tobytes() == b.words.tobytes() for a, b in zip(first[1], second[1], strict=True))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("block_side", 5),
        ("block_words", (0, 1)),
        ("block_words", (2, 2)),
        ("block_words", (1, 17)),
        ("block_words", ()),
        ("mean_words", 0.0),
        ("modes", 12),
        ("modes", 4),
        ("mips", 3),
        ("format", 1),
        ("coefficients", 193),
    ],
)
def test_settings_out_of_range_are_named(field: str, value: object) -> None:
    with pytest.raises(ValueError, match=field):
        BlockConfig(**{field: value})  # type: ignore[arg-type]
