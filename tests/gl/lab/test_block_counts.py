"""Vector instructions of codec `block` on GPUs: bounds that may only fall, and trip counts of small packs."""

import json
from pathlib import Path
from typing import Any

import pytest

from lab.bench.random_pack import random_block_pack
from lab.benchmarks.shaders.block_counts import (
    PackCodes,
    rows,
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
