"""What benchmarks do in which order, how pictures are cut, what is on a Pareto front: no graphics."""

import itertools

import numpy as np
import pytest

from lab.bench.fixture import interleaved_words
from lab.bench.random_pack import square_pack
from lab.bench.scene import SceneBenchConfig, bench_slots, interleaved
from lab.bench.tables import SCENE_COLUMNS, pareto_front, path_to_take
from lab.bench.tiles import PictureLimits, require_memory, tiling
from ntc.codec.grid.model import GridConfig
from ntc.errors import InputError
from viewer.scene.model import Camera
from viewer.scene.text_table import Cell, Table
from viewer.state.view_state import REFERENCE, Slot

CAMERA = Camera("c", (0.0, 1.0, 4.0), (0.0, 0.0, 0.0))
ROOMY = PictureLimits(16384, 1 << 40)


@pytest.mark.parametrize("count", [1, 2, 7, 8, 9, 14, 37])
def test_slots_take_turns_and_nothing_is_seen_twice_in_a_row(count: int) -> None:
    slots = [Slot(f"pack {number}") for number in range(count)]
    frames = interleaved(slots, CAMERA, 5)
    assert [slot for _, slot, _ in frames] == slots * 5
    assert [number for number, _, _ in frames] == [number for number in range(5) for _ in slots]
    cameras = [camera for _, _, camera in frames]
    assert all(a != b for a, b in itertools.pairwise(cameras))
    for slot in slots:
        own = [camera for _, of, camera in frames if of == slot]
        assert all(a != b for a, b in itertools.pairwise(own))
    assert CAMERA not in cameras


def test_every_pack_path_and_precision_is_a_slot_and_the_plain_one_comes_first() -> None:
    slots = bench_slots(["a", "b"], SceneBenchConfig())
    config = SceneBenchConfig()
    assert slots[0] == Slot(REFERENCE)
    assert slots[1] == Slot("a", "deferred", "fp32")
    assert len(set(slots)) == len(slots) == 1 + 2 * len(config.paths) * len(config.precisions)


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


def test_pictures_that_fit_are_not_cut() -> None:
    cut = tiling((1001, 999), 36, ROOMY)
    assert (cut.tile, cut.count, cut.pixels) == ((1001, 999), 1, 1001 * 999)


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


def test_pixels_take_the_textures_in_turn_the_same_in_every_block() -> None:
    seen = (interleaved_words((40, 24), 100)[..., 0] & 0xFFFF).astype(int) - 1
    blocks = seen.reshape(3, 8, 5, 8).transpose(0, 2, 1, 3).reshape(15, 64)
    assert (blocks == blocks[0]).all()
    assert len(set(blocks[0].tolist())) == 64


def test_square_packs_share_decoders_evenly() -> None:
    pack = square_pack(7, 3, 8, GridConfig())
    assert [texture.group for texture in pack.textures] == [0, 1, 2, 0, 1, 2, 0]
    assert len(pack.decoders) == 3
