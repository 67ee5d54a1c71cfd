"""Grouping `universal`: a decoder that ships with the program, and packs that hold none."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.block.config import BlockOptions
from ntc.codec.block.encoding.rate import config_for_bits
from ntc.codec.block.tensors import decoder_shapes, decoder_tensors, read_decoder
from ntc.codec.block.universal import UNIVERSAL_CONFIG, VERSION, tables_path, universal_decoder
from ntc.codec.checks import check_textures
from ntc.codec.config import GroupingConfig
from ntc.codec.encoding import texture_set
from ntc.codec.grid.model import GridConfig
from ntc.codec.model import Pack
from ntc.codec.quality import psnr_db
from ntc.codec.reference import decode_image
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.grouping import make_grouping
from ntc.metrics.metrics import psnr_table
from ntc.pack.file import NUMPY_TYPES, read_pack, write_pack
from ntc.training.encode import encode_textures
from ntc.training.messages import moved_texture
from tests.support.pack_bytes import PackBytes
from tests.support.packs.checks import assert_same, check_pack
from tests.unit.ntc.codec.block.test_encode_blocks import waves


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


def test_more_bits_give_a_nearer_picture() -> None:
    sources = [waves(128, 128, seed=seed) for seed in range(2)]
    found = [min(texture.psnr_db or 0.0 for texture in encoded(sources, bits).textures) for bits in (1.0, 2.0, 4.0)]
    assert found[0] + 1.0 < found[1] < found[2] - 1.0


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("parameters", {"version": 999}, "no tables of version 999"),
        ("parameters", {}, "not one that ships"),
        ("parameters", {"version": "1"}, "not one that ships"),
    ],
)
def test_packs_of_unknown_tables_are_refused(tmp_path: Path, field: str, value: object, words: str) -> None:
    path = tmp_path / "a.ntc"
    write_pack(path, encoded([waves(16, 16)], 6.0))
    parts = PackBytes.of(path.read_bytes())
    path.write_bytes(parts.changed(lambda p: p.metadata["grouping"].__setitem__(field, value)))
    with pytest.raises(InputError, match=words):
        read_pack(path)


def test_settings_that_do_not_fit_the_tables_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.ntc"
    write_pack(path, encoded([waves(16, 16)], 6.0))
    parts = PackBytes.of(path.read_bytes())
    assert json.dumps(parts.metadata["codec"]["modes"]) == "64"
    path.write_bytes(parts.changed(lambda p: p.metadata["codec"].__setitem__("modes", 32)))
    with pytest.raises(InputError, match="scales"):
        read_pack(path)


def test_only_codec_block_has_it_and_textures_stay_together() -> None:
    sources = [waves(16, 16), waves(16, 16, seed=1)]
    grouping = make_grouping(GroupingConfig("universal"), sources)
    with pytest.raises(InputError, match="use codec block"):
        check_textures(sources, grouping, GridConfig())
    with pytest.raises(InputError, match="one decoder for all textures"):
        moved_texture(grouping, 0, 1)
