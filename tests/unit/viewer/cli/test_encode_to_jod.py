"""The search of the fewest bits for a quality, and what the option takes."""

import math
from pathlib import Path
from typing import cast

import pytest

from ntc.codec.model import Pack
from ntc.errors import InputError
from viewer import cli
from viewer.cli.encode_to_jod import FEWEST_BITS, MOST_BITS, NEAR, Trial, fewest_bits


def quality(bits: float) -> float:
    """JOD that rises with bits, as of real pictures."""
    return 10.0 - 1.2 / bits


@pytest.mark.parametrize("wanted", [1.0, 2.9, 3.0, 7.7, 15.0])
def test_the_fewest_bits_are_found(wanted: float) -> None:
    tried = []

    def measure(bits: float) -> Trial:
        tried.append(bits)
        return Trial(bits, quality(bits), cast(Pack, None))

    found = fewest_bits(measure, quality(wanted))
    assert wanted - 1e-9 <= found.bits <= wanted * NEAR
    assert len(tried) <= 8


def test_a_goal_that_the_fewest_bits_reach_takes_them() -> None:
    assert fewest_bits(lambda bits: Trial(bits, 9.9, cast(Pack, None)), 8.0).bits == FEWEST_BITS


def test_a_goal_out_of_reach_is_refused() -> None:
    with pytest.raises(InputError, match=rf"{MOST_BITS:g} bits per texel give 9.00 JOD; ask for less"):
        fewest_bits(lambda bits: Trial(bits, 9.0, cast(Pack, None)), 9.5)
    assert math.isfinite(MOST_BITS)


@pytest.mark.parametrize(
    ("value", "problem"),
    [
        ("11jod", "set it above 0 and below 10 JOD"),
        ("good", "'good' is not a quality, e.g. 40 (dB) or 9.5jod"),
    ],
)
def test_wrong_goals_are_refused(value: str, problem: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["encode", "courtyard", "--out", str(tmp_path / "a.ntc"), "--quality", value]) == 2
    assert problem in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
