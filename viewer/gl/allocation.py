"""Where all memory of the GPU is asked for: moderngl gives objects without memory and leaves it to its callers to notice."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol, TypeVar

import moderngl

from ntc.errors import InputError

LIMIT_VARIABLE = "NTC_VIEWER_GPU_MEGABYTES"
"""Environment variable: never ask for more than so many MB in all, for trying what happens then."""
NO_ERROR = "GL_NO_ERROR"
OUT_OF_MEMORY = "GL_OUT_OF_MEMORY"
REFUSALS = (OUT_OF_MEMORY, "GL_INVALID_VALUE")
"""Other errors, as of a framebuffer that was bound when it was freed, take no memory away."""
REMEDY = "close packs or other programs, or make the picture or the window smaller"
MOST_ERRORS = 16
"""Flags that a driver may hold at once."""
TEXEL_TYPES = {"f1": 1, "f2": 2, "f4": 4, "u4": 4}
"""Bytes of a channel."""


class GpuMemoryError(InputError):
    """The GPU has no memory, or no textures that large. Nothing of what was asked for is there."""


class Releasable(Protocol):
    """What has memory of the GPU."""

    def release(self) -> None:
        """Free it; a second time does nothing."""


Made = TypeVar("Made", bound=Releasable)


def limit_from_environment() -> int | None:
    """Bytes that LIMIT_VARIABLE allows; None without it. Raises InputError for anything but a whole number."""
    text = os.environ.get(LIMIT_VARIABLE, "").strip()
    if not text:
        return None
    if not text.isdecimal():
        raise InputError(f"{LIMIT_VARIABLE}={text!r}: must be a whole number of MB")
    return int(text) * 1_000_000


def is_released(made: Releasable) -> bool:
    """Whether an object that GpuMemory gave has been freed."""
    return isinstance(getattr(made, "mglo", None), moderngl.InvalidObject) or getattr(made, "is_released", False)


class GpuMemory:
    """Makes the buffers, textures and framebuffers of one context.

    Every request is checked once, when it is made: drawing asks OpenGL for no errors. All raise GpuMemoryError with one line that
    says for what there was no memory, and how much.
    """

    def __init__(self, gl: moderngl.Context, limit_bytes: int | None = None) -> None:
        """`limit_bytes`: never give more in all; None: what the driver has."""
        self._gl = gl
        self._limit = limit_bytes
        self._given: list[tuple[Releasable, int]] = []
        self._open: list[list[Releasable]] = []

    @property
    def bytes_given(self) -> int:
        """Bytes of all that has not been freed; known only where there is a limit."""
        self._given = [(made, size) for made, size in self._given if not is_released(made)]
        return sum(size for _, size in self._given)

    @property
    def objects_given(self) -> int:
        """Objects that have not been freed; known only where there is a limit."""
        return sum(not is_released(made) for made, _ in self._given)

    def allows(self, what: str, size: int) -> bool:
        """Whether the limit has room for `size` bytes more; `what` is for those who refuse by name."""
        return self._limit is None or self.bytes_given + size <= self._limit

    def _take_errors(self) -> set[str]:
        """OpenGL's errors since the last call, which are then forgotten."""
        errors: set[str] = set()
        for _ in range(MOST_ERRORS):
            error = str(self._gl.error)
            if error == NO_ERROR:
                break
            errors.add(error)
        return errors

    def made(self, what: str, size: int, make: Callable[[], Made]) -> Made:
        """What `make` makes of `size` bytes, if OpenGL has no error to tell of afterwards; else it is freed again."""
        if not self.allows(what, size):
            raise self._refusal(what, size)
        # What others have left behind is not this request's.
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
        return thing

    def check(self, what: str, size: int, thing: Releasable) -> None:
        """Free `thing` and raise where OpenGL says that it has no memory for it, or nothing as large."""
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
    def whole(self) -> Iterator[None]:
        """Nothing half-done: if the block ends with an exception, all that was made in it is freed."""
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

    def buffer(self, what: str, data: Any = None, reserve: int = 0, dynamic: bool = False) -> moderngl.Buffer:
        """A buffer of `data`, or of `reserve` bytes of anything. `what` names it in the message."""
        size = reserve if data is None else memoryview(data).nbytes
        return self.made(what, size, lambda: self._gl.buffer(data, reserve=reserve, dynamic=dynamic))

    def grown(self, what: str, old: moderngl.Buffer, size: int, dynamic: bool = False) -> moderngl.Buffer:
        """`old`, or where it is smaller than `size` bytes another in its place, without its content."""
        if old.size >= size:
            return old
        made = self.buffer(what, reserve=size, dynamic=dynamic)
        old.release()
        return made

    def check_size(self, what: str, size: tuple[int, int]) -> None:
        """Raises GpuMemoryError where the driver has no textures of this (width, height)."""
        most = int(self._gl.info["GL_MAX_TEXTURE_SIZE"])
        if max(size) > most:
            raise GpuMemoryError(
                f"{what}: {size[0]} x {size[1]} is more than the {most} a side that the GPU's driver allows "
                "(GL_MAX_TEXTURE_SIZE); make it smaller"
            )

    def texture(
        self, what: str, size: tuple[int, int], components: int, data: Any = None, dtype: str = "f1", alignment: int = 1
    ) -> moderngl.Texture:
        """A texture of `size` (width, height), as moderngl makes it."""
        self.check_size(what, size)
        number = size[0] * size[1] * components * TEXEL_TYPES[dtype]
        return self.made(
            what, number, lambda: self._gl.texture(size, components, data, alignment=alignment, dtype=dtype)
        )

    def depth_texture(self, what: str, size: tuple[int, int]) -> moderngl.Texture:
        """A depth texture of `size` (width, height)."""
        self.check_size(what, size)
        return self.made(what, size[0] * size[1] * 4, lambda: self._gl.depth_texture(size))

    def build_mipmaps(self, what: str, texture: moderngl.Texture) -> None:
        """Fill the mips of a texture, which is freed where that fails."""
        self._take_errors()
        texture.build_mipmaps()
        self.check(what, texture.width * texture.height * texture.components // 3, texture)

    def framebuffer(
        self, what: str, colors: list[moderngl.Texture], depth: moderngl.Texture | None = None
    ) -> moderngl.Framebuffer:
        """A framebuffer of these textures."""
        return self.made(what, 0, lambda: self._gl.framebuffer(colors, depth))
