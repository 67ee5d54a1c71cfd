"""The mode in which indices of compiled loops are checked (`tests.support.checked_indices`)."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from tests.support.checked_indices import are_checked

checked = pytest.mark.skipif(not are_checked(), reason="NUMBA_BOUNDSCHECK is not set")


@njit(nogil=True)
def _at(values: NDArray[np.float32], place: int | np.integer) -> float:
    return float(values[place])


@njit(nogil=True)
def _at_row(values: NDArray[np.float32], row: int | np.integer, column: int | np.integer) -> float:
    return _at(values[row], column)


@njit(nogil=True)
def _set(values: NDArray[np.float32], place: int) -> None:
    values[place] = 1.0


@checked
@pytest.mark.parametrize("place", [4, 1 << 40, -1, -4, -5])
def test_indices_outside_an_array_are_errors_wherever_they_are(place: int) -> None:
    values = np.zeros((4, 4), np.float32)
    with pytest.raises(IndexError):
        _at(values[0], place)
    with pytest.raises(IndexError):
        _set(values[0], place)
    # From a function within a function, in another thread, without Python's lock.
    with ThreadPoolExecutor(1) as pool, pytest.raises(IndexError):
        pool.submit(_at_row, values, 3, place).result()
    with pytest.raises(IndexError):
        _at_row(values, place, 0)
    assert not values.any()


@checked
def test_indices_inside_an_array_are_none() -> None:
    values = np.arange(16, dtype=np.float32).reshape(4, 4)
    assert _at_row(values, np.int64(3), np.int64(3)) == 15.0
    assert _at(values[1], np.uint8(2)) == 6.0
