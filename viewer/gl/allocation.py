"""Allocation of GPU memory, with a check whether the driver had memory.

moderngl returns objects even if the driver had no memory for them; OpenGL only sets an error flag. So GpuMemory clears the flags
before an allocation, reads them after it, and frees the object and raises GpuMemoryError if one is set.

Several allocations that belong together form a transaction: a block that records the objects made within. If the block ends with an
exception, they are freed in reverse order; else they pass to the enclosing transaction, which may still free them. So an object is
either complete or takes no memory, however deep constructors are nested.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any, Protocol, TypeVar

import moderngl

from ntc.errors import InputError
from viewer.gl.limits import Limits

READS = ("read", "read_into", "read_chunks", "read_chunks_into")
"""Methods of moderngl's objects that wait for the GPU."""


class BlockingCalls:
    """Counter of the calls of one context in which the CPU waits for the GPU. Frames in motion should make none."""

    def __init__(self) -> None:
        self.count = 0
        """Number of calls so far."""

    def watch(self, thing: object) -> None:
        """Count what is read from a buffer, texture or framebuffer of moderngl from now on."""
        for name in READS:
            method = getattr(thing, name, None)
            if method is not None:
                setattr(thing, name, self._counted(method))

    def _counted(self, method: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(method)
        def counted(*arguments: Any, **options: Any) -> Any:
            self.count += 1
            return method(*arguments, **options)

        return counted


LIMIT_VARIABLE = "NTC_VIEWER_GPU_MEGABYTES"
"""Environment variable with a limit of all GPU memory in MB, for tests of memory shortage."""
ALL_MIPS = 1000
"""Number larger than the number of mips of any texture."""
NO_ERROR = "GL_NO_ERROR"
OUT_OF_MEMORY = "GL_OUT_OF_MEMORY"
REFUSALS = (OUT_OF_MEMORY, "GL_INVALID_VALUE")
"""OpenGL errors that mean a failed allocation. Others, such as those of freeing a bound framebuffer, do not."""
REMEDY = "close packs or other programs, or make the picture or the window smaller"
MOST_ERRORS = 16
"""Most error flags that a driver may hold at once."""
TEXEL_TYPES = {"f1": 1, "f2": 2, "f4": 4, "u4": 4}
"""Number of bytes of a channel, by type."""


class GpuMemoryError(InputError):
    """Error of an allocation: too little GPU memory, or a texture beyond the driver's limits. Nothing was allocated."""


class Releasable(Protocol):
    """Object with GPU memory."""

    def release(self) -> None:
        """Free the object; a second call does nothing."""


Made = TypeVar("Made", bound=Releasable)


def limit_from_environment() -> int | None:
    """Return the number of bytes that LIMIT_VARIABLE allows; None without it. Raises InputError for anything but a whole number."""
    text = os.environ.get(LIMIT_VARIABLE, "").strip()
    if not text:
        return None
    if not text.isdecimal():
        raise InputError(f"{LIMIT_VARIABLE}={text!r}: must be a whole number of MB")
    return int(text) * 1_000_000


def is_released(made: Releasable) -> bool:
    """Return whether an object from GpuMemory has been freed."""
    return isinstance(getattr(made, "mglo", None), moderngl.InvalidObject) or getattr(made, "is_released", False)


def replace_content(buffer: moderngl.Buffer, data: bytes) -> None:
    """Write the beginning of a buffer and discard its old content, so the driver need not wait until the GPU has read that."""
    buffer.orphan()
    buffer.write(data)


class GpuMemory:
    """Allocator of the buffers, textures and framebuffers of one context.

    Errors of OpenGL are read at each allocation, never while drawing. All methods that allocate raise GpuMemoryError, whose one line
    says for what there was no memory, and how much.
    """

    def __init__(
        self,
        gl: moderngl.Context,
        limit_bytes: int | None = None,
        blocking: BlockingCalls | None = None,
        limits: Limits | None = None,
    ) -> None:
        """Take a limit of all memory in bytes (None: as much as the driver has), and a counter of what is read back.

        `limits`: of what is allocated; None: those of a driver that computes.
        """
        self.gl = gl
        self.blocking = blocking or BlockingCalls()
        self.limits = limits or Limits.of(gl.info)
        self._limit = limit_bytes
        self._given: list[tuple[Releasable, int]] = []
        self._open: list[list[Releasable]] = []

    @property
    def bytes_given(self) -> int:
        """Number of bytes of all objects that have not been freed; known only where there is a limit."""
        self._given = [(made, size) for made, size in self._given if not is_released(made)]
        return sum(size for _, size in self._given)

    @property
    def objects_given(self) -> int:
        """Number of objects that have not been freed; known only where there is a limit."""
        return sum(not is_released(made) for made, _ in self._given)

    def allows(self, _what: str, size: int, /) -> bool:
        """Return whether the limit has room for `size` bytes more. `_what` lets tests reject allocations by label."""
        return self._limit is None or self.bytes_given + size <= self._limit

    def _take_errors(self) -> set[str]:
        """Return OpenGL's errors since the last call."""
        errors: set[str] = set()
        for _ in range(MOST_ERRORS):
            error = str(self.gl.error)
            if error == NO_ERROR:
                break
            errors.add(error)
        return errors

    def made(self, what: str, size: int, make: Callable[[], Made]) -> Made:
        """Return the object of `size` bytes that `make` returns; freed again where OpenGL reports an error afterwards."""
        if not self.allows(what, size):
            raise self._refusal(what, size)
        # Errors of earlier calls must not count as errors of this allocation.
        self._take_errors()
        try:
            thing = make()
        except moderngl.Error as error:
            raise self._refusal(what, size) from error
        self.check(what, size, thing)
        if self._limit is not None:
            self._given.append((thing, size))
        if self._open:
            self._open[-1].append(thing)
        self.blocking.watch(thing)
        return thing

    def write(self, buffer: moderngl.Buffer, data: bytes, offset: int = 0) -> None:
        """Write a part of a buffer that the GPU may be reading, through another buffer, so that nothing waits."""
        try:
            staged = self.buffer("what is uploaded", reserve=len(data))
        except GpuMemoryError:
            buffer.write(data, offset=offset)
            return
        staged.write(data)
        self.gl.copy_buffer(buffer, staged, len(data), 0, offset)
        staged.release()

    def check(self, what: str, size: int, thing: Releasable) -> None:
        """Free `thing` and raise GpuMemoryError where OpenGL reports that an allocation has failed."""
        errors = self._take_errors().intersection(REFUSALS)
        if errors:
            thing.release()
            raise self._refusal(what, size, min(errors, key=REFUSALS.index))

    @staticmethod
    def _refusal(what: str, size: int, error: str = OUT_OF_MEMORY) -> GpuMemoryError:
        reason = "" if error == OUT_OF_MEMORY else f" ({error})"
        megabytes = max(size, 1) / 1e6
        amount = f"{megabytes:.0f}" if megabytes >= 100 else f"{megabytes:.2g}"
        return GpuMemoryError(f"{what}: the GPU has no memory for {amount} MB{reason}; {REMEDY}")

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Free all objects allocated in the block if it ends with an exception."""
        made: list[Releasable] = []
        self._open.append(made)
        try:
            yield
        except BaseException:
            self._open.pop()
            for thing in reversed(made):
                thing.release()
            raise
        self._open.pop()
        if self._open:
            self._open[-1].extend(made)

    def buffer(
        self, what: str, data: Any = None, reserve: int = 0, dynamic: bool = False, storage: bool = False
    ) -> moderngl.Buffer:
        """Return a buffer of `data`, or of `reserve` bytes, uninitialised. `what` names it in error messages, here and below.

        `storage`: shaders are to read it whole as a storage buffer, which drivers allow up to a size.
        """
        size = reserve if data is None else memoryview(data).nbytes
        most = self.limits.storage_block_bytes
        if storage and size > most:
            raise GpuMemoryError(
                f"{what}: {size / 1e6:.0f} MB exceed the {most / 1e6:.0f} MB that shaders can read of one buffer "
                f"({self.limits.storage_limit}); make the picture smaller, or open fewer textures at once"
            )
        return self.made(what, size, lambda: self.gl.buffer(data, reserve=reserve, dynamic=dynamic))

    def grown(
        self, what: str, old: moderngl.Buffer, size: int, dynamic: bool = False, storage: bool = False
    ) -> moderngl.Buffer:
        """Return `old`, or where it is smaller than `size` bytes a new buffer without its content; `old` is freed then."""
        if old.size >= size:
            return old
        made = self.buffer(what, reserve=size, dynamic=dynamic, storage=storage)
        old.release()
        return made

    def check_size(self, what: str, size: tuple[int, int]) -> None:
        """Raise GpuMemoryError where the driver has no textures of this (width, height)."""
        most = self.limits.texture_side
        if max(size) > most:
            raise GpuMemoryError(
                f"{what}: {size[0]} x {size[1]} is more than the {most} a side that the GPU's driver allows "
                "(GL_MAX_TEXTURE_SIZE); make it smaller"
            )

    def texture(
        self,
        what: str,
        size: tuple[int, int],
        components: int,
        data: Any = None,
        *,
        dtype: str = "f1",
        alignment: int = 1,
    ) -> moderngl.Texture:
        """Return a texture of `size` (width, height); `dtype` as in TEXEL_TYPES, `alignment` of the rows of `data` in bytes."""
        self.check_size(what, size)
        number = size[0] * size[1] * components * TEXEL_TYPES[dtype]
        return self.made(
            what, number, lambda: self.gl.texture(size, components, data, alignment=alignment, dtype=dtype)
        )

    def depth_texture(self, what: str, size: tuple[int, int]) -> moderngl.Texture:
        """Return a depth texture of `size` (width, height)."""
        self.check_size(what, size)
        return self.made(what, size[0] * size[1] * 4, lambda: self.gl.depth_texture(size))

    def build_mipmaps(self, what: str, texture: moderngl.Texture, coarsest: int = ALL_MIPS) -> None:
        """Fill the mips of a texture down to number `coarsest`, or all; it is freed where that fails."""
        self._take_errors()
        texture.build_mipmaps(max_level=coarsest)
        self.check(what, texture.width * texture.height * texture.components // 3, texture)

    def framebuffer(
        self, what: str, colors: list[moderngl.Texture], depth: moderngl.Texture | None = None
    ) -> moderngl.Framebuffer:
        """Return a framebuffer of these textures."""
        return self.made(what, 0, lambda: self.gl.framebuffer(colors, depth))
