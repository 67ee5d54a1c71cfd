"""Messages whose arrays lie in shared memory."""

import os
from dataclasses import dataclass
from multiprocessing import shared_memory

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.worker.shared_arrays import ArrayPlace, SharedBlock, without_arrays
from tests.support.training_workers import blocks


@dataclass(frozen=True, eq=False)
class _Inner:
    values: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _Message:
    name: str
    parts: tuple[_Inner, ...]
    bytes: NDArray[np.uint8]
    empty: NDArray[np.float64]


def message() -> _Message:
    """Arrays of several types, one not contiguous."""
    random = np.random.default_rng(0)
    parts = tuple(_Inner(random.random((3, n), np.float32).T) for n in (1, 7))
    return _Message("m", parts, random.integers(0, 256, (5, 3), np.uint8), np.zeros((0, 2)))


def test_what_is_written_is_read_by_the_other_side() -> None:
    sent = message()
    places, arrays, end = without_arrays(sent, 128)
    assert len(arrays) == 4
    block = SharedBlock.create(end)
    other = SharedBlock.open(block.name)
    written = block.write(sent, 128)
    assert block.name in blocks()
    assert isinstance(written.bytes, ArrayPlace)
    assert written.bytes == places.bytes
    block.remove_name()
    assert block.name not in blocks()
    read = other.read(written)
    block.close()
    other.close()
    other.close()
    assert read.name == "m"
    for own, found in (
        (sent.bytes, read.bytes),
        (sent.empty, read.empty),
        (sent.parts[1].values, read.parts[1].values),
    ):
        np.testing.assert_array_equal(own, found)
        assert own.dtype == found.dtype
        assert not found.flags.writeable


def test_places_outside_and_closed_blocks_are_refused() -> None:
    block = SharedBlock.create(256)
    for place in (
        ArrayPlace(-64, (1,), "|u1"),
        ArrayPlace(1 << 20, (1,), "|u1"),
        ArrayPlace(0, (1 << 40,), "<f4"),
        ArrayPlace(0, (-1, -1), "<f4"),
    ):
        with pytest.raises(ValueError, match="outside"):
            block.read((place,))
    with pytest.raises(ValueError, match="block of"):
        block.write((np.zeros(1 << 20),))
    block.close()
    with pytest.raises(ValueError, match="closed"):
        block.read((ArrayPlace(0, (1,), "|u1"),))


def test_copies_are_no_larger_than_the_block() -> None:
    block = SharedBlock.create(1 << 16)
    place = ArrayPlace(0, (1 << 15,), "|u1")
    assert len(block.read((place, place))) == 2
    with pytest.raises(ValueError, match="outside"):
        block.read((place, place, place))
    block.close()


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="room is not asked for ahead here")
def test_no_room_is_said_and_nothing_stays() -> None:
    before = blocks()
    with pytest.raises(InputError, match=r"shared memory: 1099512 MB for training cannot be had \(.*\); make more"):
        SharedBlock.create(1 << 40)
    assert blocks() == before


def test_without_shared_memory_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: object, **_options: object) -> None:
        raise OSError(38, "Function not implemented")

    monkeypatch.setattr("ntc.worker.shared_arrays.SharedMemory", refuse)
    with pytest.raises(InputError, match="Function not implemented"):
        SharedBlock.create(10)
    assert shared_memory.SharedMemory is not refuse
