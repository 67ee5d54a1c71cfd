"""Packs of codec `block`, encoded in the caller's process: textures of all kinds, progress, cancelling, sizes."""

from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import torch
from safetensors import safe_open

from ntc.codec.block.config import BlockConfig, BlockOptions
from ntc.codec.block.encoding.rate import block_count, config_for_bits, side_bits, texel_count
from ntc.codec.block.model import block_parts
from ntc.codec.block.storage import level_codes
from ntc.codec.encoding import TextureSet
from ntc.codec.latents import latent_levels
from ntc.codec.model import Grouping
from ntc.codec.quality import psnr_db
from ntc.codec.reference import decode_image
from ntc.codec.registry import codec_of
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError, TrainingCancelledError
from ntc.metrics.metrics import psnr_table
from ntc.pack.file import read_pack, write_pack
from ntc.training.encode import encode_textures
from ntc.training.messages import TrainingProgress
from tests.support.packs.checks import check_pack

SMALL = BlockConfig(coefficients=24, modes=4, output_channels=4)


def waves(width: int, height: int, channels: int = 3, seed: int = 0) -> SourceTexture:
    """A smooth texture with a little noise."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width]
    image = np.stack([np.sin(x * 0.2 + y * 0.1 * (seed + 1) + c) for c in range(channels)], axis=-1) * 80 + 128
    pixels = np.clip(image + random.normal(0, 2, image.shape), 0, 255).astype(np.uint8)
    return SourceTexture(f"waves {seed}", pixels, hash_pixels(pixels), wrap=("mirror", "repeat"))


def noise(width: int, height: int) -> SourceTexture:
    """What no transform compresses."""
    pixels = np.random.default_rng(7).integers(0, 256, (height, width, 3), np.uint8)
    return SourceTexture("noise", pixels, hash_pixels(pixels))


def test_textures_with_different_channels_share_a_group(tmp_path: Path) -> None:
    sources = [waves(48, 40, channels, seed=channels) for channels in (1, 2, 3, 4)]
    pack = encode_textures(sources, Grouping("single", (0, 0, 0, 0)), SMALL, BlockOptions())
    check_pack(pack)
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
    sources = [SourceTexture(name, pixels, hash_pixels(pixels)) for name, pixels in images.items()]
    for groups in ((0, 0, 0, 0), (0, 1, 2, 3)):
        pack = encode_textures(sources, Grouping("any", groups), BlockConfig(), BlockOptions())
        check_pack(pack)
        assert len(pack.decoders) == max(groups) + 1
        assert decode_image(pack, 0).shape == (1, 1, 3)
        np.testing.assert_array_equal(decode_image(pack, 3), images["flat"])


def test_progress_counts_work_and_threads_are_given_back() -> None:
    reports: list[TrainingProgress] = []
    before = torch.get_num_threads()
    sources, grouping = [waves(16, 16, seed=s) for s in range(3)], Grouping("any", (1, 0, 1))
    encode_textures(sources, grouping, SMALL, BlockOptions(), reports.append)
    assert {report.steps for report in reports if report.work == "encoding texture"} == {3}
    shares = [report.share for report in reports]
    assert shares == sorted(shares)
    assert (reports[-1].step, shares[-1], reports[-1].seconds_left) == (3, 1.0, 0.0)
    assert reports[-1].mean_psnr_db > 20.0
    assert torch.get_num_threads() == before


def test_a_single_large_texture_moves_the_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ntc.codec.block.encoding.encoder.BLOCKS_AT_ONCE", 64)
    monkeypatch.setattr("ntc.training.trainer.SECONDS_BETWEEN_REPORTS", 0.0)
    reports: list[TrainingProgress] = []
    encode_textures([waves(256, 256)], Grouping("single", (0,)), SMALL, BlockOptions(), reports.append)
    inside = {report.share for report in reports if report.work == "encoding texture" and report.step == 0}
    assert len(inside) > 5
    assert max(inside) > 0.8


def test_the_number_of_threads_changes_no_byte() -> None:
    sources = [waves(40 + 8 * seed, 40, seed=seed) for seed in range(12)]
    grouping = Grouping("any", (0,) * 9 + (1,) * 3)
    one, two = (encode_textures(sources, grouping, SMALL, BlockOptions(threads=count)) for count in (1, 2))
    for a, b in zip(block_parts(one).textures, block_parts(two).textures, strict=True):
        assert a.words.tobytes() == b.words.tobytes()
        assert (a.axes.tobytes(), a.mean.tobytes(), a.psnr_db) == (b.axes.tobytes(), b.mean.tobytes(), b.psnr_db)
    assert all(
        x.scales.tobytes() == y.scales.tobytes()
        for x, y in zip(block_parts(one).decoders, block_parts(two).decoders, strict=True)
    )


def test_progress_is_told_from_every_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ntc.training.trainer.SECONDS_BETWEEN_REPORTS", 0.0)
    reports: list[TrainingProgress] = []
    sources = [waves(24, 24, seed=seed) for seed in range(40)]
    encode_textures(sources, Grouping("single", (0,) * 40), SMALL, BlockOptions(threads=4), reports.append)
    assert reports[-1].share == 1.0
    assert len(reports[-1].psnr_db) == 40


def test_cancelling_ends_it_within_a_texture(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ntc.codec.block.encoding.encoder.BLOCKS_AT_ONCE", 64)
    monkeypatch.setattr("ntc.training.trainer.SECONDS_BETWEEN_REPORTS", 0.0)
    reports: list[TrainingProgress] = []

    def cancelled() -> bool:
        return any(report.work == "encoding texture" and report.share > 0.0 for report in reports)

    with pytest.raises(TrainingCancelledError):
        encode_textures([waves(256, 256)], Grouping("single", (0,)), SMALL, BlockOptions(), reports.append, cancelled)
    assert 0.0 < reports[-1].share < 0.9


def test_what_cannot_be_encoded_is_named() -> None:
    with pytest.raises(InputError, match="no texture"):
        encode_textures([], Grouping("single", ()), SMALL, BlockOptions())
    with pytest.raises(InputError, match="needs a group for each texture"):
        encode_textures([waves(8, 8)], Grouping("single", (1,)), SMALL, BlockOptions())
    with pytest.raises(InputError, match="has 4 channels"):
        encode_textures([waves(8, 8, 4)], Grouping("single", (0,)), BlockConfig(), BlockOptions())


def test_a_block_pack_is_drawn_in_fp32_at_every_precision() -> None:
    pack = encode_textures(
        [waves(16, 16)], Grouping("single", (0,)), BlockConfig(coefficients=16, modes=2), BlockOptions()
    )
    codec = codec_of(pack.config)
    assert codec.chosen_precision(pack, ("fp16", "fp16-arithmetic", "fp16-accumulate")).precision == "fp32"
    assert codec.stored_pack(pack, "fp16-accumulate") is pack


def test_sizes_in_the_table_are_those_of_the_files_tensors(tmp_path: Path) -> None:
    pack = encode_textures([waves(40, 24), waves(16, 16, seed=1)], Grouping("any", (0, 1)), SMALL, BlockOptions())
    write_pack(tmp_path / "a.ntc", pack)
    sizes = {"latents": 0, "decoder": 0}
    with safe_open(tmp_path / "a.ntc", "np") as file:
        for name in file.keys():  # noqa: SIM118  Not a mapping.
            sizes[name.split(".")[0]] += file.get_tensor(name).nbytes
    table = psnr_table(pack)
    assert (table.latent_bytes, table.decoder_bytes, table.adapter_bytes) == (sizes["latents"], sizes["decoder"], 0)
    assert table.bits_per_texel == pytest.approx(8 * sum(sizes.values()) / (40 * 24 + 16 * 16))


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
    rough, smooth = noise(64, 64), waves(64, 64)
    pack = encode_textures(
        [rough, smooth], Grouping("single", (0, 0)), BlockConfig(coefficients=48, modes=4), BlockOptions()
    )
    first, second = block_parts(pack).textures
    assert len(first.words) > 1.3 * len(second.words)
    # One texture, half of it smooth: the other half takes most of the words.
    pixels = np.concatenate([rough.pixels[:, :32], smooth.pixels[:, :32]], axis=1)
    mixed = SourceTexture("mixed", pixels, hash_pixels(pixels))
    pack = encode_textures(
        [mixed], Grouping("single", (0,)), BlockConfig(coefficients=48, modes=4, levels=1), BlockOptions()
    )
    texture, config = block_parts(pack).textures[0], block_parts(pack).config
    level = latent_levels(64, 64, config)[0]
    sizes = level_codes(texture.words, level, config).sizes.reshape(8, 8)
    assert sizes[:, :4].mean() > sizes[:, 4:].mean() + 1.0
    mean = np.array(config.block_words)[sizes].mean()
    assert config.mean_words - 0.1 < mean <= config.mean_words
