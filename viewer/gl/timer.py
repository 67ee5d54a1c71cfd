"""Times of passes in ms: by timer queries on a GPU, by wall time around `finish()` on a software renderer."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal

from viewer.gl.context import GraphicsContext

TimerKind = Literal["gpu timer query", "wall time around finish"]


class PassTimer:
    """Collects the times of the passes of one frame in ms."""

    def __init__(self, context: GraphicsContext) -> None:
        self._gl = context.gl
        self._by_wall = not context.features.timer_queries
        self._query = None if self._by_wall else context.gl.query(time=True)
        self._times: dict[str, float] = {}
        self._whole: str | None = None
        """What the passes that run now are parts of."""
        self.last_ms = 0.0
        """Time of the last measured pass."""

    @property
    def kind(self) -> TimerKind:
        """How times are measured, for reports."""
        return "wall time around finish" if self._by_wall else "gpu timer query"

    @contextmanager
    def measure_cpu(self, name: str) -> Iterator[None]:
        """Add the wall time of the block, which makes no OpenGL calls, to the pass `name`."""
        start = time.perf_counter()
        yield
        self._add(name, (time.perf_counter() - start) * 1e3)

    @contextmanager
    def measure(self, name: str) -> Iterator[None]:
        """Add the time of the block to the pass `name`."""
        if self._query is not None:
            with self._query:
                yield
            elapsed = self._query.elapsed / 1e6
        else:
            self._gl.finish()
            start = time.perf_counter()
            yield
            self._gl.finish()
            elapsed = (time.perf_counter() - start) * 1e3
        self.last_ms = elapsed
        self._add(name, elapsed)

    @contextmanager
    def counted_as(self, whole: str) -> Iterator[None]:
        """Add the times of the passes of the block to `whole` in place of their own names."""
        self._whole = whole
        try:
            yield
        finally:
            self._whole = None

    def _add(self, name: str, milliseconds: float) -> None:
        key = self._whole or name
        self._times[key] = self._times.get(key, 0.0) + milliseconds

    def take(self) -> dict[str, float]:
        """Times in ms since the last call, by pass, in order of their first measurement."""
        times, self._times = self._times, {}
        return times
