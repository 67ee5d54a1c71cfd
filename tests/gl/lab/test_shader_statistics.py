"""Default decode programs keep all they hold in the registers of a GPU, and are counted right."""

from typing import Any

import pytest

from lab.benchmarks.shaders.compiling import find_compiler
from lab.benchmarks.shaders.decoding_programs import CODECS
from lab.benchmarks.shaders.statistics import FAMILY, statistics
from ntc.codec.config import CodecConfig
from ntc.errors import InputError

pytestmark = pytest.mark.once


@pytest.fixture(scope="module")
def rows() -> list[dict[str, Any]]:
    """What an AMD GPU would run."""
    try:
        find_compiler(FAMILY)
    except InputError as error:
        pytest.skip(str(error))
    return statistics(("grid of best", "block"))


def test_default_programs_do_not_spill(rows: list[dict[str, Any]]) -> None:
    spilling = {
        (row["path"], row["codec"], row["precision"]) for row in rows if row["spilled VGPRs"] + row["spilled SGPRs"]
    }
    assert not spilling


def test_every_path_and_precision_is_there(rows: list[dict[str, Any]]) -> None:
    assert {row["path"] for row in rows} == {"forward", "deferred", "deferred, shared", "binned", "cached"}
    assert len(rows) == 5 * 4 + 5


def test_a_texel_takes_at_least_the_multiply_adds_of_its_network(rows: list[dict[str, Any]]) -> None:
    config = CODECS["grid of best"]
    assert isinstance(config, CodecConfig)
    for row in rows:
        if row["codec"] == "grid of best":
            # In halves one instruction may do two.
            least = config.multiply_adds / (1 if row["precision"] in ("fp32", "fp16") else 2)
            assert row["vector instructions a texel"] > least, row
