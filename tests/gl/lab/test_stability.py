"""Hostile cases on the GPU's paths: errors within certified bounds, and nothing on the screen that is no number."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from lab.bench.stability import StabilityBench, StabilityRow, fixture_paths
from lab.bench.stability_block_cases import block_cases
from lab.bench.stability_cases import StabilityCase, stability_cases
from ntc.codec.config import Precision
from ntc.codec.grid.accuracy.rescale import exponents
from viewer.gl.context import GraphicsContext

pytestmark = pytest.mark.computes

CASES = {case.name: case for case in stability_cases(300)}
BLOCK_CASES = {case.name: case for case in block_cases(300)}
FP32_TOLERANCE = 1e-4
FP16_TOLERANCE = 4e-3
ORDINARY = (
    "random weights",
    "sums in another order",
    "weights 2^20, then 2^-20",
    "weights 2^-20, then 2^20",
    "hidden values beyond 65504",
    "latents at both ends",
    "texel edges and centres, all wraps",
    "beside the edges of 32768 texels, all wraps",
    "uv up to 1e6",
    "lod below 0 and beyond the last",
    "uv and lod NaN, Inf, 3.4e38, denormal",
)
HOSTILE = ("weights 2^20", "weights 2^-20", "weights 3e38", "denormal fp32", "weights 0")


@pytest.fixture(scope="module")
def bench(graphics: GraphicsContext) -> Iterator[StabilityBench]:
    """Programs of one codec, shared by all cases."""
    made = StabilityBench(graphics)
    yield made
    made.release()


def fewer(case: StabilityCase, texels: int) -> StabilityCase:
    """`case` with at most so many texels of each texture."""
    parts = [replace(part, uv=part.uv[:texels], lod=part.lod[:texels]) for part in case.requests]
    return replace(case, requests=parts)


@pytest.mark.parametrize("name", BLOCK_CASES)
def test_codec_block_is_exact_to_what_is_promised(bench: StabilityBench, name: str) -> None:
    case = fewer(BLOCK_CASES[name], 60)
    for row in (bench.texels(case, "fp32"), *bench.pictures(case, "fp32", fixture_paths(case))):
        assert row.not_finite == 0, row
        assert row.largest is not None
        assert row.largest <= FP32_TOLERANCE, row


def require_bounds(row: StabilityRow) -> None:
    """Everything is a number, and errors are within the bounds of their texels."""
    assert row.not_finite == 0, row
    assert row.holds, row


@pytest.mark.parametrize("name", ORDINARY)
def test_ordinary_cases_are_exact_to_what_is_promised(bench: StabilityBench, name: str) -> None:
    for precision, tolerance in (("fp32", FP32_TOLERANCE), ("fp16", FP16_TOLERANCE)):
        row = bench.texels(CASES[name], precision)  # type: ignore[arg-type]
        require_bounds(row)
        assert row.largest is not None
        assert row.largest <= tolerance, row


@pytest.mark.parametrize("precision", ["fp16-arithmetic", "fp16-accumulate"])
@pytest.mark.parametrize("name", ORDINARY)
def test_half_arithmetic_keeps_to_its_bounds(bench: StabilityBench, name: str, precision: Precision) -> None:
    row = bench.texels(fewer(CASES[name], 500), precision)
    require_bounds(row)
    assert row.largest is not None
    assert row.largest <= 1e-2, row


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_weights_show_numbers(bench: StabilityBench, name: str) -> None:
    for precision in ("fp32", "fp16", "fp16-accumulate"):
        require_bounds(bench.texels(fewer(CASES[name], 100), precision))


def test_pictures_bear_the_same(bench: StabilityBench) -> None:
    for name in ("random weights", "uv and lod NaN, Inf, 3.4e38, denormal", "weights 3e38"):
        case = CASES[name]
        for row in bench.pictures(case, "fp32", fixture_paths(case)):
            require_bounds(row)
            assert name == "weights 3e38" or (row.largest or 0.0) <= FP32_TOLERANCE, row


def test_without_rescaling_halves_overflow_and_stay_numbers(bench: StabilityBench) -> None:
    without = CASES["hidden values beyond 65504, not rescaled"]
    assert max(one.second for one in exponents(without.pack)) > 0
    row = bench.texels(without, "fp16-accumulate")
    require_bounds(row)
    assert row.largest is not None
    assert row.largest > 0.2, "numbers overflow"
    assert row.bound == 1.0, "and the bound says so"


def test_thousands_of_decoders(bench: StabilityBench) -> None:
    row = bench.texels(CASES["2000 decoders"], "fp32")
    require_bounds(row)
    assert row.largest is not None
    assert row.largest <= FP32_TOLERANCE
    assert row.texels == 2000


def test_sizes_from_one_texel_to_a_long_strip(bench: StabilityBench) -> None:
    row = bench.texels(CASES["1x1, 1x16384, 16384x1, 1000x3"], "fp32")
    require_bounds(row)
    assert row.largest is not None
    assert row.largest <= FP32_TOLERANCE
