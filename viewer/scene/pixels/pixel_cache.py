"""Decoded pixels that stay in memory up to a number of bytes; those that were not used for longest go first."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Protocol, TypeVar, cast

LARGEST_CACHE = 1 << 29
"""Bytes of one scene."""


class Sized(Protocol):
    """What takes memory."""

    @property
    def nbytes(self) -> int:
        """Bytes of memory."""
        ...


Content = TypeVar("Content", bound=Sized)


class PixelCache:
    """Content by key. Any thread may ask; what several ask for at once is made once."""

    def __init__(self, most_bytes: int = LARGEST_CACHE) -> None:
        self._lock = threading.Lock()
        self._most_bytes = most_bytes
        self._kept: OrderedDict[Hashable, Sized] = OrderedDict()
        self._being_made: dict[Hashable, threading.Event] = {}
        self._bytes = 0
        self.made = 0
        """How often something was made because it was not there."""

    @property
    def nbytes(self) -> int:
        """Bytes of what is kept: never more than allowed."""
        return self._bytes

    def offer(self, key: Hashable, content: Sized) -> None:
        """Keep `content` if there is room for it without removing anything."""
        with self._lock:
            if key not in self._kept and self._bytes + content.nbytes <= self._most_bytes:
                self._keep(key, content)

    def get(self, key: Hashable, make: Callable[[], Content]) -> Content:
        """What is kept under `key`, which always means the same, else what `make` returns. What it raises is not kept."""
        while True:
            with self._lock:
                if key in self._kept:
                    self._kept.move_to_end(key)
                    return cast(Content, self._kept[key])
                waits_for = self._being_made.get(key)
                if waits_for is None:
                    mine = self._being_made[key] = threading.Event()
                    break
            waits_for.wait()
        try:
            content = make()
            with self._lock:
                self.made += 1
                if content.nbytes <= self._most_bytes:
                    self._keep(key, content)
            return content
        finally:
            with self._lock:
                del self._being_made[key]
            mine.set()

    def _keep(self, key: Hashable, content: Sized) -> None:
        self._kept[key] = content
        self._bytes += content.nbytes
        while self._bytes > self._most_bytes:
            _, oldest = self._kept.popitem(last=False)
            self._bytes -= oldest.nbytes
