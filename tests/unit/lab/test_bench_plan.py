"""What benchmarks do in which order, how pictures are cut, what is on a Pareto front: no graphics."""

import numpy as np
import pytest

from lab.bench.tables import SCENE_COLUMNS, pareto_front, path_to_take
from lab.bench.tiles import PictureLimits, require_memory, tiling
from ntc.errors import InputError
from viewer.scene.text_table import Cell, Table


def test_the_pareto_front() -> None:
    points = [(1.0, 10.0), (2.0, 20.0), (2.0, 15.0), (3.0, 20.0), (0.5, 10.0), (4.0, 21.0), (4.0, 21.0)]
    assert pareto_front(points) == (False, True, False, False, True, True, True)
    assert pareto_front([]) == ()
    random = np.random.default_rng(3)
    cloud = [(float(x), float(y)) for x, y in random.integers(0, 12, (60, 2))]
    front = sorted({point for point, kept in zip(cloud, pareto_front(cloud), strict=True) if kept})
    assert [worth for _, worth in front] == sorted({worth for _, worth in front})
    for cost, worth in cloud:
        assert any(kept_cost <= cost and kept_worth >= worth for kept_cost, kept_worth in front)


def test_the_path_to_take_is_the_fastest_that_shows_no_loss() -> None:
    def row(path: str, decode_ms: float, psnr_db: float | None, source: str = "clustered") -> dict[str, Cell]:
        return {"source": source, "path": path, "precision": "fp32", "decode_ms": decode_ms, "psnr_db": psnr_db}

    rows = [row("", 1.0, None, "reference"), row("", 0.5, 30.0, "bc7"), row("deferred", 9.0, 36.0)]
    rows += [row("cached", 2.0, 35.95), row("forward", 1.0, 35.0), row("binned", 3.0, 20.0, "single")]
    assert path_to_take(Table(SCENE_COLUMNS, rows)).splitlines() == [
        "clustered: take --path cached in fp32: 2.0 ms, 35.95 dB",
        "single: take --path binned in fp32: 3.0 ms, 20.00 dB",
    ]


@pytest.mark.parametrize("size", [(8192, 8192), (20000, 16), (100, 9000), (4097, 4097)])
@pytest.mark.parametrize(
    "limits", [PictureLimits(4096, 1 << 40), PictureLimits(16384, 1 << 24), PictureLimits(64, 1 << 20)]
)
def test_tiles_cover_the_picture_within_the_limits(size: tuple[int, int], limits: PictureLimits) -> None:
    cut = tiling(size, 40, limits)
    assert max(cut.tile) <= limits.side
    assert cut.tile[0] * cut.tile[1] * 40 <= limits.memory_bytes
    columns, rows = (-(-side // tile) for side, tile in zip(size, cut.tile, strict=True))
    assert cut.count == columns * rows
    assert size[0] * size[1] <= cut.pixels
    for side, tile in zip(size, cut.tile, strict=True):
        assert tile == side or tile % 8 == 0


def test_no_room_at_all_is_said() -> None:
    with pytest.raises(InputError, match="--memory-mb 0: not even 8x8 pixels fit"):
        tiling((512, 512), 40, PictureLimits(4096, 2000))
    with pytest.raises(InputError, match="--size 9000x10: this renderer's textures have at most 4096"):
        require_memory("--size", (9000, 10), 40, PictureLimits(4096, 1 << 40))
    with pytest.raises(InputError, match="--size 1024x1024: takes 40 MiB, more than --memory-mb 16"):
        require_memory("--size", (1024, 1024), 40, PictureLimits(4096, 16 << 20))
    require_memory("--size", (1024, 1024), 40, PictureLimits(1024, 40 << 20))
