"""Default decode programs keep all they hold in the registers of a GPU, and are counted right."""

from typing import Any

import pytest

from lab.benchmarks.shaders.compiling import GPUS, find_compiler
from lab.benchmarks.shaders.decoding_programs import decoding_programs
from lab.benchmarks.shaders.statistics import statistics
from ntc.errors import InputError
from viewer.gl.context import GraphicsContext

pytestmark = pytest.mark.once


@pytest.fixture(scope="module", params=GPUS)
def rows(request: pytest.FixtureRequest, graphics: GraphicsContext) -> list[dict[str, Any]]:
    """What a GPU would run."""
    try:
        find_compiler(request.param)
    except InputError as error:
        pytest.skip(str(error))
    return statistics(request.param, decoding_programs(graphics, ("grid of best", "block")))


def test_default_programs_do_not_spill(rows: list[dict[str, Any]]) -> None:
    # Arithmetic in halves spills on DG2; no precision but fp32 is a default, and others are only chosen by their times.
    assert not [
        row for row in rows if row["spills"] and (row["gpu"] == "navi32" or row["precision"] in ("fp32", "fp16"))
    ]


def test_halves_take_fewer_instructions_on_an_amd_gpu(rows: list[dict[str, Any]]) -> None:
    figure = "vector instructions a texel"
    counted = [row for row in rows if row["gpu"] == "navi32" and row[figure] is not None]
    found = {(row["path"], row["precision"]): row[figure] for row in counted}
    if not found:
        pytest.skip("counts instructions of halves on AMD alone")
    for path in {path for path, _ in found}:
        # 1.68 to 1.79 with Mesa 25.0.
        assert found[path, "fp32"] > 1.6 * found[path, "fp16-accumulate"], path
