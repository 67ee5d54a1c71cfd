"""Values that are sent with their large arrays in shared memory."""

import math
import os
from dataclasses import dataclass
from multiprocessing import shared_memory

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.worker.shared_arrays import LARGEST_INSIDE, Pickled, SharedBlock, inside, received, sent
from tests.support.training_workers import array_bytes, blocks


@dataclass(frozen=True, eq=False)
class _Inner:
    values: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _Value:
    decibels: float
    parts: tuple[_Inner, ...]
    bytes: NDArray[np.uint8]
    empty: NDArray[np.float64]


def value() -> _Value:
    """Arrays of several types and sizes, one not contiguous."""
    random = np.random.default_rng(0)
    parts = tuple(_Inner(random.random((3, n), np.float32)[::2]) for n in (1, LARGEST_INSIDE))
    return _Value(math.inf, parts, random.integers(0, 256, (LARGEST_INSIDE + 1, 3), np.uint8), np.zeros((0, 2)))


def test_what_is_sent_arrives_and_the_memory_has_no_name_once_it_is_open() -> None:
    given = value()
    parcel, block = sent(given)
    assert block is not None
    assert blocks() == [block.name]
    assert parcel.sizes == (given.bytes.nbytes,), "what is small, and what is not contiguous, goes inside the message"
    found = received(parcel)
    assert blocks() == []
    block.close()
    block.close()
    assert found.decibels == math.inf
    assert array_bytes(found) == array_bytes(given)
    assert found.parts[1].values.dtype == np.float32
    assert found.bytes.shape == given.bytes.shape
    assert not found.bytes.flags.writeable


def test_small_values_take_no_shared_memory() -> None:
    parcel, block = sent((1, np.zeros(3)))
    assert (block, parcel.block) == (None, "")
    assert received(parcel)[0] == received(inside(1)) == 1


def test_values_lie_side_by_side_in_a_block() -> None:
    first, second = (Pickled(np.full(LARGEST_INSIDE + 1, number, np.uint8)) for number in (1, 2))
    block = SharedBlock.create(first.size + second.size)
    parcels = [block.write(first), block.write(second, first.size)]
    assert [int(block.read(parcel).max()) for parcel in parcels] == [1, 2]
    with pytest.raises(ValueError, match="arrays end at byte"):
        block.write(second, first.size + 8192)
    block.close()
    with pytest.raises(ValueError, match="closed"):
        block.read(parcels[0])
    assert blocks() == []


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="room is not asked for ahead here")
def test_no_room_is_said_and_nothing_stays() -> None:
    before = blocks()
    with pytest.raises(InputError, match=r"shared memory: 1099512 MB cannot be had \(.*\); make more"):
        SharedBlock.create(1 << 40)
    assert blocks() == before


def test_without_shared_memory_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: object, **_options: object) -> None:
        raise OSError(38, "Function not implemented")

    monkeypatch.setattr("ntc.worker.shared_arrays.SharedMemory", refuse)
    with pytest.raises(InputError, match="Function not implemented"):
        SharedBlock.create(10)
    assert shared_memory.SharedMemory is not refuse
