"""Comparing packs, and checking those that no file has held yet."""

import math
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import deserialize

from ntc.codec.model import Pack
from ntc.pack.file import checked_pack, pack_bytes
from ntc.pack.schema import metadata_json, parse_metadata


def assert_same(one: Any, other: Any, name: str = "") -> None:
    """The same types and values, dataclasses field by field and arrays bit by bit. An infinite PSNR of `one` is unknown in `other`,
    as files have none."""
    if "psnr_db" in name and isinstance(one, float) and math.isinf(one):
        one = None
    assert type(one) is type(other), name
    if isinstance(one, np.ndarray):
        assert (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes()), name
    elif isinstance(one, tuple):
        assert len(one) == len(other), name
        for number, (part, twin) in enumerate(zip(one, other, strict=True)):
            assert_same(part, twin, f"{name}[{number}]")
    elif is_dataclass(one):
        for field in fields(one):
            assert_same(getattr(one, field.name), getattr(other, field.name), f"{name}.{field.name}")
    else:
        assert one == other, name


def assert_equal(one: Pack, other: Pack) -> None:
    """Every field but `path` is the same, arrays bit by bit."""
    assert (one.config, one.grouping, one.training) == (other.config, other.grouping, other.training)
    assert_same(one.textures, other.textures, "textures")
    assert_same(one.decoders, other.decoders, "decoders")


def check_pack(pack: Pack) -> Pack:
    """`pack` as its file holds it, which is the same. Raises InputError for what no file may hold."""
    metadata = parse_metadata(metadata_json(pack))
    read = checked_pack(dict(deserialize(pack_bytes(pack))), metadata, Path("pack in memory"))
    assert_equal(pack, read)
    return read
