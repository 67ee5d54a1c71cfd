"""Times of passes in ms, either waited for, or read some frames later from timestamps of the GPU."""

import ctypes
import time
from collections import deque
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal

from viewer.gl import functions as names
from viewer.gl.context import GraphicsContext
from viewer.gl.functions import GlFunctions

TimerKind = Literal["gpu timer query", "wall time around finish", "timestamps between passes"]
MOST_FRAMES = 8
"""Most frames whose times are awaited; of a slower driver the oldest are given up."""


class Stamps:
    """Timestamps of the GPU in the order of its commands, in ns."""

    def __init__(self, functions: GlFunctions) -> None:
        self._functions = functions
        self._free: list[int] = []

    def put(self) -> int:
        """Let the GPU note the time once it has done all that came before; return the query's name."""
        if not self._free:
            name = ctypes.c_uint()
            self._functions("glGenQueries", 1, ctypes.addressof(name))
            self._free.append(name.value)
        query = self._free.pop()
        self._functions("glQueryCounter", query, names.GL_TIMESTAMP)
        return query

    def is_there(self, query: int) -> bool:
        """Return whether reading would not wait."""
        return bool(self._number("glGetQueryObjectuiv", query, names.GL_QUERY_RESULT_AVAILABLE, ctypes.c_uint()))

    def read(self, query: int) -> int:
        """Return the time in ns; waits where it is not there."""
        return self._number("glGetQueryObjectui64v", query, names.GL_QUERY_RESULT, ctypes.c_uint64())

    def _number(self, name: str, query: int, what: int, into: Any) -> int:
        self._functions(name, query, what, ctypes.addressof(into))
        return int(into.value)

    def give_back(self, query: int) -> None:
        """Reuse the query, which is not read any more."""
        self._free.append(query)


@dataclass(frozen=True, eq=False)
class _Measurement:
    """Measurement of one pass in one frame: its time, or the stamps that it lies between."""

    name: str | None
    """Name of the pass; None where only `note` wants the time."""
    milliseconds: float
    stamps: tuple[int, int] | None = None
    owners: tuple[Hashable, ...] = ()
    note: Callable[[float], None] | None = None


@dataclass(eq=False)
class _Frame:
    measurements: list[_Measurement] = field(default_factory=list)
    stamps: list[int] = field(default_factory=list)
    """Timestamps in their order."""


class PassTimer:
    """Timer that collects the times of passes, frame by frame.

    Where the context waits for the GPU, a frame's times are known at its end. Else the timer does not hold
    the GPU up, and a frame's times arrive two or three frames later.
    """

    def __init__(self, context: GraphicsContext) -> None:
        self._gl, self._blocking = context.gl, context.memory.blocking
        self._functions = context.functions
        self._has_queries = context.features.timer_queries
        self._stamps = Stamps(context.functions)
        self.waits = context.waits
        self._frame = _Frame()
        self._under_way: deque[_Frame] = deque()
        self._owned: dict[Hashable, float] = {}
        self._whole: str | None = None
        """Name that the passes which run now are counted as."""
        self._owners: tuple[Hashable, ...] = ()

    @property
    def kind(self) -> TimerKind:
        """Method of measuring, for reports."""
        if self.waits:
            return "gpu timer query" if self._has_queries else "wall time around finish"
        return "gpu timer query" if self._has_queries else "timestamps between passes"

    @contextmanager
    def measure_cpu(self, name: str) -> Iterator[None]:
        """Add the wall time of the block, which makes no OpenGL calls, to the pass `name`."""
        start = time.perf_counter()
        yield
        self._add(name, None, 1e3 * (time.perf_counter() - start))

    @contextmanager
    def measure(self, name: str) -> Iterator[None]:
        """Add the time of the block to the pass `name`, and to what it is `owned_by`."""
        yield from self._measured(name, None)

    @contextmanager
    def watch(self, note: Callable[[float], None]) -> Iterator[None]:
        """Call `note` with the time of the block in ms when it is known; the block may be a part of what is measured."""
        yield from self._measured(None, note)

    def _measured(self, name: str | None, note: Callable[[float], None] | None) -> Iterator[None]:
        if self.waits:
            yield from self._waited(name, note)
        elif self._has_queries:
            first = self._put()
            yield
            self._add_late(name, note, (first, self._put()))
        elif name is not None:
            yield from self._between(name)
        else:
            start = time.perf_counter()
            yield
            if note is not None:
                # A software renderer has run compute shaders when their call returns.
                note(1e3 * (time.perf_counter() - start))

    def _waited(self, name: str | None, note: Callable[[float], None] | None) -> Iterator[None]:
        if self._has_queries:
            first = self._stamps.put()
            yield
            last = self._stamps.put()
            self._blocking.count += 1
            elapsed = (self._stamps.read(last) - self._stamps.read(first)) / 1e6
            self._stamps.give_back(first)
            self._stamps.give_back(last)
        else:
            self._finish()
            start = time.perf_counter()
            yield
            self._finish()
            elapsed = (time.perf_counter() - start) * 1e3
        self._add(name, note, elapsed)

    def _finish(self) -> None:
        self._blocking.count += 1
        self._gl.finish()

    def _between(self, name: str) -> Iterator[None]:
        """Measure from the end of the pass before: tiled rasterisers note what comes first in a batch of commands at its end, too."""
        first = self._frame.stamps[-1] if self._frame.stamps else self._put()
        yield
        self._add_late(name, None, (first, self._put()))

    def _put(self) -> int:
        query = self._stamps.put()
        self._frame.stamps.append(query)
        if not self._has_queries:
            # A flush makes each pass a separate batch.
            self._functions("glFlush")
        return query

    @contextmanager
    def counted_as(self, whole: str) -> Iterator[None]:
        """Add the times of the passes of the block to `whole` instead of their names."""
        self._whole = whole
        try:
            yield
        finally:
            self._whole = None

    @contextmanager
    def owned_by(self, *owners: Hashable) -> Iterator[None]:
        """Add the times of the passes of the block to `owners`, too, in equal shares (`take_owned`)."""
        before, self._owners = self._owners, owners
        try:
            yield
        finally:
            self._owners = before

    @contextmanager
    def waiting(self) -> Iterator[None]:
        """Wait for the times of the passes of the block."""
        before, self.waits = self.waits, True
        try:
            yield
        finally:
            self.waits = before

    def _add(self, name: str | None, note: Callable[[float], None] | None, milliseconds: float) -> None:
        if name is not None:
            self._frame.measurements.append(_Measurement(self._whole or name, milliseconds))
            if self._whole is None:
                self._share(self._owners, milliseconds)
        if note is not None:
            note(milliseconds)

    def _add_late(self, name: str | None, note: Callable[[float], None] | None, stamps: tuple[int, int]) -> None:
        shown = None if name is None else self._whole or name
        owners = self._owners if shown is not None and self._whole is None else ()
        self._frame.measurements.append(_Measurement(shown, 0.0, stamps, owners, note))

    def _share(self, owners: tuple[Hashable, ...], milliseconds: float) -> None:
        for owner in owners:
            self._owned[owner] = self._owned.get(owner, 0.0) + milliseconds / len(owners)

    def take(self) -> dict[str, float]:
        """End the frame, and return times in ms by pass, in order of their first measurement.

        They are those of this frame where the timer waits, else of a frame before whose times have arrived; {} where none have.
        """
        if self._frame.measurements:
            self._under_way.append(self._frame)
            self._frame = _Frame()
        if self._under_way and self._under_way[-1].stamps:
            # Commands that are never sent to the GPU never arrive.
            self._functions("glFlush")
        times: dict[str, float] = {}
        while self._under_way and self._is_there(self._under_way[0]):
            times = self._times(self._under_way.popleft())
            if times:
                break
        while len(self._under_way) > MOST_FRAMES:
            self._give_back(self._under_way.popleft())
        return times

    def take_owned(self) -> Mapping[Hashable, float]:
        """Return the times in ms that have arrived since the last call, by owner."""
        owned, self._owned = self._owned, {}
        return owned

    def forget(self) -> None:
        """Leave what was measured since the last frame out of all frames."""
        self._give_back(self._frame)
        self._frame, self._owned = _Frame(), {}

    def _is_there(self, frame: _Frame) -> bool:
        return not frame.stamps or self._stamps.is_there(frame.stamps[-1])

    def _give_back(self, frame: _Frame) -> None:
        for query in frame.stamps:
            self._stamps.give_back(query)

    def _times(self, frame: _Frame) -> dict[str, float]:
        at = {query: self._stamps.read(query) for query in frame.stamps}
        self._give_back(frame)
        times: dict[str, float] = {}
        for measurement in frame.measurements:
            elapsed = measurement.milliseconds
            if measurement.stamps is not None:
                first, last = measurement.stamps
                elapsed = max(at[last] - at[first], 0) / 1e6
                if measurement.note is not None:
                    measurement.note(elapsed)
            if measurement.name is not None:
                times[measurement.name] = times.get(measurement.name, 0.0) + elapsed
            self._share(measurement.owners, elapsed)
        return times
