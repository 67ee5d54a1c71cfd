"""Sizes and places of latent levels."""

import pytest

from ntc.codec.grid.model import GridConfig
from ntc.codec.latents import latent_cell_count, latent_levels

SIZES = [(1024, 1024), (1024, 256), (17, 33), (200, 3), (1, 1), (2, 5000), (16, 16), (20, 20)]


def test_a_1024_texture_starts_at_256_cells_and_ends_at_4() -> None:
    levels = latent_levels(1024, 1024, GridConfig())
    assert [(level.width, level.height) for level in levels] == [(256 >> n, 256 >> n) for n in range(7)]
    assert [(level.texel_width, level.texel_height) for level in levels] == [(1024 >> n, 1024 >> n) for n in range(7)]


def test_a_non_square_texture_ends_when_its_longer_side_is_small() -> None:
    levels = latent_levels(1024, 64, GridConfig())
    assert [(level.width, level.height) for level in levels] == [
        (256, 16), (128, 8), (64, 4), (32, 2), (16, 1), (8, 1), (4, 1),
    ]  # fmt: skip
    assert levels[-1].texel_height == 1


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("limit", [None, 1, 3])
@pytest.mark.parametrize("downscale", [1, 3, 4])
def test_levels_follow_one_another_and_cover_their_mips(
    size: tuple[int, int], limit: int | None, downscale: int
) -> None:
    config = GridConfig(levels=limit, downscale=downscale)
    levels = latent_levels(*size, config)
    assert 1 <= len(levels) <= (limit or 99)
    first = 0
    for number, level in enumerate(levels):
        assert level.first_cell == first
        assert (level.texel_width, level.texel_height) == (max(1, size[0] >> number), max(1, size[1] >> number))
        assert level.texel_width <= level.width * downscale < level.texel_width + downscale
        assert level.texel_height <= level.height * downscale < level.texel_height + downscale
        assert (max(level.width, level.height) <= 4) == (number == len(levels) - 1) or limit is not None
        first += level.cells
    assert latent_cell_count(*size, config) == first


def test_one_level_only_when_asked_for_paper_parity() -> None:
    assert len(latent_levels(4096, 4096, GridConfig(levels=1))) == 1
