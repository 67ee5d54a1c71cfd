"""Packs of format 1 of codec `block`, written by the program before format 2: they decode to the same pictures."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from ntc.codec import reference
from ntc.codec.block_1.gpu import BlockTables
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from ntc.pack.file import read_pack, write_pack
from tests.support.pack_bytes import PackBytes

FOLDER = Path(__file__).with_name("format_1")
PICTURES = {
    "colours": ["9d290c38684f1609", "a972d1121bfde402", "305f95fd19358a67", "68d1130f0fe8b1b8"],
    "sets": ["f1e553ded6f7c25f", "36b43883d76c3ac7", "95d5fd8190aaa621", "1ef54116bd39e8d0"],
}
"""Hashes of mips 0 and 1 of both textures, as that program decoded them."""


@pytest.mark.parametrize("name", PICTURES)
def test_old_packs_decode_to_the_same_pictures(name: str) -> None:
    pack = read_pack(FOLDER / f"{name}.ntc")
    found = []
    for texture in range(2):
        for level in range(2):
            decoded = reference.decode_image(pack, texture, level)
            found.append(hashlib.sha256(decoded.tobytes()).hexdigest()[:16])
            fast = codec_of(pack.config).torch_twin(pack, "cpu").decode_image(texture, level)
            assert np.abs(decoded.astype(int) - fast).max() <= 1
    assert found == PICTURES[name]


def test_old_packs_are_written_as_they_were(tmp_path: Path) -> None:
    path = FOLDER / "sets.ntc"
    write_pack(tmp_path / "again.ntc", read_pack(path))
    assert (tmp_path / "again.ntc").read_bytes() == path.read_bytes()


def test_a_pack_names_its_format_by_a_field_alone(tmp_path: Path) -> None:
    parts = PackBytes.of((FOLDER / "colours.ntc").read_bytes())
    named = tmp_path / "named.ntc"
    named.write_bytes(parts.changed(lambda p: p.metadata["codec"].update(kind="block-1")))
    with pytest.raises(InputError, match="kind"):
        read_pack(named)
    assert json.loads(json.dumps(parts.metadata))["codec"]["kind"] == "block"


def test_entries_without_bits_belong_to_no_plane() -> None:
    """Otherwise every pixel of base colour would load rows of the basis for them."""
    pack = read_pack(FOLDER / "sets.ntc")
    tables = codec_of(pack.config).gpu_tables(pack.config)
    assert isinstance(tables, BlockTables)
    entries = np.frombuffer(tables.decoder_data(pack.decoders[0]), "<u4")[: 4 * tables.basis]
    without = entries & 7 == 0
    assert without.any()
    assert set(((entries[without] >> 5) & 3).tolist()) == {3}
    assert (((entries[~without] >> 5) & 3) < 3).all()
