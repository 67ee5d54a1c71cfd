"""Pack files of codec `block`: written and read again, damaged ones refused, grid packs as they always were."""

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.model import block_parts
from ntc.codec.maps import MAPS, MapName
from ntc.errors import InputError
from ntc.pack.file import expected_tensors, read_pack, write_pack
from ntc.pack.match import changed_textures, same_shape
from ntc.pack.schema import parse_metadata
from tests.support.pack_bytes import PackBytes
from tests.support.packs.checks import check_pack

SMALL = BlockConfig(block_side=4, block_words=(2,), mean_words=2.0, coefficients=10, modes=4)
SIZES_OF_CODES = replace(SMALL, block_words=(1, 2, 3))
SETS = replace(SMALL, output_channels=8, maps=("base", "normal", "roughness", "metalness", "occlusion"))
KINDS: list[tuple[MapName, ...]] = [SETS.maps, ("base",), ("normal", "occlusion")]
Change = Callable[[PackBytes], None]


@pytest.fixture(scope="module")
def pieces(tmp_path_factory: pytest.TempPathFactory) -> PackBytes:
    """A good file of three textures and two decoders, taken apart."""
    path = tmp_path_factory.mktemp("good") / "good.ntc"
    write_pack(path, random_block_pack(((8, 8), (12, 4), (5, 7)), config=SMALL))
    return PackBytes.of(path.read_bytes())


@pytest.mark.parametrize(
    "config",
    [
        BlockConfig(),
        SMALL,
        SIZES_OF_CODES,
        BlockConfig(block_words=(16,), mean_words=16.0, modes=1, coefficients=192, levels=1),
        BlockConfig(block_words=(1,), mean_words=1.0, modes=64, coefficients=1, output_channels=1),
        BlockConfig(output_channels=4),
        BlockConfig(output_channels=12, maps=MAPS),
        SETS,
    ],
)
def test_round_trip_is_exact(tmp_path: Path, config: BlockConfig) -> None:
    pack = random_block_pack(config=config, wrap=("mirror", "clamp"))
    check_pack(pack)
    path, again = tmp_path / "pack.ntc", tmp_path / "again.ntc"
    write_pack(path, pack)
    read = read_pack(path)
    check_pack(read)
    write_pack(again, read)
    assert path.read_bytes() == again.read_bytes()
    assert (read.config, read.grouping) == (pack.config, pack.grouping)
    for one, other in zip(block_parts(pack).textures, block_parts(read).textures, strict=True):
        for part in ("words", "mean", "axes"):
            np.testing.assert_array_equal(getattr(one, part), getattr(other, part))
        assert (one.name, one.maps, one.wrap, one.group) == (other.name, other.maps, other.wrap, other.group)
    for decoder, twin in zip(block_parts(pack).decoders, block_parts(read).decoders, strict=True):
        for part in ("basis", "basis_scale", "scales"):
            array, found = getattr(decoder, part), getattr(twin, part)
            assert (array.dtype, array.tobytes()) == (found.dtype, found.tobytes())


def test_the_file_holds_what_the_format_says(tmp_path: Path, pieces: PackBytes) -> None:
    path = tmp_path / "good.ntc"
    path.write_bytes(pieces.file())
    assert len(read_pack(path).textures) == 3
    assert set(expected_tensors(parse_metadata(json.dumps(pieces.metadata)))) == set(pieces.tensors)
    assert pieces.metadata["codec"] == {
        "kind": "block", "block_side": 4, "block_words": [2], "mean_words": 2.0, "coefficients": 10, "modes": 4,
        "output_channels": 3, "levels": None,
    }  # fmt: skip
    # 2 x 2 blocks, then 1, of two words.
    assert pieces.tensors["latents.0"]["shape"] == [10, 4]


def test_files_of_codec_grid_name_no_kind_and_may(tmp_path: Path) -> None:
    plain, named = tmp_path / "plain.ntc", tmp_path / "named.ntc"
    write_pack(plain, random_pack())
    parts = PackBytes.of(plain.read_bytes())
    assert "kind" not in parts.metadata["codec"]
    named.write_bytes(parts.changed(lambda p: p.metadata["codec"].update(kind="grid")))
    assert read_pack(named).config == read_pack(plain).config


def put(name: str, offset: int, value: bytes) -> Change:
    """Overwrite bytes of a tensor."""
    return lambda p: p.put(name, offset, value)


def codec(field: str, value: Any) -> Change:
    """Set a field of the codec."""
    return lambda p: p.metadata["codec"].__setitem__(field, value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (put("decoder.0.basis_scale", 0, struct.pack("<f", float("nan"))), ("decoder.0.basis_scale", "NaN")),
        (put("decoder.0.basis_scale", 4, struct.pack("<f", 1e30)), ("decoder.0.basis_scale", "beyond 16")),
        (put("latents.2.mean", 0, struct.pack("<f", float("inf"))), ("latents.2.mean", "NaN or infinity")),
        (put("latents.1.axes", 32, struct.pack("<f", -1e9)), ("latents.1.axes", "beyond 16")),
        (lambda p: p.tensors["decoder.0.basis"].update(dtype="U8"), ("decoder.0.basis", "expected I8")),
        (lambda p: p.tensors["latents.0"].update(shape=[40]), ("latents.0", "expected U8 [any, 4]")),
        (lambda p: p.tensors.pop("latents.1.axes"), ()),
        (codec("kind", "wavelet"), ("metadata.codec.kind",)),
        (codec("kind", None), ("metadata.codec.kind",)),
        (codec("kind", "grid"), ("metadata.codec",)),
        (lambda p: p.metadata["codec"].pop("kind"), ("metadata.codec",)),
        (lambda p: p.metadata["codec"].pop("modes"), ("metadata.codec has fields",)),
        (codec("hidden_width", 64), ("metadata.codec has fields",)),
        (codec("modes", 3), ("codec.modes",)),
        (codec("modes", 8), ("decoder.0.scales",)),
        (codec("block_words", [10**9]), ("codec.block_words",)),
        (codec("block_words", [1]), ("latents.0", "10 words, not the 5")),
        (codec("block_words", [3]), ("latents.0", "too few")),
        (codec("block_words", [1, 2, 3, 4, 5]), ("codec.block_words",)),
        (codec("block_words", 2), ("codec.block_words",)),
        (codec("mean_words", -1.0), ("codec.mean_words",)),
        (codec("block_side", 5), ("metadata.codec.block_side",)),
        (codec("coefficients", 49), ("codec.coefficients",)),
        (codec("output_channels", 2), ("textures[0].channels",)),
    ],
)
def test_damaged_files_are_refused_in_one_line(
    tmp_path: Path, pieces: PackBytes, change: Change, words: tuple[str, ...]
) -> None:
    path = tmp_path / "bad.ntc"
    path.write_bytes(pieces.changed(change))
    with pytest.raises(InputError) as caught:
        read_pack(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
    assert all(word in line for word in words), line


@pytest.fixture(scope="module")
def set_pieces(tmp_path_factory: pytest.TempPathFactory) -> PackBytes:
    """A good file of a material set, a base colour and a set without one, taken apart."""
    path = tmp_path_factory.mktemp("sets") / "good.ntc"
    write_pack(path, random_block_pack(((8, 8), (12, 4), (5, 7)), config=SETS, maps=KINDS))
    return PackBytes.of(path.read_bytes())


def test_files_name_maps_only_where_there_are_sets(tmp_path: Path, pieces: PackBytes, set_pieces: PackBytes) -> None:
    assert all("maps" not in texture for texture in (pieces.metadata["codec"], *pieces.metadata["textures"]))
    assert set_pieces.metadata["codec"]["maps"] == list(SETS.maps)
    textures = set_pieces.metadata["textures"]
    assert [texture.get("maps") for texture in textures] == [list(SETS.maps), None, ["normal", "occlusion"]]
    assert [texture["channels"] for texture in textures] == [8, 3, 3]
    # A matrix for each plane: base, normal with roughness and metalness, occlusion.
    assert set_pieces.tensors["latents.0.axes"]["shape"] == [3 * 3 + 4 * 4 + 1]
    path = tmp_path / "good.ntc"
    path.write_bytes(set_pieces.file())
    assert [texture.maps for texture in read_pack(path).textures] == KINDS


def maps_of_texture(index: int, maps: Any) -> Change:
    """Set the maps of a texture."""
    return lambda p: p.metadata["textures"][index].__setitem__("maps", maps)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (codec("maps", ["base"]), ("codec.output_channels",)),
        (codec("maps", []), ("codec.maps",)),
        (codec("maps", list(reversed(SETS.maps))), ("codec.maps",)),
        (codec("maps", ["base", "base"]), ("codec.maps",)),
        (codec("maps", ["base", "height"]), ("metadata.codec.maps",)),
        (codec("maps", 8), ("metadata.codec.maps",)),
        (codec("maps", ["base"] * 100_000), ("codec.maps",)),
        (codec("output_channels", 9), ("latents.0.mean",)),
        (codec("output_channels", 10**9), ("codec.",)),
        (lambda p: p.metadata["codec"].pop("maps"), ("codec.output_channels",)),
        (maps_of_texture(0, ["base"]), ("textures[0]", "channels")),
        (maps_of_texture(1, ["emissive"]), ("textures[1]", "emissive")),
        (maps_of_texture(2, ["occlusion", "normal"]), ("textures[2]", "in the order")),
        (maps_of_texture(2, []), ("textures[2]",)),
        (maps_of_texture(2, ["wood"]), ("metadata.textures[2].maps",)),
        (lambda p: p.metadata["textures"][0].update(channels=13), ("textures[0].channels",)),
        (lambda p: p.metadata["grouping"].update(name="universal"), ("does not belong there",)),
        (put("decoder.1.channels", 3, b"\x08"), ("decoder.1.channels", "of channel 8")),
        (lambda p: p.tensors["decoder.0.basis"].update(shape=[16, 10]), ("decoder.0.basis",)),
        (put("latents.1.axes", 64, struct.pack("<f", -1e9)), ("latents.1.axes", "beyond 16")),
    ],
)
def test_damaged_files_of_sets_are_refused_in_one_line(
    tmp_path: Path, set_pieces: PackBytes, change: Change, words: tuple[str, ...]
) -> None:
    test_damaged_files_are_refused_in_one_line(tmp_path, set_pieces, change, words)


def _directory_changes() -> list[tuple[int, bytes, str]]:
    """(byte of latents.0, what it becomes, what the message says): a level of 4 blocks, then one of 1."""
    return [
        (0, b"\x03", "places where codes begin"),
        (0, b"\xff" * 4, "places where codes begin"),
        (4, b"\xff", "a size of codes that the codec does not have"),
        (4, b"\x00", "latents"),
    ]


@pytest.mark.parametrize(("offset", "value", "words"), _directory_changes())
def test_directories_that_no_encoder_writes_are_refused(tmp_path: Path, offset: int, value: bytes, words: str) -> None:
    path = tmp_path / "bad.ntc"
    pack = random_block_pack(((8, 8), (12, 4), (5, 7)), config=SIZES_OF_CODES, seed=3)
    write_pack(path, pack)
    assert len(read_pack(path).textures) == 3
    path.write_bytes(PackBytes.of(path.read_bytes()).changed(lambda p: p.put("latents.0", offset, value)))
    with pytest.raises(InputError, match=words):
        read_pack(path)


def test_any_codes_are_valid(tmp_path: Path, pieces: PackBytes) -> None:
    path = tmp_path / "a.ntc"
    for byte in (b"\x00", b"\xff", b"\xa7"):
        path.write_bytes(pieces.changed(lambda p, byte=byte: p.put("latents.0", 0, byte * 40)))  # type: ignore[misc]
        check_pack(read_pack(path))


def test_what_decodes_differently_is_found() -> None:
    old = random_block_pack()
    assert changed_textures(old, random_block_pack()) == frozenset()
    changed = block_parts(old).textures[1]
    words = changed.words.copy()
    words[-1] ^= 1
    other = replace(old, textures=(old.textures[0], replace(changed, words=words), old.textures[2]))
    assert same_shape(old, other)
    assert changed_textures(old, other) == {1}
    first, second = block_parts(old).decoders
    brighter = replace(first, basis_scale=first.basis_scale * np.float32(2.0))
    assert changed_textures(old, replace(old, decoders=(brighter, second))) == {0, 2}
    assert not same_shape(old, random_pack())


def test_another_map_is_another_shape() -> None:
    old, new = (random_block_pack(config=SETS, maps=[kind] * 3) for kind in (("normal", "occlusion"), ("base",)))
    assert not same_shape(old, new)
    assert changed_textures(old, new) == {0, 1, 2}
