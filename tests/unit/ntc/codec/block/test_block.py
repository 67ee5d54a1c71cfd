"""Codec `block`: codes, trellis, encoder and float64 decoding."""

import itertools

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from ntc.codec.block import reference
from ntc.codec.block.codes import bit_places, bits_before_branches, packed_codes, start_states, unpacked_codes
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.blocks import blocks_of
from ntc.codec.block.encoding.encoder import encode_group
from ntc.codec.block.encoding.quantizer import TrellisQuantizer
from ntc.codec.block.encoding.search import coded, coded_by_torch
from ntc.codec.block.model import BlockDecoder, BlockTexture, stored_scales
from ntc.codec.block.reference import image_of
from ntc.codec.block.storage import BlockCodes
from ntc.codec.block.trellis import BRANCHES, LARGEST_DEPTH, indices_of, level_table, scale_values, share_out_bits
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


def packed(
    modes: NDArray[np.int64],
    sizes: NDArray[np.int64],
    indices: NDArray[np.uint32],
    decoder: BlockDecoder,
    config: BlockConfig,
    seed: int = 0,
) -> NDArray[np.uint32]:
    """Codes of these indices, with random edge parts where modes have them."""
    random = np.random.default_rng(seed)
    bits = random.integers(0, 2, (len(modes), 32 * config.block_words[-1])).astype(np.uint8)
    places = bit_places(modes, sizes, decoder, config)
    bits *= np.arange(bits.shape[1]) < places.first[:, None]
    modes_alone = bits_before_branches(modes, sizes, (), decoder, config)
    own = np.arange(bits.shape[1]) < config.mode_bits
    return packed_codes(np.where(own, modes_alone, bits).astype(np.uint8), places, indices)


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
    decoder, random = random_decoder(config), np.random.default_rng(sizes[0])
    chosen, size = random.integers(0, modes, 50), random.integers(0, len(sizes), 50)
    allocations = decoder.depths(config)
    depths = allocations[size, chosen].astype(np.int64)
    edges = decoder.edge_bits(config)[size, chosen]
    assert (depths.sum(1) + edges <= 32 * np.array(sizes)[size] - config.mode_bits).all()
    indices = (random.integers(0, 1 << 30, depths.shape) & ((1 << depths) - 1)).astype(np.uint32)
    codes = packed(chosen, size, indices, decoder, config)
    assert codes.shape == (50, sizes[-1])
    assert not (codes[np.arange(sizes[-1]) >= np.array(sizes)[size, None]]).any()
    found = unpacked_codes(BlockCodes(codes, size), decoder, config)
    np.testing.assert_array_equal(found.modes, chosen)
    np.testing.assert_array_equal(found.depths, depths)
    np.testing.assert_array_equal(found.indices, indices)
    written = bits_before_branches(chosen, size, found.edges, decoder, config)
    before = np.arange(written.shape[1]) < bit_places(chosen, size, decoder, config).first[:, None]
    bits = np.unpackbits(codes.astype("<u4").view(np.uint8), axis=1, bitorder="little")
    np.testing.assert_array_equal(written, bits * before)


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


def test_bits_go_where_they_lower_the_error_most() -> None:
    scales = stored_scales(np.array([10.0, 1.0, 1.0, 1e-3]))
    depths = share_out_bits(scales, 9)
    assert depths.sum() == 9
    assert depths[0] > depths[1] >= depths[2] > depths[3]
    assert share_out_bits(scales[1:3], 100).tolist() == [LARGEST_DEPTH, LARGEST_DEPTH]
    assert share_out_bits(scales[:1], 0).tolist() == [0]
    # Every reader derives the same bits: falling with the scale, and written down, as files depend on it.
    many = np.arange(40, 240, 5, dtype=np.uint8)
    found = [share_out_bits(many[::-1], bits).tolist() for bits in (30, 90, 250)]
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


def test_the_quantizer_finds_the_best_path() -> None:
    random = np.random.default_rng(5)
    depths = [3, 0, 1, 2, 1, 0, 4, 1]
    quantizer = TrellisQuantizer()
    for start in range(8):
        values, scales = random.normal(size=8) * 2, random.uniform(0.5, 2.0, 8)
        table = torch.tensor([depths])
        _, decoded = quantizer.quantize(
            torch.tensor(values[None], dtype=torch.float32),
            table,
            torch.tensor(scales[None], dtype=torch.float32),
            torch.tensor([start]),
        )
        found = float(np.square(decoded[0].numpy() - values).sum())
        assert found == pytest.approx(_best_by_trying_all(values, depths, scales, start), abs=2e-3)


def test_what_is_stored_decodes_to_what_the_quantizer_chose() -> None:
    config = BlockConfig(coefficients=60, modes=8)
    decoder, random = random_decoder(config), np.random.default_rng(2)
    modes = random.integers(0, config.modes, 200)
    sizes = random.integers(0, len(config.block_words), 200)
    places = bit_places(modes, sizes, decoder, config)
    depths, scales = places.depths.astype(np.int64), scale_values(decoder.scales)[modes]
    values = torch.from_numpy((random.normal(size=depths.shape) * scales * 1.5).astype(np.float32))
    bits = bits_before_branches(modes, sizes, (), decoder, config)
    starts = start_states(bits, places.first)
    numbers, decoded = TrellisQuantizer().quantize(
        values, torch.from_numpy(depths), torch.from_numpy(scales.astype(np.float32)), torch.from_numpy(starts)
    )
    codes = packed_codes(bits, places, indices_of(numbers.numpy(), depths, starts))
    found = unpacked_codes(BlockCodes(codes, sizes), decoder, config)
    np.testing.assert_allclose(reference.decode_coefficients(found, decoder), decoded.numpy(), rtol=1e-5, atol=1e-6)


def test_the_compiled_search_writes_what_torch_writes() -> None:
    config = BlockConfig(coefficients=60, modes=8)
    decoder, random = random_decoder(config), np.random.default_rng(4)
    for size, words in enumerate(config.block_words):
        modes = random.integers(0, config.modes, 200)
        values = (random.normal(size=(200, 60)) * scale_values(decoder.scales)[modes]).astype(np.float32)
        bits = bits_before_branches(modes, np.full(200, size), (), decoder, config)
        codes, errors = coded(values, modes, size, bits.copy(), decoder, config)
        expected, expected_errors = coded_by_torch(values, modes, size, bits.copy(), decoder, config)
        # Two paths may be as good as each other to rounding.
        assert (codes == expected).all(1).mean() > 0.97
        np.testing.assert_allclose(errors, expected_errors, rtol=1e-3)
        assert not codes[:, words:].any()


def test_trellis_coding_beats_scalar_levels_by_what_the_literature_says() -> None:
    random = np.random.default_rng(3)
    values = torch.from_numpy(random.normal(size=(2000, 64)).astype(np.float32))
    _, decoded = TrellisQuantizer().quantize(
        values, torch.full((2000, 64), 2), torch.ones((2000, 64)), torch.zeros(2000, dtype=torch.int64)
    )
    gain = -10 * np.log10(float((values - decoded).square().mean()))
    assert gain > 9.30 + 0.8  # A scalar Lloyd-Max quantiser of 2 bits has 9.30 dB (Max, 1960).


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


def test_more_bits_give_a_nearer_picture() -> None:
    sources = [smooth_texture(64, 64, seed=seed) for seed in range(3)]
    means = []
    for words in (2, 4, 8):
        config = BlockConfig(block_words=(words,), mean_words=words, coefficients=96, modes=8)
        decoder, textures = encode_group(sources, config)
        found = [reference.decode_image(texture, decoder, config) for texture in textures]
        means.append(np.mean([psnr_db(d, s.pixels) for d, s in zip(found, sources, strict=True)]))
    assert means[0] + 2 < means[1] < means[2] - 2


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
