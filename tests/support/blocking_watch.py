"""Second count of the calls that wait for the GPU, taken in moderngl. It finds calls that the viewer's count misses."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

import moderngl

WAITING = (
    (moderngl.Buffer, ("read", "read_into", "read_chunks")),
    (moderngl.Texture, ("read", "read_into")),
    (moderngl.Framebuffer, ("read", "read_into")),
    (moderngl.Context, ("finish",)),
    (moderngl.Query, ("elapsed",)),
)
READ_BACK = "read_back.py"
"""Reads what has arrived: that waits for nothing."""


@contextmanager
def watched_calls() -> Iterator[list[str]]:
    """Names of the calls that wait, of objects that are made in the block."""
    calls: list[str] = []

    def noted(name: str, method: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            caller = sys._getframe(1).f_code.co_filename
            if not caller.endswith(READ_BACK):
                calls.append(f"{name} in {caller}")
            return method(*arguments, **options)

        return call

    def watched(kind: type, name: str) -> Any:
        method: Any = getattr(kind, name)
        label = f"{kind.__name__}.{name}"
        getter: Any = getattr(method, "fget", None)
        return mock.patch.object(kind, name, noted(label, method) if getter is None else property(noted(label, getter)))

    patches = [watched(kind, name) for kind, names in WAITING for name in names]
    for patch in patches:
        patch.start()
    try:
        yield calls
    finally:
        for patch in patches:
            patch.stop()
