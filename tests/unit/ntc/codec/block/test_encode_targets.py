"""Encoding in codec `block` to bits, to a size and to a quality: what is asked for comes, in few words, or is refused in one line."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.block.config import LARGEST_WORDS
from ntc.codec.block.encoding.rate import config_for_bits, config_for_bytes
from ntc.codec.block.encoding.sharing import RateCurve, Sharing, best_block_words, price_at_error, share_words
from ntc.codec.block.model import block_parts
from ntc.codec.config import UNIVERSAL
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
)
from ntc.codec.model import Grouping, Pack
from ntc.codec.registry import codec_named
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError, TrainingCancelledError
from ntc.metrics.metrics import bits_with_mips
from ntc.pack.file import write_pack
from ntc.training.encode import encode_chosen
from ntc.training.messages import TrainingProgress
from tests.support.packs.checks import check_pack

PAIR = Grouping("single", (0, 0))


def picture(side: int, roughness: float, seed: int = 0) -> SourceTexture:
    """Waves under noise of `roughness` 8-bit steps."""
    y, x = np.mgrid[0:side, 0:side]
    waves = np.stack([np.sin(x * 0.05 + y * 0.03 + c) for c in range(3)], axis=-1) * 60 + 128
    noise = np.random.default_rng(seed).normal(0, roughness, waves.shape)
    pixels = np.clip(waves + noise, 0, 255).astype(np.uint8)
    return SourceTexture(f"picture {seed}", pixels, hash_pixels(pixels))


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
    noise = np.random.default_rng(3).integers(0, 256, (160, 160, 3), np.uint8)
    source = SourceTexture("noise", noise, hash_pixels(noise))
    pack = encoded_to([source], Grouping("single", (0,)), QualityTarget(50.0), levels=1)
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


@pytest.mark.parametrize("megabytes", [0.016, 0.03, 0.06])
def test_a_file_is_no_larger_than_asked_for(
    pair: tuple[SourceTexture, SourceTexture], tmp_path: Path, megabytes: float
) -> None:
    # Names that take six bytes a letter in the file.
    sources = [replace(source, name=source.name + '"\u4e2d\\' * 20) for source in pair]
    pack = encoded_to(sources, PAIR, SizeTarget(megabytes))
    write_pack(tmp_path / "a.ntc", pack)
    size = (tmp_path / "a.ntc").stat().st_size
    tensors = sum(own.nbytes for own in words(pack))
    assert size - tensors > 0
    assert size <= 1e6 * megabytes
    assert size >= 0.95 * 1e6 * megabytes - file_header_bytes(sources, PAIR)


def test_more_megabytes_than_the_largest_codes_take_are_left(pair: tuple[SourceTexture, SourceTexture]) -> None:
    pack = encoded_to(pair, PAIR, SizeTarget(100.0))
    assert block_parts(pack).config.mean_words == LARGEST_WORDS
    assert bits_with_mips(pack) > 7.9


def test_what_is_worth_more_gets_more_words(pair: tuple[SourceTexture, SourceTexture]) -> None:
    plain, more = (
        [len(own) for own in words(encoded_to(pair, PAIR, SizeTarget(0.025, worth)))] for worth in (None, (20.0, 1.0))
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


def test_a_size_below_the_least_names_the_least(pair: tuple[SourceTexture, SourceTexture]) -> None:
    with pytest.raises(
        InputError, match=r"--size 0.01: at least 0\.0\d\d MB are needed for codes and tables"
    ) as caught:
        encoded_to(pair, PAIR, SizeTarget(0.01))
    assert "\n" not in str(caught.value)
    known = TextureSet([(128, 128)] * 2, 1, 3)
    for stored in range(10_000, 60_000, 1000):
        config = config_for_bytes(stored, known)
        assert config.mean_words >= config.block_words[0]


def curve(slope: float, blocks: int = 64) -> RateCurve:
    """Errors that fall by `slope` with each word, a little differently from block to block."""
    words = (1, 2, 4, 8, 16)
    random = np.random.default_rng(0).uniform(0.5, 2.0, (blocks, 1))
    return RateCurve((random * np.array(words) ** -slope).astype(np.float32), words, blocks)


def test_a_price_is_the_highest_at_which_the_error_is_small_enough() -> None:
    found = curve(1.0)
    price = price_at_error(found, 0.2)
    assert found.at(price)[1] <= 0.2 < found.at(price * 1.05)[1]
    words, error = found.at(price_at_error(found, 1e-9))
    assert words == 16.0
    assert error > 1e-9


def test_sizes_follow_what_textures_need() -> None:
    curves = [curve(1.0), curve(1.0)]
    cheap = best_block_words(curves, [price_at_error(each, 0.8) for each in curves], 2)
    dear = best_block_words(curves, [price_at_error(each, 0.1) for each in curves], 2)
    assert cheap == (1, 2)
    assert dear[-1] == 16


def test_words_are_shared_by_worth() -> None:
    curves = [curve(1.0), curve(1.0)]
    same, more = share_words(curves, 512.0), share_words(curves, 512.0, Sharing(worth=(4.0, 1.0)))
    assert same[0] == same[1]
    assert more[0] > same[0] > more[1]
    assert 64 * sum(more) <= 512.0


def test_the_decoder_that_ships_serves_a_quality_and_a_size(pair: tuple[SourceTexture, SourceTexture]) -> None:
    universal = Grouping(UNIVERSAL, (0, 0), dict(codec_named("block").shipped))
    assert min(decibels(encoded_to(pair, universal, QualityTarget(30.0), levels=1))) >= 30.0
    check_pack(encoded_to(pair, universal, SizeTarget(0.02), levels=1))
    with pytest.raises(InputError, match="choose another grouping"):
        encoded_to(pair, universal, PRESETS["fast"])
