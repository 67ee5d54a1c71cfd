"""Packs in which groups are replaced one by one."""

from dataclasses import replace

import numpy as np
import pytest

from ntc.codec.grid.model import GridConfig, grid_parts
from ntc.codec.grid.tensors import grey_pack
from ntc.codec.grid.training.config import TrainingConfig
from ntc.codec.model import Grouping, Pack
from ntc.codec.reference import decode_image
from ntc.errors import InputError
from ntc.training.encode import encode_textures
from ntc.training.messages import GroupSnapshot, apply_snapshot, ended_pack, moved_texture
from tests.support.textures import texture

CODECS = [
    GridConfig(hidden_width=16),
    GridConfig(hidden_width=16, latent_channels=8, latent_bits=4, adapters=True, adapter_output=True),
]
TEXTURES = [texture(16, 16), texture(12, 8, seed=1), texture(9, 5, seed=2), texture(8, 8, 1, seed=3)]


def snapshot_of(pack: Pack, group: int) -> GroupSnapshot:
    """Of a group of a pack."""
    members = tuple(index for index, number in enumerate(pack.grouping.groups) if number == group)
    return GroupSnapshot(
        1, group, members, tuple(pack.textures[i] for i in members), grid_parts(pack).decoders[group], final=True
    )


def trained(groups: tuple[int, ...], seed: int = 0, codec: GridConfig = CODECS[1]) -> Pack:
    """A pack of some quality."""
    training = TrainingConfig(steps=12, texels_per_texture=64, device="cpu", seed=seed)
    return encode_textures(TEXTURES, Grouping("random", groups), codec, training)


@pytest.mark.parametrize("codec", CODECS)
def test_grey_is_grey_and_makes_room_for_every_group(codec: GridConfig) -> None:
    pack = grey_pack(TEXTURES, Grouping("random", (1, 0, 1, 2)), codec)
    for index, source in enumerate(TEXTURES):
        image = decode_image(pack, index)
        assert image.shape == source.pixels.shape
        assert (image == 128).all()
    made = trained((1, 0, 1, 2), codec=codec)
    for group in (2, 0, 1):
        pack = apply_snapshot(pack, snapshot_of(made, group))
        assert pack.grouping == made.grouping
        for index in snapshot_of(made, group).members:
            np.testing.assert_array_equal(decode_image(pack, index), decode_image(made, index))
    ended = ended_pack(pack, made.grouping)
    assert ended.grouping == made.grouping
    assert all(own is other for own, other in zip(ended.decoders, made.decoders, strict=True))


def test_groups_made_anew_come_one_by_one_and_every_picture_on_the_way_is_whole() -> None:
    old, new = trained((0, 0, 1, 1)), trained((0, 1, 1, 0), seed=1)
    pack = apply_snapshot(old, snapshot_of(new, 1))
    for index, source in ((0, old), (3, old), (1, new), (2, new)):
        np.testing.assert_array_equal(decode_image(pack, index), decode_image(source, index))
    with pytest.raises(ValueError, match="not all groups"):
        ended_pack(pack, new.grouping)
    ended = ended_pack(apply_snapshot(pack, snapshot_of(new, 0)), new.grouping)
    assert [t.group for t in ended.textures] == [0, 1, 1, 0]
    for index in range(4):
        np.testing.assert_array_equal(decode_image(ended, index), decode_image(new, index))


def test_a_snapshot_of_other_textures_is_refused() -> None:
    pack = trained((0, 0, 1, 1))
    snapshot = snapshot_of(pack, 0)
    for members in ((0, 4), (0, -1), (0, 2)):
        with pytest.raises(ValueError, match="is not the one of the pack"):
            apply_snapshot(pack, replace(snapshot, members=members))


def test_moving_a_texture() -> None:
    grouping = Grouping("random", (0, 0, 1, 2))
    assert moved_texture(grouping, 0, 2).groups == (2, 0, 1, 2)
    assert moved_texture(grouping, 0, 3).groups == (3, 0, 1, 2)
    assert moved_texture(grouping, 2, 0).groups == (0, 0, 0, 1)
    for texture_index, group in ((4, 0), (-1, 0), (0, 4), (0, -1)):
        with pytest.raises(InputError, match="there are 4 textures and 3 groups"):
            moved_texture(grouping, texture_index, group)
