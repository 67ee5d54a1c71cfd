"""Material sets: places of channels, mips by kind of map, and codec `block` from the encoder to decoded texels."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.random_pack import random_block_pack
from ntc.codec.block import reference
from ntc.codec.block.codes import unpacked_codes
from ntc.codec.block.config import BlockConfig, BlockOptions
from ntc.codec.block.encoding.blocks import prepare_texture
from ntc.codec.block.encoding.rate import config_for_bits, side_bits
from ntc.codec.block.model import block_parts
from ntc.codec.block.start import mean_colour_pack
from ntc.codec.block.storage import read_texture, texture_tensors
from ntc.codec.block.trellis import scale_values
from ntc.codec.codec import texture_fields
from ntc.codec.encoding import texture_set
from ntc.codec.grid.model import GridConfig
from ntc.codec.maps import (
    BASE_ALONE,
    EQUAL_WEIGHTS,
    MAP_CHANNELS,
    MAPS,
    SEEN_WEIGHTS,
    MapName,
    MapWeights,
    channel_places,
    joint_maps,
    map_slices,
    plane_channels,
)
from ntc.codec.mips import mip_chain, resize_to
from ntc.codec.model import Grouping, Pack
from ntc.codec.reference import decode_image, decode_texels
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from ntc.metrics.metrics import bits_with_mips
from ntc.training.encode import encode_textures

WHOLE: tuple[MapName, ...] = ("base", "normal", "roughness", "metalness", "occlusion")
KINDS: tuple[tuple[MapName, ...], ...] = (WHOLE, BASE_ALONE, ("normal", "occlusion"), MAPS)
SETS = BlockConfig(block_words=(2, 4, 7), coefficients=24, modes=8, output_channels=11, maps=MAPS)


def material(
    maps: tuple[MapName, ...], size: tuple[int, int] = (64, 32), base: int = 3, seed: int = 0
) -> SourceTexture:
    """Smooth maps of a few shared waves, as those of one material are alike; normals near upright."""
    random = np.random.default_rng(seed)
    channels = sum(base if name == "base" else MAP_CHANNELS[name] for name in maps)
    y, x = np.mgrid[0 : size[1], 0 : size[0]].astype(np.float64)
    turns = random.uniform(0.05, 0.5, (3, 2))
    waves = np.stack([np.sin(x * u + y * v) for u, v in turns], axis=-1)
    image = waves @ random.normal(size=(3, channels)) * 18.0 + 128.0 + random.normal(size=(*x.shape, channels)) * 2.0
    pixels = np.clip(image, 0, 255).astype(np.uint8)
    return SourceTexture(f"material {seed}", pixels, hash_pixels(pixels), maps=maps)


def test_channels_of_a_set_have_places_among_those_of_the_codec() -> None:
    assert channel_places(BASE_ALONE, 3, MAPS, 11) == (0, 1, 2)
    assert channel_places(("normal", "occlusion"), 3, MAPS, 12) == (4, 5, 11)
    assert channel_places(WHOLE, 8, WHOLE, 9) == (0, 1, 2, 4, 5, 6, 7, 8)
    for maps, channels in ((("emissive",), 3), (BASE_ALONE, 4)):
        with pytest.raises(ValueError, match="the codec has none, or fewer"):
            channel_places(maps, channels, WHOLE, 8)
    assert joint_maps([(BASE_ALONE, 4), (("normal", "occlusion"), 3), (("base", "emissive"), 6)]) == (
        ("base", "normal", "emissive", "occlusion"), 10,
    )  # fmt: skip


@pytest.mark.parametrize("kind", [BlockConfig, GridConfig])
def test_codecs_name_maps_and_channels_that_do_not_fit(kind: type) -> None:
    kind(maps=MAPS, output_channels=12)
    for maps, channels, field in (
        (MAPS, 13, "output_channels"),
        (WHOLE, 4, "output_channels"),
        (MAPS[::-1], 11, "maps"),
    ):
        with pytest.raises(ValueError, match=f"codec.{field} = "):
            kind(maps=maps, output_channels=channels)


def test_mips_filter_each_map_as_what_it_is() -> None:
    source = material(MAPS, (16, 8), base=4)
    chain = mip_chain(source.pixels, "srgb", MAPS)
    slices = map_slices(MAPS, 12)
    for name, space in (("base", "srgb"), ("emissive", "srgb"), ("roughness", "linear"), ("occlusion", "linear")):
        own = mip_chain(np.ascontiguousarray(source.pixels[..., slices[name]]), space)  # type: ignore[index, arg-type]
        for mip, whole in zip(own, chain, strict=True):
            np.testing.assert_array_equal(mip, whole[..., slices[name]])  # type: ignore[index]
    small = resize_to(source.pixels, 8, 4, "srgb", MAPS)
    np.testing.assert_array_equal(small, chain[1])


def test_normals_are_filtered_as_vectors_and_stay_unit_vectors() -> None:
    # Two slopes that face each other: their mean is upright.
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[:, 0], pixels[:, 1] = (230, 128, 7), (25, 128, 9)
    _, last = mip_chain(pixels, "srgb", ("normal", "roughness"))
    assert np.abs(last[0, 0].astype(int) - (128, 128, 8)).max() <= 1
    # Of one slope the mean is the slope, though z is not stored; the mean of different ones has unit length again.
    tilted = np.full((4, 4, 2), (200, 100), np.uint8)
    for mip in mip_chain(tilted, "linear", ("normal",)):
        assert (mip == (200, 100)).all()
    pixels = np.zeros((1, 2, 2), np.uint8)
    pixels[0, 0], pixels[0, 1] = (255, 128), (128, 128)
    x = mip_chain(pixels, "linear", ("normal",))[1][0, 0, 0] / 127.5 - 1.0
    assert x == pytest.approx(np.sin(np.pi / 4), abs=0.01)


def test_axes_join_no_channels_of_different_planes() -> None:
    source = material(MAPS)
    axes = prepare_texture(source, SETS).axes
    planes = [list(channels.values()) for channels in plane_channels(MAPS, 11).values()]
    inside = np.zeros((11, 11), bool)
    for channels in planes:
        inside[np.ix_(channels, channels)] = True
    assert not axes.axes[~inside].any()
    np.testing.assert_allclose(axes.axes @ axes.inverse.T, np.eye(11), atol=1e-5)
    pack = mean_colour_pack([source], Grouping("single", (0,)), SETS)
    # Until it is encoded a set has the mean of each map.
    means = [decode_image(pack, 0, level).mean((0, 1)) for level in range(2)]
    np.testing.assert_allclose(means[0], source.pixels.mean((0, 1)), atol=1.0)
    np.testing.assert_array_equal(*means)
    texture = replace(block_parts(pack).textures[0], axes=axes.axes)
    tensors = texture_tensors(texture, SETS)
    parts = tensors["latents.{}.axes"]
    assert parts.shape == (SETS.axis_numbers,) == (3 * 3 + 4 * 4 + 4 * 4,)
    read = read_texture(tensors, texture_fields(source, 0), SETS)
    np.testing.assert_array_equal(read.axes, axes.axes)
    np.testing.assert_array_equal(parts[:9].reshape(3, 3), axes.axes[:3, :3])


def test_what_is_worth_more_comes_nearer() -> None:
    config = BlockConfig(coefficients=96, modes=8, output_channels=8, maps=WHOLE)
    normal = map_slices(WHOLE, 8)["normal"]

    def errors(weights: MapWeights) -> NDArray[np.float64]:
        source = replace(material(WHOLE, (128, 128)), map_weights=weights)
        pack = encode_textures([source], Grouping("single", (0,)), config, BlockOptions())
        difference = decode_image(pack, 0).astype(np.float64) - source.pixels
        return np.square(difference).mean((0, 1))

    plain, seen = errors(EQUAL_WEIGHTS), errors(MapWeights({"normal": 8.0}))
    assert seen[normal].mean() < 0.8 * plain[normal].mean()
    assert seen.mean() > plain.mean()
    assert SEEN_WEIGHTS.of_channels(WHOLE, 8).mean() == pytest.approx(1.0)
    with pytest.raises(ValueError, match=r"map_weights\.normal"):
        MapWeights({"normal": 0.0})


def mixed_pack(side: int = 8) -> tuple[list[SourceTexture], Pack]:
    """Textures of every kind in one group."""
    sources = [material(kind, (40, 24), seed=seed) for seed, kind in enumerate(KINDS)]
    config = replace(SETS, block_side=side, coefficients=120, block_words=(4, 8, 14), mean_words=8.0)  # type: ignore[arg-type]
    return sources, encode_textures(sources, Grouping("single", (0,) * len(sources)), config, BlockOptions())


@pytest.mark.parametrize("side", [4, 8])
def test_sets_of_every_kind_come_back(side: int) -> None:
    sources, pack = mixed_pack(side)
    for index, source in enumerate(sources):
        texture = pack.textures[index]
        assert (texture.maps, texture.channels) == (source.maps, source.channels)
        for level, mip in enumerate(mip_chain(source.pixels, "srgb", source.maps)[:3]):
            decoded = decode_image(pack, index, level)
            assert decoded.shape == mip.shape
            assert np.square(decoded.astype(float) - mip).mean() < 13.0**2


def test_a_plane_is_decoded_by_its_own_axes_and_basis() -> None:
    pack = random_block_pack(config=SETS, maps=[MAPS, ("normal", "occlusion"), WHOLE])
    for index, count in enumerate((11, 3, 8)):
        uv = np.random.default_rng(index).uniform(0.0, 1.0, (100, 2)).astype(np.float32)
        assert decode_texels(pack, index, uv.astype(np.float64), np.zeros(100)).shape == (100, count)
    texture = block_parts(pack).textures[0]
    stored = reference.texture_codes(texture, SETS, 0)
    whole = reference.block_values(texture, stored, block_parts(pack).decoders[0], SETS)
    decoder = block_parts(pack).decoders[0]
    codes = unpacked_codes(stored, decoder, SETS)
    coefficients = reference.decode_coefficients(codes, decoder) * scale_values(decoder.basis_scale)
    for place, channels in enumerate(plane_channels(MAPS, 11).values()):
        own = list(channels.values())
        matrix = texture.axes[np.ix_(own, own)]
        rows = decoder.basis[:, :, None] * (decoder.channels[:, None] == own)[:, None]
        values = np.einsum("nk,ktc->ntc", coefficients, rows.astype(np.float64)) @ matrix.T
        plain = np.ones(len(whole), bool)
        plain[codes.edges[place].blocks] = False
        np.testing.assert_allclose((texture.mean[0, own] + values)[plain], whole[plain][..., own], atol=1e-9)


def test_bits_count_everything_that_sets_store() -> None:
    sources = [material(WHOLE, (256, 256), seed=seed) for seed in range(2)]
    for bits in (2.0, 4.0):
        known = texture_set(sources, 1)
        config = config_for_bits(bits, known)
        assert (config.maps, config.output_channels) == (WHOLE, 8)
        pack = encode_textures(sources, Grouping("single", (0, 0)), config, BlockOptions())
        assert bits_with_mips(pack) == pytest.approx(bits, rel=0.02)
    assert config_for_bits(2.0, texture_set(sources, 0)).tables is not None
    with pytest.raises(InputError, match="--maps base"):
        encode_textures(sources, Grouping("universal", (0, 0)), SETS, BlockOptions())
    plain = texture_set([material(BASE_ALONE)], 1)
    assert side_bits(replace(plain, groups=0), BlockConfig(block_words=(4,))) == 32 * (2 * 3 + 9)


def test_sets_have_room_for_larger_codes_and_more_modes() -> None:
    assert replace(SETS, block_words=(16, 32), mean_words=32.0, modes=128).largest_words == 32
    plain = BlockConfig()
    for field, value in (("block_words", (17,)), ("mean_words", 17.0), ("modes", 128)):
        with pytest.raises(ValueError, match=field):
            replace(plain, **{field: value})  # type: ignore[arg-type]
    source = material(WHOLE, (128, 128))
    pack = encode_textures(
        [source], Grouping("single", (0,)), config_for_bits(12.0, texture_set([source], 1)), BlockOptions()
    )
    assert bits_with_mips(pack) == pytest.approx(12.0, rel=0.02)
    assert block_parts(pack).config.block_words[-1] > 16
    assert pack.textures[0].psnr_db is not None
    assert pack.textures[0].psnr_db > 40.0
