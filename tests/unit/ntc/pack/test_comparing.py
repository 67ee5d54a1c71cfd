"""Packs compared with scenes, and with versions of themselves."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc.codec.grid.model import GridDecoder, grid_parts
from ntc.codec.model import Grouping, Pack
from ntc.errors import InputError
from ntc.pack.match import changed_groups, match_pack, require_match
from ntc.training.messages import GroupSnapshot, apply_snapshot

PACK = random_pack(sizes=((4, 4), (8, 8)), groups=(0, 0), hashes=("aa", "bb"))


def test_identity_is_the_hash_and_not_the_name() -> None:
    match = match_pack(
        PACK, [["bb"], ["cc"], ["aa"], ["bb"], ["dd"]], ["new name", "texture 0", "texture 1", "x", "unknown"]
    )
    assert match.texture_index == (1, -1, 0, 1, -1)
    assert match.matched == 3
    assert match.absent == ("texture 0", "unknown")
    assert match.changed == ("texture 0",)
    assert match.line() == "3 of 5 textures match; same name but other pixels: texture 0; not in the pack: unknown"


def test_a_pack_of_another_scene_is_bad_input() -> None:
    match = match_pack(PACK, [["cc"]], ["wall"])
    with pytest.raises(InputError, match=r"^some/other\.ntc: made for another scene than a\.glb: 0 of 1 textures"):
        require_match(replace(PACK, path=Path("some/other.ntc")), match, "a.glb")


def test_a_set_is_found_whole_or_by_its_base_colour() -> None:
    found = match_pack(PACK, [["bb", "aa"], ["xx", "aa"], ["xx", "yy"]], ["whole", "base alone", "unknown"])
    assert found.texture_index == (1, 0, -1)


def other_decoder(decoder: GridDecoder) -> GridDecoder:
    return GridDecoder(tuple(weight + 1.0 for weight in decoder.weights), decoder.biases)


def snapshot(pack: Pack, group: int, members: tuple[int, ...]) -> GroupSnapshot:
    textures = tuple(pack.textures[index] for index in members)
    return GroupSnapshot(1, group, members, textures, other_decoder(grid_parts(pack).decoders[group]))


def test_a_snapshot_changes_its_group_alone() -> None:
    before = random_pack(((16, 16), (16, 16), (8, 8)), (0, 1, 1))
    after = apply_snapshot(before, snapshot(before, 1, (1, 2)))
    assert changed_groups(before, after) == {1}
    assert changed_groups(before, apply_snapshot(after, snapshot(before, 0, (0,)))) == {0, 1}
    assert changed_groups(after, replace(after, path=None)) == frozenset()


def test_latents_and_adapters_count_as_much_as_decoders() -> None:
    before = random_pack(((16, 16), (16, 16), (8, 8)), (0, 1, 1))
    first = grid_parts(before).textures[0]
    other = replace(first, latents=first.latents ^ np.uint8(1))
    assert changed_groups(before, replace(before, textures=(other, *before.textures[1:]))) == {0}
    equal = replace(first, latents=first.latents.copy())
    assert changed_groups(before, replace(before, textures=(equal, *before.textures[1:]))) == frozenset()


def test_textures_that_change_groups_count_where_they_decode_otherwise() -> None:
    before = random_pack(((16, 16), (16, 16), (8, 8)), (0, 1, 1))
    moved = apply_snapshot(before, snapshot(before, 1, (1,)))
    assert moved.grouping.groups != before.grouping.groups
    assert changed_groups(before, moved) == {moved.textures[1].group}
    renamed = replace(before, grouping=Grouping("single", before.grouping.groups))
    assert changed_groups(before, renamed) == frozenset()
