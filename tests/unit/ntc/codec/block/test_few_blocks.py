"""Codec `block` where there is little to learn from: few blocks, few modes, textures of one colour, masks of one side."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.api import decode, encode, material
from ntc.codec.block.encoding.quantizer import best_modes, expected_errors
from ntc.codec.config import GroupingConfig, GroupingName
from ntc.codec.encoding import PRESETS, BitsTarget, QualityTarget, SizeTarget, Target
from ntc.codec.latents import texture_levels
from ntc.codec.maps import MapName
from ntc.codec.textures import SourceTexture
from ntc.pack.file import write_pack

CUTOFF = 0.5
TARGETS: Sequence[Target | None] = (
    None,
    BitsTarget(0.3),
    BitsTarget(1.0),
    BitsTarget(8.0),
    BitsTarget(20.0),
    QualityTarget(30.0),
    QualityTarget(55.0),
    SizeTarget(0.03),
    PRESETS["fast"],
)


def disc(width: int, height: int) -> NDArray[np.uint8]:
    """[height, width] alpha that crosses few of the blocks."""
    y, x = np.mgrid[0:height, 0:width]
    inside = np.hypot((x + 0.5) / width - 0.5, (y + 0.5) / height - 0.5) < 0.4
    return np.where(inside, 255, 0).astype(np.uint8)


def alpha(kind: str, width: int, height: int) -> NDArray[np.uint8] | None:
    """[height, width] alpha; None: the material has none."""
    random = np.random.default_rng(1)
    found = {
        "disc": disc(width, height),
        "all": np.full((height, width), 255),
        "nothing": np.zeros((height, width)),
        "a hole": np.full((height, width), 255),
        "a dot": np.zeros((height, width)),
        "noise": random.integers(0, 256, (height, width)),
        "beside the cutoff": random.integers(127, 129, (height, width)),
    }
    found["a hole"][0, 0], found["a dot"][-1, -1] = 0, 255
    return found[kind].astype(np.uint8) if kind in found else None


def small_material(
    width: int, height: int, alpha_kind: str, is_flat: bool = True, has_normals: bool = False
) -> SourceTexture:
    random = np.random.default_rng(2)
    colours = np.full((height, width, 3), (200, 60, 40)) if is_flat else random.integers(0, 256, (height, width, 3))
    maps: dict[MapName, NDArray[np.uint8]] = {"base": colours.astype(np.uint8)}
    if has_normals:
        maps["normal"] = random.integers(100, 156, (height, width, 2)).astype(np.uint8)
    coverage = alpha(alpha_kind, width, height)
    if coverage is None:
        return material(maps)
    return material({**maps, "alpha": coverage[..., None]}, cutoff=CUTOFF)


@pytest.mark.parametrize("target", TARGETS, ids=str)
def test_a_cutout_that_crosses_few_blocks_is_encoded_alike_each_time(target: Target | None, tmp_path: Path) -> None:
    """Of 8 modes, one is for blocks at the mask's edge."""
    source = small_material(128, 128, "disc")
    pack = encode([source], target=target)
    for name, each in (("first", pack), ("second", encode([source], target=target))):
        write_pack(tmp_path / name, each)
    assert (tmp_path / "first").read_bytes() == (tmp_path / "second").read_bytes()
    shown = decode(pack, 0)
    assert ((shown[..., 3] >= 255 * CUTOFF) != (source.pixels[..., 3] >= 255 * CUTOFF)).mean() < 0.03
    assert np.abs(shown[..., :3].astype(int) - source.pixels[..., :3]).max() <= 2


@pytest.mark.parametrize("size", [(1, 1), (64, 1), (5, 3), (8, 8), (40, 24)], ids=str)
@pytest.mark.parametrize("grouping", ["single", "universal"])
def test_materials_of_few_blocks_are_encoded(size: tuple[int, int], grouping: GroupingName) -> None:
    for number, kind in enumerate(("none", "disc", "all", "nothing", "a hole", "a dot", "noise", "beside the cutoff")):
        is_flat, target = number % 3 == 0, TARGETS[number // 2 % 2]
        source = small_material(*size, kind, is_flat, has_normals=number % 2 == 0)
        pack = encode([source], target=target, grouping=GroupingConfig(grouping))
        for level in range(len(texture_levels(pack.textures[0], pack.config))):
            assert decode(pack, 0, level).shape[2] == source.channels


@pytest.mark.parametrize("modes", [1, 2, 3])
def test_a_block_takes_the_better_one_of_the_modes_there_are(modes: int) -> None:
    values = np.random.default_rng(3).normal(0.0, 1.0, (50, 6)).astype(np.float32)
    depths = np.array([[2] * 6, [6] * 6, [0] * 6])[:modes]
    scales = np.ones((modes, 6), np.float32)
    chosen = best_modes(values, expected_errors(values, depths[None], scales)[:, 0], depths, scales)
    assert chosen.tolist() == [min(modes - 1, 1)] * 50
