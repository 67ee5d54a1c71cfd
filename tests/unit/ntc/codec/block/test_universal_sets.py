"""Grouping `universal` for whole materials: tables that ship, scaled by gains of each group, from the encoder to the file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.block.config import BlockOptions
from ntc.codec.block.encoding.gains import shared_gains, steps_between
from ntc.codec.block.encoding.rate import config_for_bits
from ntc.codec.block.model import block_parts
from ntc.codec.block.tensors import decoder_shapes
from ntc.codec.block.universal import (
    BANDS,
    MOST_SCALED_GROUPS,
    SET_VERSION,
    scaled_decoder,
    set_config,
    set_tables,
)
from ntc.codec.config import GroupingConfig
from ntc.codec.encoding import texture_set
from ntc.codec.maps import BASE_ALONE, MapName, joint_maps
from ntc.codec.model import Pack
from ntc.codec.reference import decode_image
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.grouping import make_grouping
from ntc.library.joining import joined_pack
from ntc.metrics.metrics import bits_with_mips, psnr_table
from ntc.pack.file import pack_bytes, read_pack, read_textures, write_pack
from ntc.training.encode import encode_textures
from tests.support.pack_bytes import PackBytes
from tests.unit.ntc.codec.block.test_material_sets import KINDS, WHOLE, material


def encoded(sources: list[SourceTexture], bits: float = 6.0, clusters: int | None = None) -> Pack:
    """`sources` in grouping `universal`."""
    grouping = make_grouping(GroupingConfig("universal", clusters=clusters), sources)
    config = config_for_bits(bits, texture_set(sources, grouping.stored_decoders))
    return encode_textures(sources, grouping, config, BlockOptions())


@pytest.mark.parametrize("maps", [*KINDS[:1], *KINDS[2:], ("roughness",), ("base", "emissive")])
def test_every_kind_of_maps_has_tables(maps: tuple[MapName, ...]) -> None:
    _, channels = joint_maps([(maps, material(maps).channels)])
    config, tables = set_config(maps, channels), set_tables(maps, channels)
    assert (config.tables, config.maps, config.output_channels) == (SET_VERSION, maps, channels)
    decoder = tables.decoder
    assert decoder.basis.shape == (config.coefficients, config.block_texels)
    assert decoder.scales.shape == (config.modes, config.coefficients)
    assert decoder.edges.shape == (config.modes, len(config.planes))
    assert set(decoder.channels.tolist()) == set(range(channels))
    assert tables.energies.shape == (channels * BANDS,)
    # No row has a place in a plane that lists have no room for.
    for plane in config.planes:
        assert np.isin(decoder.channels, plane).sum() <= 256


def test_gains_move_the_scales_of_coefficients() -> None:
    tables = set_tables(WHOLE, 8)
    gains = np.zeros(len(tables.bands), np.int8)
    none = scaled_decoder(tables, gains)
    np.testing.assert_array_equal(none.scales, tables.decoder.scales)
    of_bands = np.zeros(8 * BANDS, np.int8)
    of_bands[3 * BANDS] = -16
    one = scaled_decoder(tables, of_bands)
    np.testing.assert_array_equal(one.scales, scaled_decoder(tables, of_bands[tables.bands]).scales)
    moved = (one.scales != none.scales).any(axis=0)
    assert set(one.channels[moved].tolist()) == {3}
    lowered = none.scales[:, moved].astype(int) - one.scales[:, moved]
    assert lowered.max() == 16
    # 16 steps are an octave of amplitude: a fourth of the energy.
    np.testing.assert_allclose(steps_between(np.array([1.0, 0.25]), np.ones(2)), [0.0, -16.0])


def test_packs_hold_gains_alone_and_read_back(tmp_path: Path) -> None:
    sources = [material(WHOLE, seed=1), material(KINDS[2], (32, 32), seed=2), material(BASE_ALONE, (48, 32), seed=3)]
    pack = encoded(sources)
    config = block_parts(pack).config
    assert pack.grouping.groups == (0, 1, 2)
    write_pack(tmp_path / "a.ntc", pack)
    parts = PackBytes.of((tmp_path / "a.ntc").read_bytes())
    names = [name for name in parts.tensors if name.startswith("decoder")]
    assert names == [f"decoder.{group}.gains" for group in range(3)]
    assert list(decoder_shapes(config).values()) == [("I8", (None,))]
    assert psnr_table(pack).decoder_bytes == 3 * config.output_channels * BANDS
    read = read_pack(tmp_path / "a.ntc")
    assert read.config == pack.config
    assert pack_bytes(read) == pack_bytes(pack)
    for index in range(len(sources)):
        np.testing.assert_array_equal(decode_image(read, index), decode_image(pack, index))
        assert (read.textures[index].psnr_db or 0.0) > 28.0
    some = read_textures(tmp_path / "a.ntc", {sources[1].pixel_hash})
    assert len(some.decoders) == 1
    np.testing.assert_array_equal(decode_image(some, 0), decode_image(pack, 1))


def test_a_pack_is_the_same_each_time_and_counts_its_bits() -> None:
    sources = [material(WHOLE, (256, 256), seed=seed) for seed in range(2)]
    for bits in (2.0, 4.0):
        pack = encoded(sources, bits)
        assert bits_with_mips(pack) == pytest.approx(bits, rel=0.02)
    assert pack_bytes(encoded(sources, 4.0)) == pack_bytes(pack)


def test_many_materials_share_gains_with_those_that_are_alike() -> None:
    sources = [material(WHOLE, (32, 32), seed=seed) for seed in range(MOST_SCALED_GROUPS + 4)]
    groups = make_grouping(GroupingConfig("universal"), sources).groups
    assert max(groups) < MOST_SCALED_GROUPS
    assert make_grouping(GroupingConfig("universal", clusters=3), sources[:5]).group_count == 3
    assert make_grouping(GroupingConfig("universal", clusters=1), sources).groups == (0,) * len(sources)
    weak = [replace(each, pixels=(each.pixels // 8 + 112).astype(np.uint8)) for each in sources[:2]]
    # A map that is much weaker than the others tells materials apart.
    for each in weak:
        each.pixels[..., :5] = sources[0].pixels[..., :5]
    found = shared_gains([*sources[:2], *weak], 2)
    assert found[2] == found[3] != found[0]


def test_packs_join_with_their_gains() -> None:
    first, second = ([material(WHOLE, (32, 32), seed=seed)] for seed in (1, 2))
    config = replace(config_for_bits(6.0, texture_set(first, 0)), mean_words=8.0)
    packs = [
        encode_textures(each, make_grouping(GroupingConfig("universal"), each), config, BlockOptions())
        for each in (first, second)
    ]
    joined = joined_pack(packs)
    assert (len(joined.decoders), joined.grouping.groups) == (2, (0, 1))
    for index, pack in enumerate(packs):
        np.testing.assert_array_equal(decode_image(joined, index), decode_image(pack, 0))


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [("tables", 99, "no tables of version 99"), ("coefficients", 30, "basis"), ("modes", 64, "scales")],
)
def test_packs_of_tables_that_do_not_ship_are_refused(tmp_path: Path, field: str, value: int, words: str) -> None:
    path = tmp_path / "a.ntc"
    write_pack(path, encoded([material(WHOLE, (32, 32))]))
    parts = PackBytes.of(path.read_bytes())
    path.write_bytes(parts.changed(lambda p: p.metadata["codec"].__setitem__(field, value)))
    with pytest.raises(InputError, match=words):
        read_pack(path)


def test_large_textures_have_a_gain_for_each_coefficient(tmp_path: Path) -> None:
    source = material(KINDS[2], (512, 512), seed=1)
    pack = encoded([source], 2.0)
    config = block_parts(pack).config
    assert psnr_table(pack).decoder_bytes == config.coefficients
    assert bits_with_mips(pack) == pytest.approx(2.0, rel=0.02)
    write_pack(tmp_path / "a.ntc", pack)
    np.testing.assert_array_equal(decode_image(read_pack(tmp_path / "a.ntc"), 0), decode_image(pack, 0))
    parts = PackBytes.of((tmp_path / "a.ntc").read_bytes())
    assert parts.tensors["decoder.0.gains"]["shape"] == [config.coefficients]
