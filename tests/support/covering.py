"""Products of parameters of which every run tests a part: each pair of values that two parameters can have, in few cases."""

from collections.abc import Sequence
from itertools import combinations, product
from typing import Any

import pytest


def covering(*lists: Sequence[Any]) -> list[Any]:
    """All combinations of `lists` for `pytest.mark.parametrize`. Those that are not chosen guard set `drawing`.

    They are chosen one by one: each is the first that adds most pairs of values, until every pair occurs.
    """
    cases = list(product(*(range(len(values)) for values in lists)))
    pairs = {case: {(i, case[i], j, case[j]) for i, j in combinations(range(len(case)), 2)} for case in cases}
    missing, chosen = set[tuple[int, int, int, int]]().union(*pairs.values()), set[tuple[int, ...]]()
    while missing:
        best = max(cases, key=lambda case: len(pairs[case] & missing))
        chosen.add(best)
        missing -= pairs[best]
    return [
        pytest.param(
            *(values[place] for values, place in zip(lists, case, strict=True)),
            marks=() if case in chosen else pytest.mark.guards("drawing"),
        )
        for case in cases
    ]
