"""Constants of the work of encodings follow from the measured time of their parts."""

from dataclasses import replace

import numpy as np
import pytest

from lab.benchmarks.encoding_work import constants, fitted, row_of
from ntc.codec.block.config import BlockOptions
from ntc.codec.block.encoding import rate
from ntc.codec.encoding import EncodingChoices
from ntc.codec.model import Grouping
from ntc.codec.registry import codec_named
from ntc.codec.textures import SourceTexture
from ntc.training.encode import chosen_request


def test_a_fit_finds_the_factors_of_times_of_any_size() -> None:
    blocks, calls = [10.0, 2000.0, 300.0, 4.0], [1.0, 2.0, 30.0, 40.0]
    times = [0.5 * own + 3.0 * call for own, call in zip(blocks, calls, strict=True)]
    (per_block, per_call), error = fitted(times, blocks, calls)
    assert (per_block, per_call, error) == (
        pytest.approx(0.5, rel=0.02),
        pytest.approx(3.0, rel=0.02),
        pytest.approx(1.0, abs=0.02),
    )


def test_the_parts_of_an_encoding_take_its_time() -> None:
    random = np.random.default_rng(0)
    cells = [np.kron(random.integers(0, 256, (32, 32, 3)), np.ones((2, 2, 1))).astype(np.uint8) for _ in range(2)]
    textures = [SourceTexture(f"noise {number}", pixels, str(number)) for number, pixels in enumerate(cells)]
    request = chosen_request(textures, Grouping("single", (0, 0)), codec_named("block"), EncodingChoices())
    assert isinstance(request.training, BlockOptions)
    row = row_of("noise", replace(request, training=replace(request.training, threads=1)))
    assert 0.7 * row["seconds"] < sum(part["seconds"] for part in row["parts"].values()) <= row["seconds"]
    assert row["parts"]["texture"]["calls"] == 2
    row["parts"].setdefault("again: preparing", {"calls": 1.0, "blocks": 10.0, "seconds": 0.001})
    found = constants([row | {"textures_expected_again": 2}])
    named = {name: value for name, value in found.items() if name.isupper()}
    assert all(isinstance(getattr(rate, name), int | float) for name in named)
    shares = rate.TYPICAL_KINDS * found["CHOICES_WORK"] + found["CODES_WORK"] + found["MEASURE_WORK"]
    assert shares == pytest.approx(1.0)
