"""Pack files: what is written is read again, and what is damaged is refused with one line."""

import json
import math
import struct
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lab.bench.random_pack import random_pack
from ntc.codec.grid.model import GridConfig, grid_parts
from ntc.codec.model import Grouping, Pack
from ntc.errors import InputError
from ntc.pack.file import expected_tensors, read_pack, write_pack
from ntc.pack.schema import metadata_json, parse_metadata
from tests.support.pack_bytes import PackBytes
from tests.support.packs.checks import assert_equal

Change = Callable[[PackBytes], None]


@pytest.fixture(scope="module")
def pieces(tmp_path_factory: pytest.TempPathFactory) -> PackBytes:
    """A good file of three textures and two decoders, taken apart."""
    path = tmp_path_factory.mktemp("good") / "good.ntc"
    write_pack(path, random_pack(sizes=((8, 8), (12, 4), (5, 7)), config=GridConfig(hidden_width=8)))
    return PackBytes.of(path.read_bytes())


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
    ],
)
def test_round_trip_is_exact(tmp_path: Path, config: GridConfig) -> None:
    pack = random_pack(config=config, wrap=("mirror", "clamp"))
    first = replace(pack.textures[0], name='a "name"\n\t\\ \u00e9\u4e2d\U0001f600', category="wood", psnr_db=41.3)
    second = replace(pack.textures[1], channels=1, color_space="linear")
    pack = replace(pack, textures=(first, second, pack.textures[2]), training={"steps": 5, "none": None, "f": 0.1})
    path = tmp_path / "new folder" / "pack.ntc"
    write_pack(path, pack)
    read = read_pack(path)
    assert read.path == path
    assert_equal(read, pack)


def test_writing_twice_gives_the_same_bytes(tmp_path: Path) -> None:
    one, two, three = (tmp_path / f"{name}.ntc" for name in ("one", "two", "three"))
    write_pack(one, random_pack())
    write_pack(two, random_pack())
    write_pack(three, read_pack(one))
    assert one.read_bytes() == two.read_bytes() == three.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.ntc", "three.ntc", "two.ntc"]


def test_a_file_from_before_adapters_is_read(tmp_path: Path, pieces: PackBytes) -> None:
    path = tmp_path / "old.ntc"

    def old(pack: PackBytes) -> None:
        for field in ("adapters", "adapter_output", "weight_bits"):
            pack.metadata["codec"].pop(field)

    path.write_bytes(pieces.changed(old))
    config = grid_parts(read_pack(path)).config
    assert not config.adapters
    assert not config.adapter_output


def test_a_pack_without_textures(tmp_path: Path) -> None:
    pack = Pack(GridConfig(), Grouping("baseline", ()), (), ())
    write_pack(tmp_path / "empty.ntc", pack)
    assert_equal(read_pack(tmp_path / "empty.ntc"), pack)


def test_an_infinite_psnr_is_stored_as_unknown(tmp_path: Path) -> None:
    pack = random_pack(sizes=((4, 4),), groups=(0,))
    write_pack(tmp_path / "a.ntc", replace(pack, textures=(replace(pack.textures[0], psnr_db=math.inf),)))
    assert read_pack(tmp_path / "a.ntc").textures[0].psnr_db is None


def test_a_pack_of_the_pieces_is_good(tmp_path: Path, pieces: PackBytes) -> None:
    path = tmp_path / "good.ntc"
    path.write_bytes(pieces.file())
    assert len(read_pack(path).textures) == 3
    assert set(expected_tensors(parse_metadata(json.dumps(pieces.metadata)))) == set(pieces.tensors)


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


def test_truncated_or_lengthened_anywhere(tmp_path: Path, pieces: PackBytes) -> None:
    file = pieces.file()
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
def test_damaged_tensors(tmp_path: Path, pieces: PackBytes, change: Change, words: tuple[str, ...]) -> None:
    refuse(tmp_path, pieces.changed(change), *words)


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
def test_wrong_metadata(tmp_path: Path, pieces: PackBytes, change: Change, words: tuple[str, ...]) -> None:
    refuse(tmp_path, pieces.changed(change), *words)


@pytest.mark.parametrize(
    "text",
    [
        "", "{", "null", "[]", "7", "\x00", '{"format_version": 1}', "NaN", "[" * 100_000, '{"a":' * 100_000,
        "1" * 10_000, '{"format_version": ' + "1" * 5000 + "}",
        '{"format_version": 1, "codec": ' + "[" * 900 + "]" * 900 + "}",
    ],
)  # fmt: skip
def test_metadata_that_is_not_what_it_should_be(tmp_path: Path, pieces: PackBytes, text: str) -> None:
    refuse(tmp_path, pieces.file(metadata_text=text))


def test_numbers_too_large_for_a_float_are_refused(tmp_path: Path, pieces: PackBytes) -> None:
    text = json.dumps(pieces.metadata)
    for field in ('"psnr_db": null', '"training": {}', '"seed": 0'):
        assert field in text
        key = field.split(":")[0]
        value = '{"x": 1e999}' if field.endswith("{}") else "1e999"
        refuse(tmp_path, pieces.file(metadata_text=text.replace(field, f"{key}: {value}")))


@pytest.mark.parametrize("depth", [100, 900, 990])
def test_deeply_nested_values_in_any_field(tmp_path: Path, pieces: PackBytes, depth: int) -> None:
    assert depth < sys.getrecursionlimit()
    text = json.dumps(pieces.metadata).replace('"psnr_db": null', '"psnr_db": ' + "[" * depth + "]" * depth)
    refuse(tmp_path, pieces.file(metadata_text=text))


def test_a_damaged_pack_is_not_overwritten_by_a_failed_write(tmp_path: Path) -> None:
    path = tmp_path / "a.ntc"
    path.write_bytes(b"old")
    with pytest.raises(ValueError, match="JSON"):
        write_pack(path, replace(random_pack(), training={"loss": math.nan}))
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.ntc"]


def test_a_folder_cannot_be_written_over(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written"):
        write_pack(tmp_path, random_pack())


def test_metadata_text_does_not_depend_on_order() -> None:
    pack = random_pack()
    turned = replace(pack, training={"b": 1, "a": 2})
    assert metadata_json(turned) == metadata_json(replace(pack, training={"a": 2, "b": 1}))
