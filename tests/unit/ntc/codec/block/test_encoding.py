"""Encoding in codec `block`: textures of all kinds, to bits, sizes and qualities, under decoders that are there already."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from threadpoolctl import threadpool_info  # type: ignore[import-untyped]

from ntc.codec.block.config import LARGEST_WORDS, BlockConfig, BlockOptions
from ntc.codec.block.encoding.frozen import encode_with_decoders
from ntc.codec.block.encoding.rate import block_count, config_for_bits, config_for_bytes, side_bits, texel_count
from ntc.codec.block.model import block_parts
from ntc.codec.block.storage import level_codes
from ntc.codec.block.tensors import decoder_shapes, decoder_tensors, read_decoder
from ntc.codec.block.universal import UNIVERSAL_CONFIG, VERSION, tables_path, universal_decoder
from ntc.codec.checks import check_textures
from ntc.codec.config import UNIVERSAL, GroupingConfig
from ntc.codec.encoding import (
    PRESETS,
    BitsTarget,
    CancelQuestion,
    EncodingChoices,
    QualityTarget,
    SizeTarget,
    Target,
    TextureSet,
    file_header_bytes,
    texture_set,
)
from ntc.codec.grid.model import GridConfig
from ntc.codec.latents import latent_levels
from ntc.codec.model import Grouping, Pack
from ntc.codec.quality import psnr_db
from ntc.codec.reference import decode_image
from ntc.codec.registry import codec_named, codec_of
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError, TrainingCancelledError
from ntc.grouping import make_grouping
from ntc.metrics.metrics import bits_with_mips, psnr_table
from ntc.pack.file import NUMPY_TYPES, read_pack, write_pack
from ntc.training.encode import encode_chosen, encode_textures
from ntc.training.messages import TrainingProgress, moved_texture
from tests.support.gltf_builder import noise
from tests.support.pack_bytes import PackBytes
from tests.support.packs.checks import assert_equal, assert_same, check_pack
from tests.support.textures import of_pixels, waves

SMALL = BlockConfig(coefficients=24, modes=8, output_channels=4)


def test_textures_with_different_channels_share_a_group(tmp_path: Path) -> None:
    sources = [waves(48, 40, channels, seed=channels) for channels in (1, 2, 3, 4)]
    pack = encode_textures(sources, Grouping("single", (0, 0, 0, 0)), SMALL, BlockOptions())
    check_pack(pack)
    codec = codec_of(pack.config)
    assert codec.chosen_precision(pack, ("fp16", "fp16-arithmetic", "fp16-accumulate")).precision == "fp32"
    assert codec.stored_pack(pack, "fp16-accumulate") is pack
    write_pack(tmp_path / "a.ntc", pack)
    read = read_pack(tmp_path / "a.ntc")
    for index, source in enumerate(sources):
        found = read.textures[index]
        assert (found.name, found.pixel_hash, found.wrap) == (source.name, source.pixel_hash, source.wrap)
        assert found.channels == source.pixels.shape[2]
        decoded = decode_image(read, index)
        assert decoded.shape == source.pixels.shape
        assert found.psnr_db == pytest.approx(psnr_db(decoded, source.pixels))
        assert found.psnr_db is not None
        assert found.psnr_db > 28.0


def test_odd_textures_are_encoded() -> None:
    random = np.random.default_rng(0)
    shapes = {"texel": (1, 1, 3), "strip": (3, 200, 3), "noise": (33, 17, 3)}
    images = {name: random.integers(0, 256, shape, np.uint8) for name, shape in shapes.items()}
    images["flat"] = np.full((24, 24, 3), 255, np.uint8)
    sources = [of_pixels(pixels, name) for name, pixels in images.items()]
    for groups in ((0, 0, 0, 0), (0, 1, 2, 3)):
        pack = encode_textures(sources, Grouping("any", groups), BlockConfig(), BlockOptions())
        check_pack(pack)
        assert len(pack.decoders) == max(groups) + 1
        assert decode_image(pack, 0).shape == (1, 1, 3)
        np.testing.assert_array_equal(decode_image(pack, 3), images["flat"])


def test_progress_counts_work_and_threads_are_given_back() -> None:
    reports: list[TrainingProgress] = []
    before = threadpool_info()
    sources, grouping = [waves(16, 16, seed=s) for s in range(3)], Grouping("any", (1, 0, 1))
    encode_textures(sources, grouping, SMALL, BlockOptions(), reports.append)
    assert {report.steps for report in reports if report.work == "encoding texture"} == {3}
    shares = [report.share for report in reports]
    assert shares == sorted(shares)
    assert (reports[-1].step, shares[-1]) == (3, 1.0)
    assert reports[-1].mean_psnr_db > 20.0
    assert threadpool_info() == before
    # Of every thread.
    many = [waves(24, 24, seed=seed) for seed in range(40)]
    encode_textures(many, Grouping("single", (0,) * 40), SMALL, BlockOptions(threads=4), reports.append)
    assert reports[-1].share == 1.0
    assert len(reports[-1].psnr_db) == 40


def test_a_single_large_texture_moves_the_progress_and_can_be_cancelled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ntc.codec.block.encoding.encoder.BLOCKS_AT_ONCE", 64)
    monkeypatch.setattr("ntc.training.trainer.SECONDS_BETWEEN_REPORTS", 0.0)
    reports: list[TrainingProgress] = []
    large, alone = [waves(256, 256)], Grouping("single", (0,))
    encode_textures(large, alone, SMALL, BlockOptions(), reports.append)
    inside = {report.share for report in reports if report.work == "encoding texture" and not report.psnr_db}
    assert len(inside) > 5
    assert max(inside) > 0.8
    reports.clear()

    def cancelled() -> bool:
        return any(report.work == "encoding texture" and report.share > 0.0 for report in reports)

    with pytest.raises(TrainingCancelledError):
        encode_textures(large, alone, SMALL, BlockOptions(), reports.append, cancelled)
    assert 0.0 < reports[-1].share < 0.9


def test_the_number_of_threads_changes_no_byte() -> None:
    sources = [waves(40 + 8 * seed, 40, seed=seed) for seed in range(12)]
    grouping = Grouping("any", (0,) * 9 + (1,) * 3)
    one, two = (encode_textures(sources, grouping, SMALL, BlockOptions(threads=count)) for count in (1, 2))
    assert_equal(one, two)


def test_threads_that_share_a_texture_change_no_byte(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ntc.codec.block.encoding.encoder.BLOCKS_AT_ONCE", 16)
    monkeypatch.setattr("ntc.codec.block.encoding.measuring.BLOCKS_AT_ONCE", 16)
    source, grouping = [waves(96, 72)], Grouping("single", (0,))
    one, three = (encode_textures(source, grouping, SMALL, BlockOptions(threads=count)) for count in (1, 3))
    assert_equal(one, three)


def test_what_cannot_be_encoded_is_named() -> None:
    with pytest.raises(InputError, match="no texture"):
        encode_textures([], Grouping("single", ()), SMALL, BlockOptions())
    with pytest.raises(InputError, match="needs a group for each texture"):
        encode_textures([waves(8, 8)], Grouping("single", (1,)), SMALL, BlockOptions())
    with pytest.raises(InputError, match="has 4 channels"):
        encode_textures([waves(8, 8, 4)], Grouping("single", (0,)), BlockConfig(), BlockOptions())


@pytest.mark.parametrize("groups", [1, 8])
@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("side", [4, 8])
def test_settings_of_large_textures_come_to_the_bits_asked_for(groups: int, channels: int, side: Literal[4, 8]) -> None:
    textures = TextureSet([(1024, 1024)] * 8, groups, channels)
    for asked in (0.8, 1.0, 2.0, 3.3, 6.0):
        if side == 4 and asked < 2.5:
            continue
        config = config_for_bits(asked, textures, side)
        codes = 32.0 * config.mean_words * block_count(textures.sizes, config) + side_bits(textures, config)
        # Blocks of 4x4 texels have codes of one size where a directory would cost more than it is worth.
        assert codes / texel_count(textures.sizes, config) == pytest.approx(asked, abs=1e-6 if side == 8 else 0.25)
        assert (config.output_channels, config.block_side) == (channels, side)


def test_bits_out_of_reach() -> None:
    textures = TextureSet([(1024, 1024)] * 8, 2, 3)
    for asked in (0.0, -1.0, 9.5):
        with pytest.raises(InputError, match=r"--bits \S+: set it above 0 and up to 8\.\d\d, what the largest codes"):
            config_for_bits(asked, textures)
    # The least that is possible.
    for few in (textures, TextureSet([(16, 16)], 1, 3)):
        config = config_for_bits(0.3, few)
        assert config.mean_words == config.block_words[0] == 1


def test_textures_and_blocks_share_words_by_what_they_are_worth() -> None:
    rough, smooth = of_pixels(noise(64, 64, seed=7)), waves(64, 64)
    settings = BlockConfig(coefficients=48, modes=8)
    pack = encode_textures([rough, smooth], PAIR, settings, BlockOptions())
    first, second = block_parts(pack).textures
    assert len(first.words) > 1.3 * len(second.words)
    # One texture, half of it smooth: the other half takes most of the words.
    pixels = np.concatenate([rough.pixels[:, :32], smooth.pixels[:, :32]], axis=1)
    pack = encode_textures([of_pixels(pixels)], Grouping("single", (0,)), replace(settings, levels=1), BlockOptions())
    texture, config = block_parts(pack).textures[0], block_parts(pack).config
    level = latent_levels(64, 64, config)[0]
    sizes = level_codes(texture.words, level, config).sizes.reshape(8, 8)
    assert sizes[:, :4].mean() > sizes[:, 4:].mean() + 1.0
    mean = np.array(config.block_words)[sizes].mean()
    assert config.mean_words - 0.1 < mean <= config.mean_words


PAIR = Grouping("single", (0, 0))


def picture(side: int, roughness: float, seed: int = 0) -> SourceTexture:
    """Waves under noise of `roughness` 8-bit steps."""
    y, x = np.mgrid[0:side, 0:side]
    waves = np.stack([np.sin(x * 0.05 + y * 0.03 + c) for c in range(3)], axis=-1) * 60 + 128
    noise = np.random.default_rng(seed).normal(0, roughness, waves.shape)
    return of_pixels(np.clip(waves + noise, 0, 255).astype(np.uint8), f"picture {seed}")


@pytest.fixture(scope="module")
def pair() -> tuple[SourceTexture, SourceTexture]:
    """A texture that needs few words, and one that needs many."""
    return picture(128, 2.0), picture(128, 12.0, seed=1)


def encoded_to(
    textures: Sequence[SourceTexture], grouping: Grouping, target: Target, levels: int | None = None
) -> Pack:
    """A pack that comes to `target`."""
    return encode_chosen(textures, grouping, codec_named("block"), EncodingChoices(target=target, levels=levels))


def decibels(pack: Pack) -> list[float]:
    """PSNR of each texture."""
    return [texture.psnr_db or 0.0 for texture in pack.textures]


def words(pack: Pack) -> list[NDArray[np.uint32]]:
    """Codes of each texture."""
    return [texture.words for texture in block_parts(pack).textures]


@pytest.mark.parametrize("asked", [30.0, 36.0])
def test_each_texture_has_the_quality_asked_for_and_hardly_more(
    pair: tuple[SourceTexture, SourceTexture], asked: float
) -> None:
    pack = encoded_to(pair, PAIR, QualityTarget(asked))
    check_pack(pack)
    smooth, rough = decibels(pack)
    assert asked <= rough <= asked + 0.15
    # The least words of all may give more.
    assert smooth >= asked
    found = words(pack)
    assert len(found[0]) < len(found[1])
    again = words(encoded_to(pair, PAIR, QualityTarget(asked)))
    assert all((a == b).all() for a, b in zip(found, again, strict=True))


def test_a_quality_beyond_reach_gives_the_largest_codes() -> None:
    # More blocks than a block has values: their basis cannot name them one by one.
    pack = encoded_to([of_pixels(noise(160, 160))], Grouping("single", (0,)), QualityTarget(50.0), levels=1)
    (found,) = decibels(pack)
    assert 20.0 < found < 50.0
    assert len(words(pack)[0]) >= 0.98 * 400 * LARGEST_WORDS
    assert block_parts(pack).config.block_words[-1] == LARGEST_WORDS


def test_stopped_while_correcting_the_pack_is_what_is_there(
    pair: tuple[SourceTexture, SourceTexture], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ntc.training.trainer.SECONDS_BETWEEN_REPORTS", 0.0)
    reports: list[TrainingProgress] = []

    def works() -> list[str]:
        return list(dict.fromkeys(report.work for report in reports))

    def encoded_to_quality(cancelled: CancelQuestion | None = None) -> Pack:
        reports.clear()
        choices = EncodingChoices(target=QualityTarget(33.3))
        return encode_chosen(pair, PAIR, codec_named("block"), choices, reports.append, cancelled)

    whole = encoded_to_quality()
    assert works() == ["fitting group", "encoding texture", "correcting texture"]
    stopped = encoded_to_quality(lambda: "correcting texture" in works())
    check_pack(stopped)
    assert decibels(stopped) != decibels(whole)
    with pytest.raises(TrainingCancelledError):
        encoded_to_quality(lambda: "encoding texture" in works())


@pytest.mark.parametrize("megabytes", [0.016, 0.03, 0.04])
def test_a_file_is_no_larger_than_asked_for(
    pair: tuple[SourceTexture, SourceTexture], tmp_path: Path, megabytes: float
) -> None:
    # Names that take six bytes a letter in the file.
    sources = [replace(source, name=source.name + '"\u4e2d\\' * 20) for source in pair]
    pack = encoded_to(sources, PAIR, SizeTarget(megabytes))
    write_pack(tmp_path / "a.ntc", pack)
    size = (tmp_path / "a.ntc").stat().st_size
    assert size - sum(own.nbytes for own in words(pack)) > 0
    assert 0.95 * 1e6 * megabytes - file_header_bytes(sources, PAIR) <= size <= 1e6 * megabytes


def test_sizes_beyond_reach_and_textures_that_are_worth_more(pair: tuple[SourceTexture, SourceTexture]) -> None:
    largest = encoded_to(pair, PAIR, SizeTarget(100.0))
    assert block_parts(largest).config.mean_words == LARGEST_WORDS
    assert bits_with_mips(largest) > 7.9
    least = r"--size 0.006: at least 0\.0\d\d MB are needed for codes and tables"
    with pytest.raises(InputError, match=least) as caught:
        encoded_to(pair, PAIR, SizeTarget(0.006))
    assert "\n" not in str(caught.value)
    known = TextureSet([(128, 128)] * 2, 1, 3)
    for stored in range(10_000, 60_000, 1000):
        config = config_for_bytes(stored, known)
        assert config.mean_words >= config.block_words[0]
    plain, more = (
        [len(own) for own in words(encoded_to(pair, PAIR, SizeTarget(0.018, worth)))] for worth in (None, (20.0, 1.0))
    )
    assert more[0] > 1.1 * plain[0]
    assert sum(more) <= 1.02 * sum(plain)


def test_the_fast_preset_costs_little_to_decode(pair: tuple[SourceTexture, SourceTexture]) -> None:
    pack = encoded_to(pair, PAIR, PRESETS["fast"])
    assert pack.config.multiply_adds <= 100
    assert block_parts(pack).config.block_side == 4
    for channels in (1, 2, 3, 4):
        many = TextureSet([(1024, 1024)] * 8, 2, channels)
        assert config_for_bits(2.0, many, 4, multiply_adds=100).multiply_adds <= 100


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: QualityTarget(0.0), "--quality 0: set it above 0 and up to 58.9 dB"),
        (lambda: QualityTarget(100.0), "--quality 100: set it above 0"),
        (lambda: QualityTarget(math.nan), "--quality nan: set it above 0"),
        (lambda: SizeTarget(0.0), "--size 0: must be a number of megabytes above 0"),
        (lambda: SizeTarget(math.inf), "--size inf: must be"),
        (lambda: SizeTarget(math.nan), "--size nan: must be"),
        (lambda: BitsTarget(0.0), "--bits 0: must be above 0"),
        (lambda: BitsTarget(math.nan), "--bits nan: must be above 0"),
    ],
)
def test_what_can_never_be_reached_is_refused(make: object, words: str) -> None:
    assert callable(make)
    with pytest.raises(InputError, match=words):
        make()


def test_the_decoder_that_ships_serves_a_quality_and_a_size(pair: tuple[SourceTexture, SourceTexture]) -> None:
    universal = Grouping(UNIVERSAL, (0, 0), dict(codec_named("block").shipped))
    assert min(decibels(encoded_to(pair, universal, QualityTarget(30.0), levels=1))) >= 30.0
    check_pack(encoded_to(pair, universal, SizeTarget(0.02), levels=1))
    with pytest.raises(InputError, match="choose another grouping"):
        encoded_to(pair, universal, PRESETS["fast"])


def stripes(phase: int, horizontal: bool) -> SourceTexture:
    """64 x 64 texels of waves along one axis, and a little noise."""
    y, x = np.mgrid[0:64, 0:64]
    wave = np.sin((y if horizontal else x) * (0.9 + 0.05 * phase) + phase) * 70.0 + 128.0
    noise = np.random.default_rng(phase).normal(0.0, 4.0, (64, 64))
    pixels: NDArray[np.uint8] = np.repeat((wave + noise)[..., None], 3, axis=-1).clip(0, 255).astype(np.uint8)
    return of_pixels(pixels, f"{'rows' if horizontal else 'columns'} {phase}")


def test_each_texture_takes_the_decoder_of_its_kind() -> None:
    old = [stripes(number, horizontal) for horizontal in (True, False) for number in range(4)]
    config = replace(config_for_bits(2.0, texture_set(old, 2, None)), mips=2)
    pack = encode_textures(old, Grouping("clustered", (0, 0, 0, 0, 1, 1, 1, 1)), config, BlockOptions())
    new = [stripes(7, False), stripes(8, True), stripes(9, False)]
    found, again = (
        codec_named("block").encode_with_decoders(new, pack, BlockOptions(threads=count)) for count in (1, 2)
    )
    assert_equal(found, again)
    with pytest.raises(InputError, match="no decoders of its own"):
        encode_with_decoders(old, block_parts(pack).decoders, config, UNIVERSAL, BlockOptions())
    assert found.grouping.groups == (0, 1, 0)
    assert found.config == config
    for own, expected in zip(
        block_parts(found).decoders, (block_parts(pack).decoders[1], block_parts(pack).decoders[0]), strict=True
    ):
        assert np.array_equal(own.basis, expected.basis)
        assert np.array_equal(own.scales, expected.scales)
    wrong = encode_with_decoders(new[:1], block_parts(pack).decoders[:1], config, "clustered", BlockOptions())
    assert (found.textures[0].psnr_db or 0.0) > (wrong.textures[0].psnr_db or 0.0) + 1.0


def encoded(textures: list[SourceTexture], bits: float) -> Pack:
    """`textures` in grouping `universal`."""
    grouping = make_grouping(GroupingConfig("universal"), textures)
    return encode_textures(
        textures, grouping, config_for_bits(bits, texture_set(textures, grouping.stored_decoders)), BlockOptions()
    )


@pytest.mark.parametrize("channels", [3, 4])
def test_the_shipped_tables_fit_their_settings_and_are_small(channels: int) -> None:
    config = replace(UNIVERSAL_CONFIG, output_channels=channels)
    decoder = universal_decoder(channels)
    tensors = decoder_tensors(decoder, config)
    expected = {name: (NUMPY_TYPES[kind], shape) for name, (kind, shape) in decoder_shapes(config).items()}
    assert {name: (array.dtype, array.shape) for name, array in tensors.items()} == expected
    assert all(np.isfinite(array).all() for array in tensors.values())
    assert_same(decoder, read_decoder(tensors, config))
    assert tables_path(VERSION, channels).stat().st_size < 100_000


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_a_pack_holds_no_decoder_and_reads_back(tmp_path: Path, channels: int) -> None:
    sources = [waves(64, 48, channels), waves(33, 40, channels, seed=1)]
    pack = encoded(sources, 6.0)
    check_pack(pack)
    write_pack(tmp_path / "a.ntc", pack)
    parts = PackBytes.of((tmp_path / "a.ntc").read_bytes())
    assert not [name for name in parts.tensors if name.startswith("decoder")]
    read = read_pack(tmp_path / "a.ntc")
    assert read.grouping.parameters == {"version": VERSION}
    assert psnr_table(read).decoder_bytes == 0
    for index, source in enumerate(sources):
        found = decode_image(read, index)
        np.testing.assert_array_equal(found, decode_image(pack, index))
        assert psnr_db(found, source.pixels) > 30.0


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        (("grouping", "parameters"), {"version": 999}, "no tables of version 999"),
        (("grouping", "parameters"), {}, "not one that ships"),
        (("grouping", "parameters"), {"version": "1"}, "not one that ships"),
        (("codec", "modes"), 32, "scales"),
    ],
)
def test_packs_of_unknown_tables_are_refused(tmp_path: Path, place: tuple[str, str], value: object, words: str) -> None:
    path = tmp_path / "a.ntc"
    write_pack(path, encoded([waves(16, 16)], 6.0))
    parts = PackBytes.of(path.read_bytes())
    assert parts.metadata["codec"]["modes"] == 64
    path.write_bytes(parts.changed(lambda p: p.metadata[place[0]].__setitem__(place[1], value)))
    with pytest.raises(InputError, match=words):
        read_pack(path)


def test_only_codec_block_has_it_and_textures_stay_together() -> None:
    sources = [waves(16, 16), waves(16, 16, seed=1)]
    grouping = make_grouping(GroupingConfig("universal"), sources)
    with pytest.raises(InputError, match="use codec block"):
        check_textures(sources, grouping, GridConfig())
    with pytest.raises(InputError, match="one decoder for all textures"):
        moved_texture(grouping, 0, 1)
