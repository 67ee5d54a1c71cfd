"""Reads for a panel what the picture holds at a place: behind a fence, and anew only when something has changed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from numpy.typing import NDArray

from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.read_back import PicturePart, ReadBack

Content = TypeVar("Content")


@dataclass(frozen=True, eq=False)
class Asked(Generic[Content]):
    """Parts of pictures, and what they tell."""

    parts: Sequence[PicturePart]
    make: Callable[[Sequence[NDArray[Any]]], Content]
    """Is given each part as `PicturePart.array` does."""


class PlaceReader(Generic[Content]):
    """Remembers what was read last. Unless frames wait, that is of a frame or two before while the picture moves."""

    def __init__(self, context: GraphicsContext, what: str) -> None:
        """`what` is named where there is no memory."""
        self._context = context
        self._back = ReadBack[Asked[Content]](context, what)
        self._subject: object = None
        self._key: object = None
        self._content: Content | None = None
        self.reads = 0
        """Times that something was asked for."""

    @property
    def is_pending(self) -> bool:
        """Whether something newer is on its way."""
        return self._back.is_pending

    def read(self, subject: object, key: object, ask: Callable[[], Asked[Content]]) -> Content | None:
        """What is there; None before anything is.

        `ask` is called when `key` has changed. Nothing of another `subject` is given. Raises ContextLostError.
        """
        if subject != self._subject:
            self.forget()
            self._subject = subject
        if key != self._key:
            asked = ask()
            self._key = key
            self.reads += 1
            try:
                self._back.copy_parts(asked.parts, asked)
            except GpuMemoryError:
                # Without a copy it is waited for.
                self._back.drop()
                self._make(asked, [part.read() for part in asked.parts])
        arrived = self._back.wait() if self._context.waits else self._back.newest()
        if arrived is not None:
            content, asked = arrived
            read, at = list[NDArray[Any]](), 0
            for part in asked.parts:
                read.append(part.array(content[at : at + part.byte_count]))
                at += part.byte_count
            self._make(asked, read)
        return self._content

    def _make(self, asked: Asked[Content], read: Sequence[NDArray[Any]]) -> None:
        # What a lost context gives is void, and may name textures that are not there.
        self._context.reset.check()
        self._content = asked.make(read)

    def forget(self) -> None:
        """Nobody looks: drop what is there and what is on its way."""
        self._back.drop()
        self._subject = self._key = self._content = None

    def release(self) -> None:
        """Free the buffers."""
        self.forget()
        self._back.release()
