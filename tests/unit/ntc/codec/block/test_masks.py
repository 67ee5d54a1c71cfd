"""Alpha in material sets: sides of a mask's cutoff, coverage of coarse mips, blended alpha."""

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.api import decode, encode, material
from ntc.codec.block.encoding.masks import coverage_offset
from ntc.codec.config import GroupingConfig, GroupingName
from ntc.codec.encoding import BitsTarget
from ntc.codec.maps import CODED_MAPS, MAPS, is_material, map_slices, plane_channels
from ntc.codec.mips import box_resize
from ntc.codec.model import Pack
from ntc.codec.quality import psnr_db
from ntc.codec.registry import codec_of
from ntc.errors import InputError

SIDE = 64
LEVELS = 4


def blades(seed: int) -> NDArray[np.uint8]:
    """[SIDE, SIDE] alpha of thin slanted blades with soft edges."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:SIDE, 0:SIDE].astype(np.float64)
    found = np.zeros((SIDE, SIDE))
    for _ in range(9):
        slope, at = random.uniform(-0.5, 0.5), random.uniform(0, SIDE)
        distance = np.abs((x - at) - slope * (y - SIDE / 2))
        found = np.maximum(found, np.clip(3.0 - distance, 0.0, 1.0) * (y > random.uniform(0, SIDE / 2)))
    return np.asarray(np.rint(255.0 * found), np.uint8)


def colours(seed: int) -> NDArray[np.uint8]:
    noise = np.random.default_rng(seed).normal(128.0, 50.0, (SIDE // 4, SIDE // 4, 3)).astype(np.float32)
    smooth = box_resize(np.repeat(np.repeat(noise, 8, 0), 8, 1), SIDE, SIDE)
    return np.asarray(np.clip(smooth, 0, 255), np.uint8)


def encoded(cutoff: float | None, grouping: GroupingName = "single") -> Pack:
    sets = [material({"base": colours(s), "alpha": blades(s)[..., None]}, f"set {s}", cutoff=cutoff) for s in (1, 2)]
    return encode(sets, target=BitsTarget(4.0), grouping=GroupingConfig(grouping))


@pytest.mark.parametrize(("cutoff", "grouping"), [(0.5, "single"), (0.3, "single"), (0.5, "universal")])
def test_a_mask_keeps_sides_and_coverage(cutoff: float, grouping: GroupingName) -> None:
    pack = encoded(cutoff, grouping)
    for number, seed in enumerate((1, 2)):
        above = blades(seed) >= 255.0 * cutoff
        found = [decode(pack, number, level)[..., -1] >= 255.0 * cutoff for level in range(LEVELS)]
        assert (found[0] != above).mean() < (0.001 if grouping == "single" else 0.02)
        for level in range(1, LEVELS):
            assert found[level].mean() == pytest.approx(above.mean(), abs=0.04), level


def test_blended_alpha_is_a_map_like_others() -> None:
    pack = encoded(None)
    assert psnr_db(decode(pack, 0)[..., -1], blades(1)) > 25.0
    np.testing.assert_allclose(pack.textures[0].mean[:, -1], pack.textures[0].mean[0, -1], atol=2.0 / 255.0)  # type: ignore[attr-defined]


def test_alpha_is_decoded_without_the_other_maps() -> None:
    pack = encoded(0.5)
    for level in range(LEVELS):
        whole = decode(pack, 0, level)[..., -1].astype(np.int64)
        alone = codec_of(pack.config).coverage_image(pack, 0, level)
        assert alone is not None
        assert np.abs(whole - alone).max() <= 1


def test_a_cutoff_falls_where_few_texels_are() -> None:
    values = np.repeat([0.0, 0.25, 0.5, 1.0], [40, 20, 20, 20])
    for share, at_least in ((0.2, 1.0), (0.4, 0.5), (0.43, 0.5), (0.58, 0.25)):
        moved = values + coverage_offset(values, 0.5, share)
        np.testing.assert_array_equal(moved >= 0.5, values >= at_least)
    assert coverage_offset(np.full(9, 0.5), 0.5, 0.4) < 0.0 < coverage_offset(np.full(9, 0.5), 0.5, 0.6)


def test_alpha_is_the_last_map_in_a_plane_of_its_own() -> None:
    assert (*MAPS, "alpha") == CODED_MAPS
    assert map_slices(("base", "normal", "alpha"), 6)["alpha"] == slice(5, 6)
    assert plane_channels(("base", "alpha"), 4) == {"base": {0: 0, 1: 1, 2: 2}, "coverage": {0: 3}}
    assert is_material(("base", "normal"))
    assert not is_material(("base", "alpha"))
    with pytest.raises(InputError, match=r"a cutoff of 0\.5 needs the map alpha"):
        material({"base": colours(1)}, cutoff=0.5)
