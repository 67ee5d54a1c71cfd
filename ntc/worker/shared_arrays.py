"""Values on their way to another process: pickled, with their large arrays in shared memory.

Pickle, because both ends are this program: it started the process, and nothing else can write into the pipe. Every number
arrives as it was sent, and nothing here knows what a value is. What comes from a file is checked where the file is read.
"""

import os
import pickle
import secrets
from contextlib import suppress
from multiprocessing.shared_memory import SharedMemory
from typing import Any

import msgspec
import numpy as np

from ntc.errors import InputError

ALIGNMENT = 64
PREFIX = "ntc-"
"""The names of all blocks start with this; the id of the process that created the block follows."""
LARGEST_INSIDE = 1 << 12
"""Bytes: smaller arrays are sent inside the message."""


def aligned(size: int) -> int:
    """Return the bytes that an array of `size` bytes takes up in a block."""
    return -(-size // ALIGNMENT) * ALIGNMENT


class Payload(msgspec.Struct, frozen=True):
    """A value as it is sent."""

    data: bytes
    """Pickled, without its large arrays."""
    sizes: tuple[int, ...] = ()
    """Bytes of each large array; they lie in the block one after the other, aligned."""
    start: int = 0
    """Byte of the block where the first one begins."""
    block: str = ""
    """Name of the block; empty where the receiver has it open."""


class Pickled:
    """A value that is about to be sent."""

    def __init__(self, value: object) -> None:
        self.arrays: list[memoryview] = []
        """Bytes of its large arrays, not copied."""
        self.data = pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL, buffer_callback=self._stays_inside)
        self.size = sum(aligned(array.nbytes) for array in self.arrays)
        """Bytes that the large arrays take up in a block."""

    def _stays_inside(self, buffer: pickle.PickleBuffer) -> bool:
        raw = buffer.raw()
        if raw.nbytes <= LARGEST_INSIDE:
            return True
        self.arrays.append(raw)
        return False


class SharedBlock:
    """A block of shared memory. Who opens it removes its name: the memory stays until both processes have closed it, and nothing
    is left when one of them is killed."""

    def __init__(self, memory: SharedMemory) -> None:
        self._memory: SharedMemory | None = memory
        self.name = memory.name

    @classmethod
    def create(cls, size: int) -> "SharedBlock":
        """Return a new block of at least `size` writable bytes. Raises InputError where there is not enough shared memory."""
        try:
            memory = SharedMemory(f"{PREFIX}{os.getpid()}-{secrets.token_hex(8)}", create=True, size=max(1, size))
        except (OSError, ValueError, ImportError) as error:
            raise _no_room(size, error) from error
        block = cls(memory)
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
        """Return the block that the other process created, without a name from now on. Raises OSError where there is none."""
        block = cls(SharedMemory(name))
        block._remove_name()
        return block

    def write(self, value: Pickled, start: int = 0, name: str = "") -> Payload:
        """Copy the large arrays of a value into the block from byte `start` on. Raises ValueError where they do not fit."""
        buffer, position = self._buffer(), start
        if start < 0 or start + value.size > len(buffer):
            raise ValueError(f"arrays end at byte {start + value.size} of a block of {len(buffer)}")
        for array in value.arrays:
            np.frombuffer(buffer, np.uint8, array.nbytes, position)[:] = np.frombuffer(array, np.uint8)
            position += aligned(array.nbytes)
        return Payload(value.data, tuple(array.nbytes for array in value.arrays), start, name)

    def read(self, payload: Payload) -> Any:
        """Return the value of a payload; its large arrays are read-only copies."""
        copies, position = [], payload.start
        for size in payload.sizes:
            # numpy releases Python's lock while it copies.
            copies.append(np.frombuffer(self._buffer(), np.uint8, size, position).copy())
            copies[-1].flags.writeable = False
            position += aligned(size)
        return pickle.loads(payload.data, buffers=copies)

    def _buffer(self) -> memoryview:
        buffer = None if self._memory is None else self._memory.buf
        if buffer is None:
            raise ValueError(f"shared memory {self.name} is closed")
        return buffer

    def _remove_name(self) -> None:
        if self._memory is not None:
            # The other process may have done so.
            with suppress(FileNotFoundError):
                self._memory.unlink()

    def close(self) -> None:
        """Close the block, and remove its name."""
        if self._memory is not None:
            self._remove_name()
            self._memory.close()
            self._memory = None


def inside(value: object) -> Payload:
    """Return a value to be sent whole inside a message."""
    return Payload(pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL))


def sent(value: object) -> tuple[Payload, SharedBlock | None]:
    """Return a value to be sent, and the block of its large arrays, if it has any: to be kept until the other process has the value.

    Raises InputError where there is not enough shared memory.
    """
    pickled = Pickled(value)
    if not pickled.arrays:
        return Payload(pickled.data), None
    block = SharedBlock.create(pickled.size)
    return block.write(pickled, name=block.name), block


def received(payload: Payload) -> Any:
    """Return the value of a payload that the other process sent."""
    if not payload.block:
        return pickle.loads(payload.data)
    block = SharedBlock.open(payload.block)
    try:
        return block.read(payload)
    finally:
        block.close()


def _no_room(size: int, error: Exception) -> InputError:
    reason = getattr(error, "strerror", None) or error
    return InputError(
        f"shared memory: {size / 1e6:.0f} MB cannot be allocated ({reason}); "
        "allow more of it (in a container: a larger --shm-size), or encode fewer or smaller textures"
    )
