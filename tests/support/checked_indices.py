"""Compiled loops with every index checked: `NUMBA_BOUNDSCHECK=1 python -m pytest tests/unit/ntc -m "not process"`.

numba then raises IndexError for an index outside its array. By itself it lets a negative index count from the end: here that is an
error too. Its cache does not tell checked code from other code, so checked code has another cache.
"""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

VARIABLE = "NUMBA_BOUNDSCHECK"


def are_checked() -> bool:
    """Return whether indices of compiled loops are checked."""
    return os.environ.get(VARIABLE, "0") != "0"


@contextmanager
def checked_indices(config: pytest.Config) -> Iterator[None]:
    """Check indices in the block, where the environment asks for it. Enter it before anything is compiled."""
    if not are_checked():
        yield
        return
    forbid_negative_indices()
    if hasattr(config, "workerinput"):
        # The cache is that of the process that started this worker.
        yield
        return
    with tempfile.TemporaryDirectory(prefix="checked-") as folder:
        os.environ["NUMBA_CACHE_DIR"] = folder
        yield


def forbid_negative_indices() -> None:
    """Let numba leave negative indices as they are: its check then finds them outside the array."""
    from numba import types
    from numba.np import arrayobj

    def as_it_is(context: Any, builder: Any, index_type: Any, index: Any, _size: Any) -> Any:
        """Replace numba's `fix_integer_index`, which adds the size to a negative index. Tested with numba 0.61 to 0.68."""
        return context.cast(builder, index, index_type, types.intp if index_type.signed else types.uintp)

    assert callable(arrayobj.fix_integer_index)
    arrayobj.fix_integer_index = as_it_is
