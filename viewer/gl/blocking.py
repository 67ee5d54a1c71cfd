"""Counts the calls for which the CPU waits until the GPU has caught up: frames in motion should make none."""

from collections.abc import Callable
from functools import wraps
from typing import Any

READS = ("read", "read_into", "read_chunks", "read_chunks_into")
"""Methods of moderngl's objects that wait."""


class BlockingCalls:
    """Of one context: reads of buffers, textures and framebuffers, `finish`, and queries that were not there yet."""

    def __init__(self) -> None:
        self.count = 0
        """So far."""

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
