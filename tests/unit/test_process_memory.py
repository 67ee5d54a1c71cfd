"""Test processes stay below a limit of memory."""

import numpy as np
import pytest

from tests.support.process_memory import STATUS, excess, megabytes

pytestmark = pytest.mark.skipif(not STATUS.exists(), reason="needs /proc")


def test_memory_of_this_process_is_counted_and_limited() -> None:
    before = megabytes()
    content = np.ones(200_000_000, np.uint8)
    grown = megabytes()
    assert before + 150 < grown < before + 250
    assert f"has {grown} MB" in excess(before + 150)
    assert excess(before + 250) == ""
    del content
    assert megabytes() < before + 50
