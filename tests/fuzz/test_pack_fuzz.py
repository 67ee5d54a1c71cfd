"""Damaged pack files give a Pack or InputError: never another exception, never for long."""

import copy
import json
import random
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.model import BlockParts, block_parts
from ntc.codec.block.trellis import LARGEST_DEPTH
from ntc.codec.grid.model import GridConfig, GridParts, grid_parts
from ntc.codec.latents import latent_cell_count
from ntc.codec.model import Pack
from ntc.codec.reference import decode_texels
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from ntc.metrics.metrics import psnr_table
from ntc.pack.file import read_pack, write_pack
from ntc.pack.schema import metadata_json, parse_metadata
from tests.support.pack_bytes import LENGTH_BYTES, PackBytes
from tests.support.work import limited

SECONDS = 1.5
"""How long each of the fuzz tests may run; they stop there, with whatever number of files."""
CASES = 3000
"""Most files of a test."""
MOST_UNITS = 40.0
"""Work that one file may take."""

VALUES: tuple[Any, ...] = (
    None, True, False, -1, 0, 1, 2, 3, 4, 8, 255, 4096, 32768, 65535, 2**31, 2**63, 10**400, 0.5, -0.0, 1e300,
    float("nan"), float("inf"), "", "x", "repeat", "srgb", "F32", "U8", "BF16", "F8_E4M3", "\ud800", "a\0b", [], {},
    [0], [[]], [0, 0], [0, 1, 0], [1, 4], [0, 2**62], [2**62, 2**62], {"a": 1},
)  # fmt: skip
"""What a field is replaced by."""


@pytest.fixture(scope="module", params=["grid", "block"])
def good(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A small well-formed file of each codec."""
    path = tmp_path_factory.mktemp("good") / "good.ntc"
    sizes = ((8, 8), (12, 4), (5, 7))
    if request.param == "grid":
        write_pack(path, random_pack(sizes, config=GridConfig(hidden_width=4)))
    else:
        config = BlockConfig(block_side=4, block_words=(1, 2), mean_words=1.0, coefficients=6, modes=8)
        write_pack(path, random_block_pack(sizes, config=config))
    return path.read_bytes()


def check(path: Path, file: bytes) -> bool:
    """Whether `file` reads as a pack; if so it is whole and can be used, if not the message is one line."""
    path.write_bytes(file)
    try:
        with limited(MOST_UNITS):
            pack = read_pack(path)
    except InputError as error:
        line = str(error)
        assert line.startswith(f"{path}: ")
        assert "\n" not in line
        assert len(line) < 1000
        line.encode("utf-8")
        return False
    assert_whole(pack)
    return True


def assert_whole(pack: Pack) -> None:
    """What docs/reference/pack-format.md promises of a pack that was read."""
    assert len(pack.textures) == len(pack.grouping.groups)
    for texture in pack.textures:
        assert 0 <= texture.group < len(pack.decoders)
        assert 1 <= texture.channels <= pack.config.output_channels
    if isinstance(pack.config, BlockConfig):
        assert_whole_blocks(block_parts(pack))
    else:
        assert_whole_grids(grid_parts(pack))
    for index, texture in enumerate(pack.textures):
        if texture.width * texture.height < 4096:
            assert np.isfinite(decode_texels(pack, index, np.array([[0.3, 0.7]]), np.array([0.5]))).all()
    "\n".join(psnr_table(pack).lines()).encode("utf-8")
    parse_metadata(metadata_json(pack))


def assert_whole_blocks(own: BlockParts) -> None:
    """What is true of codec `block` alone."""
    for texture in own.textures:
        rows = codec_of(own.config).gpu_tables(own.config).level_rows(texture)
        assert texture.words.shape == (sum(each.rows for each in rows),)
        assert np.isfinite(texture.axes).all()
        assert np.isfinite(texture.mean).all()
    for tables in own.decoders:
        depths = tables.depths(own.config)
        assert depths.max() <= LARGEST_DEPTH
        room = 32 * np.array(own.config.block_words)[:, None] - own.config.mode_bits
        assert (depths.sum(axis=2, dtype=np.int64) + tables.edge_bits(own.config) <= room).all()


def assert_whole_grids(own: GridParts) -> None:
    """What is true of codec `grid` alone."""
    for texture in own.textures:
        cells = latent_cell_count(texture.width, texture.height, own.config)
        assert texture.latents.shape == (cells, own.config.latent_channels)
        assert np.isfinite(texture.scale).all()
        assert np.isfinite(texture.offset).all()
    for decoder in own.decoders:
        assert tuple(weight.shape for weight in decoder.weights) == own.config.layer_shapes
        assert all(np.isfinite(array).all() for array in (*decoder.weights, *decoder.biases))


def cases(seed: int) -> Iterator[random.Random]:
    """Sources of randomness, one a case, until the time is over."""
    end = time.monotonic() + SECONDS
    for case in range(CASES):
        if time.monotonic() > end:
            return
        yield random.Random(seed * CASES + case)


def test_damaged_bytes(tmp_path: Path, good: bytes) -> None:
    read = 0
    (header,) = struct.unpack("<Q", good[:LENGTH_BYTES])
    for source in cases(1):
        file = bytearray(good)
        for _ in range(source.choice((1, 1, 2, 8, 64))):
            # Most of what can go wrong is in the header, which is the smaller part.
            end = len(file) if source.random() < 0.3 else min(len(file), LENGTH_BYTES + header)
            at = source.randrange(max(1, end))
            match source.randrange(5):
                case 0:
                    file[at : at + 1] = bytes([source.randrange(256)])
                case 1:
                    file[at : at + 1] = bytes([file[at] ^ (1 << source.randrange(8))]) if at < len(file) else b""
                case 2:
                    del file[at : at + source.randrange(1, 16)]
                case 3:
                    file[at:at] = source.randbytes(source.randrange(1, 16))
                case _:
                    other = source.randrange(len(file) + 1)
                    file[at : at + 8] = file[other : other + 8]
        read += check(tmp_path / "a.ntc", bytes(file))
    assert read > 0, "no damage was harmless: the test damages too much to reach the checks behind the header"


def paths_into(document: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where every field of a JSON document lies."""
    items = document.items() if isinstance(document, dict) else enumerate(document)
    for key, value in items:
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from paths_into(value, (*path, key))


def damage_document(document: Any, source: random.Random) -> None:
    """Replace, remove or move one field."""
    path = source.choice(list(paths_into(document)))
    owner = document
    for key in path[:-1]:
        owner = owner[key]
    action = source.randrange(8)
    if action == 0:
        del owner[path[-1]]
        return
    # Copied, because a later damage may lie within a list of `VALUES`, or put that list into itself.
    value = copy.deepcopy(source.choice(VALUES))
    if action == 1 and isinstance(owner, dict):
        owner[source.choice(("x", "", "textures", "weight"))] = value
    elif action == 1:
        owner.append(value)
    else:
        owner[path[-1]] = value


@pytest.mark.parametrize("part", ["metadata", "tensors"])
def test_damaged_fields(tmp_path: Path, good: bytes, part: str) -> None:
    read = 0
    for source in cases(2 if part == "metadata" else 3):
        pieces = PackBytes.of(good)
        document = pieces.metadata if part == "metadata" else pieces.tensors
        for _ in range(source.choice((1, 1, 1, 2, 3))):
            if document:
                damage_document(document, source)
        try:
            text = json.dumps(pieces.metadata)
        except ValueError:
            continue
        read += check(tmp_path / "a.ntc", pieces.file(text))
    assert read > 0 or part == "tensors"


def test_random_bytes(tmp_path: Path) -> None:
    source = random.Random(0)
    for length in (*range(1, 40), 100, 1000):
        assert not check(tmp_path / "a.ntc", source.randbytes(length))
        header = struct.pack("<Q", source.randrange(length + 2))
        assert not check(tmp_path / "a.ntc", header + source.randbytes(length))
