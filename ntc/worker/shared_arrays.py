"""Arrays of messages in shared memory, so that large messages are not copied through a pipe."""

import math
import os
import re
import secrets
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass, replace
from multiprocessing.shared_memory import SharedMemory
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError

ALIGNMENT = 64
PREFIX = "ntc-"
"""The names of all blocks start with this; the id of the process that created the block follows."""
PLAIN_NUMBERS = re.compile("[<>|=](?:[biu]1|[iuf][248])")
"""numpy's names of the array types that are exchanged."""
MOST_AXES = 8
BLOCK_NAME = re.compile(PREFIX + "[0-9]{1,10}-[0-9a-f]{16}")
T = TypeVar("T")


@dataclass(frozen=True)
class ArrayPlace:
    """Where an array lies in a block; replaces the array in a message."""

    offset: int
    shape: tuple[int, ...]
    dtype: str

    @property
    def size(self) -> int:
        """Bytes of the array. Raises ValueError for types and shapes that are not exchanged."""
        if PLAIN_NUMBERS.fullmatch(self.dtype) is None:
            # Bytes of an array of objects would be used as addresses.
            raise ValueError(f"arrays of {self.dtype[:20]!r} are not exchanged")
        if len(self.shape) > MOST_AXES or min(self.shape, default=0) < 0:
            raise ValueError(f"{self} lies outside every block")
        return math.prod(self.shape) * np.dtype(self.dtype).itemsize


def aligned(size: int) -> int:
    """Bytes that an array of `size` bytes takes up in a block."""
    return -(-size // ALIGNMENT) * ALIGNMENT


def replaced(value: Any, of_type: type, change: Callable[[Any], Any]) -> Any:
    """`value` with `change` applied to every instance of `of_type` within its dataclasses and tuples."""
    if isinstance(value, of_type):
        return change(value)
    if isinstance(value, tuple):
        changed = tuple(replaced(part, of_type, change) for part in value)
        return changed if any(a is not b for a, b in zip(value, changed, strict=True)) else value
    if is_dataclass(value) and not isinstance(value, type):
        found = {field.name: getattr(value, field.name) for field in fields(value)}
        new = {name: replaced(part, of_type, change) for name, part in found.items()}
        different = {name: part for name, part in new.items() if part is not found[name]}
        return replace(value, **different) if different else value
    return value


def without_arrays(message: T, start: int = 0) -> tuple[T, list[NDArray[Any]], int]:
    """A message with places instead of its arrays, the arrays, and the byte where the last one ends in a block that holds
    them from byte `start` on."""
    arrays: list[NDArray[Any]] = []
    position = start

    def place(array: NDArray[Any]) -> ArrayPlace:
        nonlocal position
        arrays.append(array)
        found = ArrayPlace(position, array.shape, array.dtype.str)
        position += aligned(array.nbytes)
        return found

    return replaced(message, np.ndarray, place), arrays, position


class SharedBlock:
    """A block of shared memory. The process that created it removes its name, once the other one has opened it: the memory
    stays until both have closed it, and nothing is left when one of them is killed."""

    def __init__(self, memory: SharedMemory, owner: bool) -> None:
        self._memory: SharedMemory | None = memory
        self._owner = owner
        self.name = memory.name

    @classmethod
    def create(cls, size: int) -> "SharedBlock":
        """A new block of at least `size` writable bytes. Raises InputError where there is not enough shared memory."""
        try:
            memory = SharedMemory(f"{PREFIX}{os.getpid()}-{secrets.token_hex(8)}", create=True, size=max(1, size))
        except (OSError, ValueError, ImportError) as error:
            raise _no_room(size, error) from error
        block = cls(memory, owner=True)
        descriptor = getattr(memory, "_fd", -1)
        try:
            # Without this, a full file system of shared memory kills the process that writes to the block.
            if descriptor >= 0 and hasattr(os, "posix_fallocate"):
                os.posix_fallocate(descriptor, 0, max(1, size))
        except OSError as error:
            block.close()
            raise _no_room(size, error) from error
        return block

    @classmethod
    def open(cls, name: str) -> "SharedBlock":
        """A block that the other process created. Raises OSError where it does not exist, ValueError for a name that no block has."""
        if BLOCK_NAME.fullmatch(name) is None:
            raise ValueError(f"{name[:60]!r} is not the name of a block")
        return cls(SharedMemory(name), owner=False)

    def write(self, message: T, start: int = 0) -> T:
        """Copy the arrays of a message into the block from `start` on; returns it with their places.

        Raises ValueError where they do not fit.
        """
        places, arrays, end = without_arrays(message, start)
        buffer = self._buffer()
        if start < 0 or end > len(buffer):
            raise ValueError(f"arrays end at byte {end} of a block of {len(buffer)}")
        position = start
        for array in arrays:
            view: NDArray[Any] = np.ndarray(array.shape, array.dtype, buffer, position)
            view[...] = array
            position += aligned(array.nbytes)
        return places

    def read(self, message: T) -> T:
        """A message with read-only copies of its arrays instead of their places. Raises ValueError for a place outside the
        block, and for copies that would together be larger than the block."""
        buffer = self._buffer()
        left = len(buffer)

        def copy(place: ArrayPlace) -> NDArray[Any]:
            nonlocal left
            if not 0 <= place.offset <= len(buffer) - place.size or place.size > left:
                raise ValueError(f"{str(place)[:200]} lies outside a block of {len(buffer)} bytes")
            left -= place.size
            view: NDArray[Any] = np.ndarray(place.shape, place.dtype, buffer, place.offset)
            array = view.copy()
            array.flags.writeable = False
            return array

        found: T = replaced(message, ArrayPlace, copy)
        return found

    def _buffer(self) -> memoryview:
        buffer = None if self._memory is None else self._memory.buf
        if buffer is None:
            raise ValueError(f"shared memory {self.name} is closed")
        return buffer

    def remove_name(self) -> None:
        """Remove the block's name, so that it can no longer be opened; processes that have it open keep it."""
        if self._owner and self._memory is not None:
            self._owner = False
            with suppress(FileNotFoundError):
                self._memory.unlink()

    def close(self) -> None:
        """Close the block, and remove its name where this process created it."""
        if self._memory is not None:
            self.remove_name()
            self._memory.close()
            self._memory = None


def _no_room(size: int, error: Exception) -> InputError:
    reason = getattr(error, "strerror", None) or error
    return InputError(
        f"shared memory: {size / 1e6:.0f} MB for training cannot be had ({reason}); "
        "make more of it available (in a container: a larger --shm-size), or encode fewer or smaller textures"
    )
