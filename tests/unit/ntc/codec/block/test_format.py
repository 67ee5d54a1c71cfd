"""Packs of format 1 of codec `block` are refused by name, in Python and in C."""

from pathlib import Path

import pytest

from ntc.errors import InputError
from ntc.pack.file import read_pack
from tests.conformance.native import opened
from tests.support.pack_bytes import PackBytes

PACK = Path("tests/conformance/packs/block-textures.ntc")
UNSUPPORTED = 3


def in_format_1() -> bytes:
    """A pack whose settings have the fields of format 1: neither `format` nor `mips`."""

    def change(parts: PackBytes) -> None:
        for field in ("format", "mips"):
            del parts.metadata["codec"][field]

    return PackBytes.of(PACK.read_bytes()).changed(change)


def test_a_pack_of_format_1_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "old.ntc"
    path.write_bytes(in_format_1())
    with pytest.raises(InputError) as refused:
        read_pack(path)
    assert str(refused.value) == f"{path}: format 1 of codec block, no longer read: encode again with this version"


def test_libntc_refuses_it_by_name() -> None:
    assert opened(in_format_1())[:2] == (UNSUPPORTED, "codec block has format 1")
