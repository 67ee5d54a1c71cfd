"""Results of the GPU for the CPU: copied to small buffers, and read a frame or two later without waiting."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Generic, Literal, TypeVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl import functions as names
from viewer.gl.allocation import GpuMemory
from viewer.gl.context import GraphicsContext
from viewer.gl.functions import GlFunctions

Tag = TypeVar("Tag")
FOREVER = 2**63
"""Nanoseconds."""


class Fence:
    """Fence in the stream of commands, which is reached once the GPU has done all commands before it."""

    def __init__(self, functions: GlFunctions) -> None:
        """Put the fence here. What comes before is sent to the GPU."""
        self._functions = functions
        self._sync: int | None = functions("glFenceSync", names.GL_SYNC_GPU_COMMANDS_COMPLETE, 0)
        functions("glFlush")

    def _wait(self, nanoseconds: int) -> bool:
        if self._sync is None:
            return True
        # A lost context answers GL_WAIT_FAILED: what is read then is void, and the end of the frame detects the loss.
        reached = bool(
            self._functions("glClientWaitSync", self._sync, names.GL_SYNC_FLUSH_COMMANDS_BIT, nanoseconds)
            != names.GL_TIMEOUT_EXPIRED
        )
        if reached:
            self.release()
        return reached

    @property
    def is_reached(self) -> bool:
        """True once the GPU has done all that came before; never waits."""
        return self._wait(0)

    def wait(self) -> None:
        """Wait until the GPU has done all that came before."""
        self._wait(FOREVER)

    def release(self) -> None:
        """Free it; a second time does nothing."""
        if self._sync is not None:
            self._functions("glDeleteSync", self._sync)
            self._sync = None


@dataclass(frozen=True, eq=False)
class PicturePart:
    """Rectangle of a picture (the first attachment) with four numbers per pixel."""

    framebuffer: moderngl.Framebuffer
    pixels: tuple[int, int, int, int]
    """Left, top, right, bottom from the upper left corner; inside the picture, not empty."""
    kind: Literal["u4", "f2", "f4"]
    """Type of each number."""

    @property
    def byte_count(self) -> int:
        """Number of bytes of the rectangle."""
        left, top, right, bottom = self.pixels
        return (right - left) * (bottom - top) * 4 * np.dtype(self.kind).itemsize

    @property
    def viewport(self) -> tuple[int, int, int, int]:
        """Left, bottom, width, height as OpenGL counts, from the lower left corner."""
        left, top, right, bottom = self.pixels
        return left, self.framebuffer.height - bottom, right - left, bottom - top

    def array(self, content: bytes) -> NDArray[Any]:
        """Return the bytes that were read as [bottom - top, right - left, 4] of `kind`, row 0 on top."""
        _, _, width, height = self.viewport
        return np.frombuffer(content, self.kind).reshape(height, width, 4)[::-1]

    def read(self) -> NDArray[Any]:
        """Read the rectangle now: [bottom - top, right - left, 4] of `kind`, row 0 on top."""
        return self.array(self.framebuffer.read(self.viewport, components=4, alignment=1, dtype=self.kind))


@dataclass(frozen=True, eq=False)
class _Copy(Generic[Tag]):
    buffer: moderngl.Buffer
    size: int
    fence: Fence
    tag: Tag


class ReadBack(Generic[Tag]):
    """Copies of parts of buffers on their way to the CPU. The newest that has arrived counts; older ones are dropped then."""

    def __init__(self, context: GraphicsContext, what: str) -> None:
        """Take `what`, which names the buffers in error messages."""
        self._functions, self._memory, self._what = context.functions, context.memory, what
        self._under_way: deque[_Copy[Tag]] = deque()
        self._free: list[moderngl.Buffer] = []

    @property
    def is_pending(self) -> bool:
        """True while a copy is under way."""
        return bool(self._under_way)

    def reserve(self, size: int) -> None:
        """Reserve memory for the next copy, of at most `size` bytes. Raises GpuMemoryError."""
        self._free.append(self._buffer(size))

    def copy(self, parts: Sequence[tuple[moderngl.Buffer, int]], tag: Tag) -> None:
        """Copy the first bytes of each of `parts` (buffer, bytes), one after the other. Raises GpuMemoryError.

        Shaders' writes must have been made visible by a barrier. `tag` comes back with the bytes.
        """
        size = sum(count for _, count in parts)
        buffer = self._buffer(size)
        at = 0
        for source, count in parts:
            self._memory.gl.copy_buffer(buffer, source, count, 0, at)
            at += count
        self._under_way.append(_Copy(buffer, size, Fence(self._functions), tag))

    def copy_texture(self, texture: moderngl.Texture, size: int, tag: Tag) -> None:
        """Copy all of a texture of `size` bytes, rows without padding. Raises GpuMemoryError."""
        buffer = self._buffer(size)
        # Method of the class, because that of the object is counted as a call that waits; into a buffer it does not.
        moderngl.Texture.read_into(texture, buffer, alignment=1)
        self._under_way.append(_Copy(buffer, size, Fence(self._functions), tag))

    def copy_parts(self, parts: Sequence[PicturePart], tag: Tag) -> None:
        """Copy parts of pictures, one after the other. Raises GpuMemoryError."""
        size = sum(part.byte_count for part in parts)
        buffer, at = self._buffer(size), 0
        for part in parts:
            # Method of the class, because that of the object is counted as a call that waits; into a buffer it does not.
            moderngl.Framebuffer.read_into(
                part.framebuffer, buffer, part.viewport, 4, alignment=1, dtype=part.kind, write_offset=at
            )
            at += part.byte_count
        self._under_way.append(_Copy(buffer, size, Fence(self._functions), tag))

    def _buffer(self, size: int) -> moderngl.Buffer:
        if self._free and self._free[-1].size >= size:
            return self._free.pop()
        for buffer in self._free:
            buffer.release()
        self._free.clear()
        # Rounded up to a power of two, so buffers that grow slowly are seldom allocated again.
        return readable_buffer(self._memory, self._functions, self._what, 1 << max(size - 1, 0).bit_length())

    def arrived(self, waits: bool) -> tuple[bytes, Tag] | None:
        """Return the newest copy that has arrived since the last call; None where none has. With `waits` all of them arrive."""
        if waits and self._under_way:
            self._memory.blocking.count += not self._under_way[-1].fence.is_reached
            self._under_way[-1].fence.wait()
        arrived = None
        while self._under_way and self._under_way[0].fence.is_reached:
            if arrived is not None:
                self._free.append(arrived.buffer)
            arrived = self._under_way.popleft()
        return None if arrived is None else self._content(arrived)

    def _content(self, copy: _Copy[Tag]) -> tuple[bytes, Tag]:
        # `read` of the class, because that of the object is counted as a call that waits.
        content = moderngl.Buffer.read(copy.buffer, copy.size)
        self._free.append(copy.buffer)
        return content, copy.tag

    def drop(self) -> None:
        """Forget what is under way."""
        while self._under_way:
            copy = self._under_way.popleft()
            copy.fence.release()
            self._free.append(copy.buffer)

    def release(self) -> None:
        """Free everything."""
        self.drop()
        for buffer in self._free:
            buffer.release()
        self._free.clear()


def readable_buffer(memory: GpuMemory, functions: GlFunctions, what: str, size: int) -> moderngl.Buffer:
    """Return a buffer that the driver may keep where the CPU reads fast. Raises GpuMemoryError."""

    def make() -> moderngl.Buffer:
        buffer = memory.gl.buffer(reserve=size)
        functions("glBindBuffer", names.GL_COPY_WRITE_BUFFER, buffer.glo)
        functions("glBufferData", names.GL_COPY_WRITE_BUFFER, size, None, names.GL_STREAM_READ)
        functions("glBindBuffer", names.GL_COPY_WRITE_BUFFER, 0)
        return buffer

    return memory.made(what, size, make)
