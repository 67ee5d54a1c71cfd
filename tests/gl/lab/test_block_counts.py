"""Vector instructions of codec `block` on GPUs: bounds that may only fall, and trip counts of small packs."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lab.bench.random_pack import random_block_pack, random_pack
from lab.benchmarks.shaders.block_counts import (
    MOST_SQUARES,
    PLANE_FOURS,
    PLANES_FOURS,
    SLOTS,
    TILE_FOURS,
    TILE_SLOTS,
    TOGETHER,
    PackCodes,
    counted_programs,
    joint_trips,
    pixel_group,
    random_tile,
    rows,
    shader_number,
    trips_of_rounds,
)
from lab.benchmarks.shaders.compiling import GPUS, find_compiler
from ntc.codec.block.config import BlockConfig
from ntc.codec.maps import MAPS
from ntc.errors import InputError
from viewer.gl.context import GraphicsContext

pytestmark = pytest.mark.once

BOUNDS = Path(__file__).with_name("block_bounds.json")
"""Vector instructions by GPU, variant, path and lod. Write lower ones here when shaders become faster."""
SLACK = 1.05
"""Compilers of other versions of Mesa differ a little."""
CONFIG = BlockConfig(block_words=(2, 4), mean_words=3.0, modes=16, coefficients=60)


@pytest.fixture(scope="module")
def codes() -> PackCodes:
    """Codes of a pack that is the same everywhere."""
    return PackCodes(random_block_pack([(64, 64), (128, 64)], (0, 1), CONFIG))


@pytest.mark.parametrize("gpu", GPUS)
def test_one_pass_for_all_planes_stays_within_its_bounds(graphics: GraphicsContext, gpu: str) -> None:
    try:
        find_compiler(gpu)
    except InputError as error:
        pytest.skip(str(error))
    sets = BlockConfig(block_words=(3, 8), mean_words=4.0, modes=16, coefficients=88, output_channels=11, maps=MAPS)
    codes = PackCodes(random_block_pack([(64, 64), (128, 64)], (0, 1), sets))
    found = {
        f"{row['path']}, lod {row['lod']:g}": row
        for row in rows(gpu, "random", codes, graphics)
        if row["path"].startswith("deferred")
    }
    bounds = json.loads(BOUNDS.read_text())[gpu]["planes"]
    assert found.keys() == bounds.keys()
    assert not {
        name: (row["all planes"], bounds[name])
        for name, row in found.items()
        if row["all planes"] > SLACK * bounds[name]
    }


@pytest.mark.parametrize("together", [0, 1])
@pytest.mark.parametrize("gpu", GPUS)
def test_instructions_stay_within_their_bounds(
    graphics: GraphicsContext, codes: PackCodes, gpu: str, together: int
) -> None:
    try:
        find_compiler(gpu)
    except InputError as error:
        pytest.skip(str(error))
    found: dict[str, Any] = {
        f"{row['path']}, lod {row['lod']:g}": row["base"] for row in rows(gpu, "random", codes, graphics, together)
    }
    bounds = json.loads(BOUNDS.read_text())[gpu]["together" if together else "alone"]
    assert found.keys() == bounds.keys()
    assert not {name: (count, bounds[name]) for name, count in found.items() if count > SLACK * bounds[name]}


def test_a_group_reads_each_square_and_each_code_once(codes: PackCodes) -> None:
    group = pixel_group(codes, 0, -8.0, False, np.random.default_rng(0))
    # Magnified so much, all pixels read the same few squares of one mip.
    assert len(group.fours) <= 4
    assert group.lists.shape[1] == TOGETHER
    wide = pixel_group(codes, 0, 0.5, False, np.random.default_rng(0))
    assert TOGETHER // 2 < len(wide.fours) < 2 * TOGETHER
    assert wide.coefficients >= 4 * wide.most_fours


def test_planes_of_one_pass_share_the_finding_of_codes(codes: PackCodes) -> None:
    group = pixel_group(codes, 0, 0.5, False, np.random.default_rng(0))
    rounds = group.work_rounds(PLANES_FOURS)
    assert group.work_rounds(1) > rounds
    sets, planes, *joint = joint_trips([group, group, group], TOGETHER, False)
    assert (sets, planes) == (1.0, 3.0)
    single = trips_of_rounds(group, TOGETHER, False, rounds)
    # Rounds; finding mips, corners and probes; fours; listing; decoding.
    saved = 2.0 * (rounds == 1)
    finding = [1, 2, 3, 5]
    assert joint == pytest.approx(
        [own * (3.0 - saved / rounds) if place in finding else 3.0 * own for place, own in enumerate(single)]
    )


def test_a_tile_has_a_border_of_codes(codes: PackCodes) -> None:
    tile = random_tile(codes, 0, np.random.default_rng(0))
    # On the right and below.
    assert tile.page.shape == (5, 5)
    assert (tile.squares, tile.strips) == (16, 4)
    # The order of a list has the same coefficients, and at most four words that are not full.
    assert (tile.fours.sum(axis=1) >= tile.lists - 1).all()
    assert (tile.fours.sum(axis=1) <= tile.lists + 4).all()


def test_room_in_shared_memory_is_that_of_the_programs(graphics: GraphicsContext, codes: PackCodes) -> None:
    texts = {own.path: own.program.texts[0] for own in counted_programs(graphics, codes, 1)}
    pixels, tile = texts["deferred"], texts["cached, a texel of a tile"]
    assert f"#define SLOT_BITS {SLOTS.bit_length() - 1}\n" in pixels
    assert f"const int MOST_SQUARES = {MOST_SQUARES};\n" in pixels
    assert f"#define PLANE_FOURS {PLANE_FOURS}\n" in pixels
    assert f"#define PLANES_FOURS {PLANES_FOURS}\n" in pixels
    assert f"#define SLOTS {TILE_SLOTS}\n" in tile
    assert f"#define USUAL_FOURS {TILE_FOURS}\n" in tile
    assert all(f"const int TOGETHER = {TOGETHER};\n" in text for text in (pixels, tile))
    with pytest.raises(ValueError, match="defines NOTHING 0 times"):
        shader_number("ntc/block_pixels.glsl", "NOTHING")


def test_other_codecs_are_refused() -> None:
    with pytest.raises(InputError, match="codec block alone"):
        PackCodes(random_pack())
