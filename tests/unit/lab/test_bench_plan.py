"""What benchmarks do in which order, how pictures are cut, what is on a Pareto front: no graphics."""

import itertools

import numpy as np
import pytest

from lab.bench.fixture import block_words, interleaved_words, scattered_words
from lab.bench.random_pack import square_pack
from lab.bench.scaling import ScalingConfig
from lab.bench.scene import SceneBenchConfig, bench_slots, interleaved
from lab.bench.tables import pareto_front
from lab.bench.tiles import PictureLimits, require_memory, tiling
from ntc.errors import InputError
from viewer.scene.model import Camera
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


def test_patterns_of_textures() -> None:
    size = (40, 24)
    seen = {
        name: (words(size, 100)[..., 0] & 0xFFFF).astype(int) - 1
        for name, words in (("same", interleaved_words), ("all", scattered_words), ("block", block_words))
    }
    blocks = {name: texture.reshape(3, 8, 5, 8).transpose(0, 2, 1, 3).reshape(15, 64) for name, texture in seen.items()}
    assert all((block == blocks["same"][0]).all() for block in blocks["same"])
    assert len(set(blocks["same"][0].tolist())) == 64
    assert set(seen["all"].ravel().tolist()) == set(range(100))
    assert all(len(set(block.tolist())) == 64 for block in blocks["all"])
    assert [set(block.tolist()) for block in blocks["block"]] == [{number} for number in range(15)]


def test_square_packs_share_decoders_evenly() -> None:
    pack = square_pack(7, 3, 8, ScalingConfig().codec)
    assert [texture.group for texture in pack.textures] == [0, 1, 2, 0, 1, 2, 0]
    assert len(pack.decoders) == 3
