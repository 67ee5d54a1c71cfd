"""Pack files: what is written is read again, and what is damaged is refused with one line."""

import json
import math
import struct
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.model import block_parts
from ntc.codec.grid.model import GridConfig, grid_parts
from ntc.codec.maps import MAPS, MapName
from ntc.codec.model import CodecSettings, Grouping, Pack
from ntc.errors import InputError
from ntc.pack.file import expected_tensors, read_pack, write_pack
from ntc.pack.match import changed_textures, same_shape
from ntc.pack.schema import parse_metadata
from tests.support.pack_bytes import PackBytes
from tests.support.packs.checks import assert_equal, check_pack

Change = Callable[[PackBytes], None]
Pieces = dict[str, PackBytes]
SIZES = ((8, 8), (12, 4), (5, 7))
SMALL = BlockConfig(block_side=4, block_words=(2,), mean_words=2.0, coefficients=10, modes=8)
SIZES_OF_CODES = replace(SMALL, block_words=(1, 2, 3))
SETS = replace(SMALL, output_channels=8, maps=("base", "normal", "roughness", "metalness", "occlusion"))
KINDS: list[tuple[MapName, ...]] = [SETS.maps, ("base",), ("normal", "occlusion")]


@pytest.fixture(scope="module")
def pieces(tmp_path_factory: pytest.TempPathFactory) -> Pieces:
    """Good files of three textures and two decoders, taken apart: of both codecs, and of material sets."""
    folder = tmp_path_factory.mktemp("good")
    packs = {
        "grid": random_pack(SIZES, config=GridConfig(hidden_width=8)),
        "block": random_block_pack(SIZES, config=SMALL),
        "sets": random_block_pack(SIZES, config=SETS, maps=KINDS),
        "several sizes": random_block_pack(SIZES, config=SIZES_OF_CODES, seed=3),
    }
    for name, pack in packs.items():
        write_pack(folder / name, pack)
    return {name: PackBytes.of((folder / name).read_bytes()) for name in packs}


def refuse(folder: Path, file: bytes, *words: str) -> None:
    """`file` is refused with one line that begins with its path and has these words."""
    path = folder / "bad.ntc"
    path.write_bytes(file)
    with pytest.raises(InputError) as caught:
        read_pack(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
    assert len(line) < 500 + len(str(path))
    for word in words:
        assert word in line


@pytest.mark.parametrize(
    "config",
    [
        GridConfig(),
        GridConfig(levels=1, output_channels=1),
        GridConfig(latent_channels=16, output_channels=4),
        GridConfig(adapters=True),
        GridConfig(latent_channels=8, latent_bits=4, adapters=True, adapter_output=True),
        GridConfig(latent_channels=12, latent_bits=4, output_channels=4, weight_bits=16),
        BlockConfig(),
        SMALL,
        SIZES_OF_CODES,
        BlockConfig(block_words=(16,), mean_words=16.0, modes=8, coefficients=192, levels=1),
        BlockConfig(block_words=(1,), mean_words=1.0, modes=64, coefficients=1, output_channels=1),
        BlockConfig(output_channels=4),
        BlockConfig(output_channels=12, maps=MAPS),
        SETS,
    ],
)
def test_round_trip_is_exact_and_writing_twice_gives_the_same_bytes(tmp_path: Path, config: CodecSettings) -> None:
    made: Any = random_pack if isinstance(config, GridConfig) else random_block_pack
    pack = made(config=config, wrap=("mirror", "clamp"))
    first = replace(pack.textures[0], name='a "name"\n\t\\ \u00e9\u4e2d\U0001f600', category="wood", psnr_db=41.3)
    second = replace(pack.textures[1], color_space="linear")
    if isinstance(config, GridConfig):
        second = replace(second, channels=1)
    pack = replace(pack, textures=(first, second, pack.textures[2]), training={"steps": 5, "none": None, "f": 0.1})
    check_pack(pack)
    folder = tmp_path / "new folder"
    paths = [folder / f"{name}.ntc" for name in ("one", "two", "three")]
    write_pack(paths[0], pack)
    read = read_pack(paths[0])
    assert read.path == paths[0]
    assert_equal(read, pack)
    write_pack(paths[1], pack)
    write_pack(paths[2], read)
    assert paths[0].read_bytes() == paths[1].read_bytes() == paths[2].read_bytes()
    assert sorted(folder.iterdir()) == sorted(paths)


def test_a_file_from_before_adapters_is_read(tmp_path: Path, pieces: Pieces) -> None:
    path = tmp_path / "old.ntc"

    def old(pack: PackBytes) -> None:
        for field in ("adapters", "adapter_output", "weight_bits"):
            pack.metadata["codec"].pop(field)

    path.write_bytes(pieces["grid"].changed(old))
    config = grid_parts(read_pack(path)).config
    assert not config.adapters
    assert not config.adapter_output


def test_a_pack_without_textures(tmp_path: Path) -> None:
    pack = Pack(GridConfig(), Grouping("baseline", ()), (), ())
    write_pack(tmp_path / "empty.ntc", pack)
    assert_equal(read_pack(tmp_path / "empty.ntc"), pack)


def test_files_hold_what_the_format_says(tmp_path: Path, pieces: Pieces) -> None:
    path = tmp_path / "good.ntc"
    for own in pieces.values():
        path.write_bytes(own.file())
        assert len(read_pack(path).textures) == 3
        assert set(expected_tensors(parse_metadata(json.dumps(own.metadata)))) == set(own.tensors)
    assert pieces["block"].metadata["codec"] == {
        "kind": "block", "format": 2, "mips": 2, "block_side": 4, "block_words": [2], "mean_words": 2.0,
        "coefficients": 10, "modes": 8, "output_channels": 3, "levels": None,
    }  # fmt: skip
    # 2 x 2 blocks of two words, for both mips.
    assert pieces["block"].tensors["latents.0"]["shape"] == [8, 4]


def test_files_name_maps_only_where_there_are_sets(tmp_path: Path, pieces: Pieces) -> None:
    plain, sets = pieces["block"].metadata, pieces["sets"].metadata
    assert all("maps" not in texture for texture in (plain["codec"], *plain["textures"]))
    assert sets["codec"]["maps"] == list(SETS.maps)
    assert [texture.get("maps") for texture in sets["textures"]] == [list(SETS.maps), None, ["normal", "occlusion"]]
    assert [texture["channels"] for texture in sets["textures"]] == [8, 3, 3]
    # A matrix for each plane: base, normal with roughness and metalness, occlusion.
    assert pieces["sets"].tensors["latents.0.axes"]["shape"] == [3 * 3 + 4 * 4 + 1]
    path = tmp_path / "good.ntc"
    path.write_bytes(pieces["sets"].file())
    assert [texture.maps for texture in read_pack(path).textures] == KINDS


def test_missing_files_folders_and_impossible_names(tmp_path: Path) -> None:
    for path, words in (
        (tmp_path / "none.ntc", "no such file"),
        (tmp_path, "is a folder"),
        (tmp_path / "none" / "a.ntc", "no such file"),
        (tmp_path / ("x" * 5000), ""),
        (tmp_path / "a\0b", ""),
    ):
        with pytest.raises(InputError) as caught:
            read_pack(path)
        assert str(caught.value).startswith(f"{path}: ".replace("\0", "?"))
        assert words in str(caught.value)


def test_no_bytes_and_other_files(tmp_path: Path) -> None:
    refuse(tmp_path, b"", "empty")
    refuse(tmp_path, b"\x89PNG\r\n\x1a\n" + bytes(100))
    refuse(tmp_path, b"{}")
    refuse(tmp_path, struct.pack("<Q", 2) + b"{}", "metadata")
    refuse(tmp_path, struct.pack("<Q", 2**63) + b"{}")
    refuse(tmp_path, struct.pack("<Q", 2**64 - 1) + b"{}" * 100)


def test_truncated_or_lengthened_anywhere(tmp_path: Path, pieces: Pieces) -> None:
    file = pieces["grid"].file()
    for length in {*range(0, 64), *range(64, len(file), 97), *range(len(file) - 20, len(file))}:
        refuse(tmp_path, file[:length])
    refuse(tmp_path, file + b"\0")


def set_weight(value: float) -> Change:
    """Overwrite one weight."""
    return lambda p: p.put("decoder.1.1.weight", 8, struct.pack("<f", value))


def set_tensor(name: str, key: str, value: Any) -> Change:
    """Change a tensor's header."""
    return lambda p: p.tensors[name].__setitem__(key, value)


def transpose_weight(pieces: PackBytes) -> None:
    """Same size, other shape."""
    pieces.tensors["decoder.0.0.weight"]["shape"].reverse()


def drop_last_tensor(pieces: PackBytes) -> None:
    """Leave out the tensor that lies last, with its bytes."""
    name = max(pieces.tensors, key=lambda key: pieces.tensors[key]["data_offsets"][1])
    start, _ = pieces.tensors.pop(name)["data_offsets"]
    pieces.data = pieces.data[:start]


def add_tensor(pieces: PackBytes) -> None:
    """One tensor too many."""
    end = len(pieces.data)
    pieces.tensors["latents.3"] = {"dtype": "U8", "shape": [4], "data_offsets": [end, end + 4]}
    pieces.data += bytes(4)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (set_weight(math.nan), ("decoder.1.1.weight", "NaN or infinity")),
        (set_weight(-math.inf), ("decoder.1.1.weight", "NaN or infinity")),
        (lambda p: p.put("latents.0.scale", 0, struct.pack("<f", math.nan)), ("latents.0.scale", "NaN")),
        (lambda p: p.put("latents.2.offset", 12, struct.pack("<f", math.inf)), ("latents.2.offset", "NaN")),
        (transpose_weight, ("decoder.0.0.weight", "expected F32 [8, 17]")),
        (set_tensor("latents.1", "dtype", "I8"), ("latents.1", "expected U8")),
        (set_tensor("latents.1", "dtype", "BOOL"), ("latents.1", "expected U8")),
        (set_tensor("latents.0.scale", "dtype", "I32"), ("latents.0.scale", "expected F32")),
        (set_tensor("latents.1", "dtype", "what"), ()),
        (set_tensor("latents.1", "shape", [2**62, 4]), ()),
        (set_tensor("latents.1", "shape", []), ()),
        (set_tensor("latents.1", "data_offsets", [0, 2**60]), ()),
        (set_tensor("latents.1", "data_offsets", [-1, 3]), ()),
        (drop_last_tensor, ("is missing",)),
        (add_tensor, ("'latents.3' does not belong",)),
    ],
)
def test_damaged_tensors(tmp_path: Path, pieces: Pieces, change: Change, words: tuple[str, ...]) -> None:
    refuse(tmp_path, pieces["grid"].changed(change), *words)


def replace_field(*keys: Any) -> Change:
    """Set the field at keys[:-1] to keys[-1]."""

    def change(pieces: PackBytes) -> None:
        owner: Any = pieces.metadata
        for key in keys[:-2]:
            owner = owner[key]
        owner[keys[-2]] = keys[-1]

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (replace_field("format_version", 2), ("format version 2", "reads 1")),
        (replace_field("format_version", "1"), ("format_version",)),
        (replace_field("format_version", True), ("format_version",)),
        (replace_field("grouping", "groups", [0, 1, 2]), ("grouping.groups", "below 2")),
        (replace_field("grouping", "groups", [0, 1, -1]), ("grouping.groups",)),
        (replace_field("grouping", "groups", [0, 1, 0.0]), ("grouping.groups",)),
        (replace_field("grouping", "groups", [0, 1]), ("grouping.groups", "3 decoder indices")),
        (replace_field("grouping", "groups", {}), ("grouping.groups",)),
        (replace_field("grouping", "name", ""), ("grouping.name",)),
        (replace_field("grouping", "name", "\ud800"), ("grouping.name",)),
        (replace_field("grouping", []), ("metadata.grouping",)),
        (replace_field("decoders", 3), ("decoder.2.", "missing")),
        (replace_field("decoders", 10**9), ("decoders",)),
        (replace_field("textures", None), ("textures",)),
        (replace_field("textures", []), ("grouping.groups",)),
        (replace_field("textures", 1, 7), ("textures[1]",)),
        (replace_field("textures", 1, "width", 0), ("textures[1].width",)),
        (replace_field("textures", 1, "width", 10**9), ("textures[1].width",)),
        (replace_field("textures", 1, "width", True), ("textures[1].width",)),
        (replace_field("textures", 1, "width", 32768), ("latents.1", "expected U8")),
        (replace_field("textures", 1, "height", 8.0), ("textures[1].height",)),
        (replace_field("textures", 1, "channels", 4), ("textures[1].channels",)),
        (replace_field("textures", 1, "color_space", "adobe"), ("textures[1].color_space",)),
        (replace_field("textures", 1, "color_space", []), ("textures[1].color_space",)),
        (replace_field("textures", 1, "wrap", ["repeat"]), ("textures[1].wrap",)),
        (replace_field("textures", 1, "wrap", ["repeat", {}]), ("textures[1].wrap",)),
        (replace_field("textures", 1, "name", None), ("textures[1].name",)),
        (replace_field("textures", 1, "name", "x" * 5000), ("textures[1].name",)),
        (replace_field("textures", 1, "name", "\udfff"), ("textures[1].name",)),
        (replace_field("textures", 1, "category", 3), ("textures[1].category",)),
        (replace_field("textures", 1, "psnr_db", "good"), ("textures[1].psnr_db",)),
        (replace_field("textures", 1, "psnr_db", 10**400), ("textures[1].psnr_db",)),
        (replace_field("textures", 1, "psnr_db", math.inf), ("Infinity",)),
        (replace_field("codec", {}), ("codec",)),
        (replace_field("codec", "surplus", 1), ("codec",)),
        (replace_field("codec", "hidden_width", 2**40), ("codec.hidden_width",)),
        (replace_field("codec", "hidden_width", 16), ("decoder.0.0.weight",)),
        (replace_field("codec", "hidden_width", "64"), ("codec.hidden_width",)),
        (replace_field("codec", "levels", False), ("codec.levels",)),
        (replace_field("codec", "latent_channels", 8), ("latents.0",)),
        (replace_field("codec", "leaky_slope", math.nan), ("NaN",)),
        (replace_field("training", 5), ("metadata.training",)),
        (lambda p: p.metadata.pop("training"), ("metadata.training is missing",)),
        (lambda p: p.metadata["textures"][0].pop("wrap"), ("textures[0].wrap is missing",)),
    ],
)
def test_wrong_metadata(tmp_path: Path, pieces: Pieces, change: Change, words: tuple[str, ...]) -> None:
    refuse(tmp_path, pieces["grid"].changed(change), *words)


@pytest.mark.parametrize(
    "text",
    [
        "", "{", "null", "[]", "7", "\x00", '{"format_version": 1}', "NaN", "[" * 100_000, '{"a":' * 100_000,
        "1" * 10_000, '{"format_version": ' + "1" * 5000 + "}",
        '{"format_version": 1, "codec": ' + "[" * 900 + "]" * 900 + "}",
    ],
)  # fmt: skip
def test_metadata_that_is_not_what_it_should_be(tmp_path: Path, pieces: Pieces, text: str) -> None:
    refuse(tmp_path, pieces["grid"].file(metadata_text=text))


def test_numbers_too_large_for_a_float_are_refused(tmp_path: Path, pieces: Pieces) -> None:
    text = json.dumps(pieces["grid"].metadata)
    for field in ('"psnr_db": null', '"training": {}', '"seed": 0'):
        assert field in text
        key = field.split(":")[0]
        value = '{"x": 1e999}' if field.endswith("{}") else "1e999"
        refuse(tmp_path, pieces["grid"].file(metadata_text=text.replace(field, f"{key}: {value}")))


@pytest.mark.parametrize("depth", [100, 900, 990])
def test_deeply_nested_values_in_any_field(tmp_path: Path, pieces: Pieces, depth: int) -> None:
    assert depth < sys.getrecursionlimit()
    text = json.dumps(pieces["grid"].metadata).replace('"psnr_db": null', '"psnr_db": ' + "[" * depth + "]" * depth)
    refuse(tmp_path, pieces["grid"].file(metadata_text=text))


def put(name: str, offset: int, value: bytes) -> Change:
    """Overwrite bytes of a tensor."""
    return lambda p: p.put(name, offset, value)


def codec(field: str, value: Any) -> Change:
    """Set a field of the codec."""
    return lambda p: p.metadata["codec"].__setitem__(field, value)


def maps_of_texture(index: int, maps: Any) -> Change:
    """Set the maps of a texture."""
    return lambda p: p.metadata["textures"][index].__setitem__("maps", maps)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (put("decoder.0.basis_scale", 1, b"\xff"), ("decoder.0.basis_scale", "beyond 192")),
        (put("decoder.0.channels", 9, b"\x03"), ("decoder.0.channels", "of channel 3")),
        (put("decoder.0.edges", 0, b"\x04"), ("decoder.0.edges", "4 bits a texel")),
        (put("latents.2.mean", 0, struct.pack("<f", float("inf"))), ("latents.2.mean", "NaN or infinity")),
        (put("latents.1.axes", 32, struct.pack("<f", -1e9)), ("latents.1.axes", "beyond 16")),
        (lambda p: p.tensors["decoder.0.basis"].update(dtype="U8"), ("decoder.0.basis", "expected I8")),
        (lambda p: p.tensors["latents.0"].update(shape=[32]), ("latents.0", "expected U8 [any, 4]")),
        (lambda p: p.tensors.pop("latents.1.axes"), ()),
        (codec("kind", "wavelet"), ("metadata.codec.kind",)),
        (codec("kind", None), ("metadata.codec.kind",)),
        (codec("kind", "grid"), ("metadata.codec",)),
        (lambda p: p.metadata["codec"].pop("kind"), ("metadata.codec",)),
        (lambda p: p.metadata["codec"].pop("modes"), ("metadata.codec has fields",)),
        (codec("hidden_width", 64), ("metadata.codec has fields",)),
        (codec("modes", 3), ("codec.modes",)),
        (codec("modes", 16), ("decoder.0.scales",)),
        (codec("block_words", [10**9]), ("codec.block_words",)),
        (codec("block_words", [1]), ("latents.0", "8 words, not the 4")),
        (codec("block_words", [3]), ("latents.0", "too few")),
        (codec("block_words", [1, 2, 3, 4, 5]), ("codec.block_words",)),
        (codec("block_words", 2), ("codec.block_words",)),
        (codec("mean_words", -1.0), ("codec.mean_words",)),
        (codec("block_side", 5), ("metadata.codec.block_side",)),
        (codec("coefficients", 49), ("codec.coefficients",)),
        (codec("output_channels", 2), ("textures[0].channels",)),
    ],
)
def test_damaged_files_of_codec_block(tmp_path: Path, pieces: Pieces, change: Change, words: tuple[str, ...]) -> None:
    refuse(tmp_path, pieces["block"].changed(change), *words)


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
def test_damaged_files_of_sets(tmp_path: Path, pieces: Pieces, change: Change, words: tuple[str, ...]) -> None:
    refuse(tmp_path, pieces["sets"].changed(change), *words)


@pytest.mark.parametrize(
    ("offset", "value", "words"),
    [
        (0, b"\x03", "places where codes begin"),
        (0, b"\xff" * 4, "places where codes begin"),
        (4, b"\xff", "a size of codes that the codec does not have"),
        (4, b"\x00", "latents"),
    ],
)
def test_directories_that_no_encoder_writes(
    tmp_path: Path, pieces: Pieces, offset: int, value: bytes, words: str
) -> None:
    """Bytes of latents.0 are changed: a level of 4 blocks, then one of 1."""
    refuse(tmp_path, pieces["several sizes"].changed(put("latents.0", offset, value)), words)


def test_any_codes_are_valid(tmp_path: Path, pieces: Pieces) -> None:
    path = tmp_path / "a.ntc"
    for byte in (b"\x00", b"\xff", b"\xa7"):
        path.write_bytes(pieces["block"].changed(put("latents.0", 0, byte * 40)))
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
    brighter = replace(first, basis_scale=first.basis_scale + np.uint8(16))
    assert changed_textures(old, replace(old, decoders=(brighter, second))) == {0, 2}
    assert not same_shape(old, random_pack())


def test_a_damaged_pack_is_not_overwritten_by_a_failed_write(tmp_path: Path) -> None:
    path = tmp_path / "a.ntc"
    path.write_bytes(b"old")
    with pytest.raises(ValueError, match="JSON"):
        write_pack(path, replace(random_pack(), training={"loss": math.nan}))
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.ntc"]
