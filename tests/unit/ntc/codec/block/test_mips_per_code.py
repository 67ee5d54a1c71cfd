"""Textures with fewer mips per code than the codec's settings say, where derived mips are poor."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.api import decode, encode, texture
from ntc.codec.block.encoding.groups import encode_member, fitted_groups
from ntc.codec.config import GroupingConfig
from ntc.codec.encoding import BitsTarget
from ntc.codec.latents import texture_levels
from ntc.codec.mips import mip_chain
from ntc.codec.model import Grouping, Pack
from ntc.codec.quality import psnr_db
from ntc.errors import MetadataError
from ntc.pack.file import read_pack, write_pack
from ntc.pack.match import same_shape
from ntc.pack.schema import metadata_json, parse_metadata

SIDE = 64


def bars(side: int = SIDE) -> NDArray[np.uint8]:
    """[side, side, 3] strong soft bars beside plain grey: averages of their values are far darker than their light."""
    y, x = np.mgrid[0:side, 0:side].astype(np.float64)
    shown = 128.0 + 126.0 * np.sin(x * 0.8) * (y > side / 2)
    return np.asarray(np.rint(np.stack([shown, shown * 0.9, shown * 0.8], axis=-1)), np.uint8)


def waves(side: int = SIDE) -> NDArray[np.uint8]:
    y, x = np.mgrid[0:side, 0:side]
    shown = 128 + 40 * np.sin(x / 9.0) * np.cos(y / 7.0)
    return np.asarray(np.stack([shown, shown + 20, shown - 10], axis=-1), np.uint8)


@pytest.fixture(scope="module")
def pack() -> Pack:
    own = [texture(bars(), "bars"), texture(waves(), "waves")]
    return encode(own, target=BitsTarget(6.0), grouping=GroupingConfig("baseline"))


def quality(pack: Pack, number: int, pixels: NDArray[np.uint8]) -> list[float]:
    return [
        psnr_db(decode(pack, number, mip, "numpy"), truth) for mip, truth in enumerate(mip_chain(pixels, "srgb")[:4])
    ]


def test_a_texture_with_poor_derived_mips_has_codes_of_its_own_there(pack: Pack) -> None:
    assert [own.code_mips for own in pack.textures] == [2, None]
    levels = [texture_levels(own, pack.config) for own in pack.textures]
    assert [[level.mip_of_cell for level in own] for own in levels] == [[0, 1, 0, 1], [0, 1, 2, 3]]
    source = texture(bars(), "bars")
    (fitted,) = fitted_groups([source], Grouping("single", (0,)), (0,), pack.config, 0)  # type: ignore[arg-type]
    shared = encode_member(source, 6.0, fitted, pack.config, lambda _: None, may_split_mips=False)  # type: ignore[arg-type]
    alone = encode_member(source, 6.0, fitted, pack.config, lambda _: None)  # type: ignore[arg-type]
    assert (shared.code_mips, alone.code_mips) == (None, 2)
    assert len(alone.words) <= 1.05 * len(shared.words)
    before, after = (
        quality(Pack(pack.config, Grouping("single", (0,)), (own,), (fitted.decoder,)), 0, bars())
        for own in (shared, alone)
    )
    assert after[3] > before[3] + 6.0
    assert np.mean(np.minimum(after, 50.0)) > np.mean(np.minimum(before, 50.0)) + 1.0


def test_a_file_says_how_many_mips_a_code_has(tmp_path: Path, pack: Pack) -> None:
    write_pack(tmp_path / "a.ntc", pack)
    found = read_pack(tmp_path / "a.ntc")
    assert [own.code_mips for own in found.textures] == [2, None]
    assert same_shape(pack, found)
    other = replace(pack, textures=(replace(pack.textures[0], code_mips=None), pack.textures[1]))
    assert not same_shape(pack, other)
    np.testing.assert_array_equal(decode(found, 0, 3, "numpy"), decode(pack, 0, 3, "numpy"))
    document = json.loads(metadata_json(pack))
    assert [own.get("code_mips") for own in document["textures"]] == [2, None]
    for wrong in (0, 3, 4, "2"):
        document["textures"][0]["code_mips"] = wrong
        with pytest.raises(MetadataError, match="code_mips"):
            parse_metadata(json.dumps(document))
    document["codec"]["mips"], document["textures"][0]["code_mips"] = 2, 2
    with pytest.raises(MetadataError, match="the codec has 2 mips per code"):
        parse_metadata(json.dumps(document))
