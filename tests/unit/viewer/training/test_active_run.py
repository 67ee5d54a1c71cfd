"""The run under way: which groups a snapshot has changed."""

from dataclasses import replace

from lab.bench.random_pack import random_pack
from ntc.codec.model import Decoder, Grouping, Pack
from ntc.training.snapshot import GroupSnapshot, apply_snapshot
from viewer.training.active_run import changed_groups


def other_decoder(decoder: Decoder) -> Decoder:
    return Decoder(tuple(weight + 1.0 for weight in decoder.weights), decoder.biases)


def snapshot(pack: Pack, group: int, members: tuple[int, ...]) -> GroupSnapshot:
    textures = tuple(pack.textures[index] for index in members)
    return GroupSnapshot(1, group, members, textures, other_decoder(pack.grid_decoders[group]))


def test_a_snapshot_changes_its_group_alone() -> None:
    before = random_pack(((16, 16), (16, 16), (8, 8)), (0, 1, 1))
    after = apply_snapshot(before, snapshot(before, 1, (1, 2)))
    assert changed_groups(before, after) == {1}
    assert changed_groups(before, apply_snapshot(after, snapshot(before, 0, (0,)))) == {0, 1}
    assert changed_groups(after, replace(after, path=None)) == frozenset()


def test_all_groups_change_with_the_grouping_and_for_the_first_time() -> None:
    before = random_pack(((16, 16), (16, 16), (8, 8)), (0, 1, 1))
    assert changed_groups(None, before) == {0, 1}
    moved = apply_snapshot(before, snapshot(before, 1, (1,)))
    assert moved.grouping.groups != before.grouping.groups
    assert changed_groups(before, moved) == set(range(len(moved.decoders)))
    renamed = replace(before, grouping=Grouping("single", before.grouping.groups))
    assert changed_groups(before, renamed) == frozenset()
