"""A number of threads for encoding that grows while that pays; waiting threads do not spin. Needs no torch until it encodes."""

import os
import statistics
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")
MOST_THREADS = 8
SAMPLES = 3
"""Items that are timed at a number of threads before the next one is tried."""
LEAST_GAIN = 1.15
"""More threads stay only where they do so much more in the same time."""


def wait_passively() -> None:
    """Keep torch's threads from spinning while they wait: with another program on one of two cores, that took 2.8 times as long.

    Before torch is imported; what the user has set stays."""
    for name, value in (("OMP_WAIT_POLICY", "passive"), ("KMP_BLOCKTIME", "0")):
        os.environ.setdefault(name, value)


def usable_cores() -> int:
    """Processor cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def most_threads() -> int:
    """Threads at most where nobody says otherwise."""
    return min(usable_cores(), MOST_THREADS)


class PacedThreads:
    """Maps functions over items in threads. It begins with one, times the first items, and takes twice as many as long as that pays.

    The functions must release Python's lock for most of their time, and give the same results whatever runs beside them. Use in a
    `with` block.
    """

    def __init__(self, most: int | None = None, count: int = 1) -> None:
        """`most` threads; None: one for each core, up to MOST_THREADS. `count`: how many it begins with."""
        self._most = most_threads() if most is None else most
        self.count = min(count, self._most)
        """Items that are under way at the same time."""
        self._settled = self.count == self._most
        self._cost: dict[int, list[float]] = {}
        """Seconds that an item took, relative to its size, by number of threads."""
        self._pool: ThreadPoolExecutor | None = None

    def __enter__(self) -> "PacedThreads":
        return self

    def __exit__(self, *_exception: object) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def map(self, work: Callable[[Item], Result], items: Sequence[Item], sizes: Sequence[int]) -> Iterator[Result]:
        """Results in the order of `items`, whose work grows with `sizes` (above 0). While nobody asks for the next one, no more than
        `count` items are worked on. Raises what `work` raises."""
        waiting: deque[Future[tuple[Result, float]] | tuple[Result, float]] = deque()
        timed: deque[tuple[int, int] | None] = deque()
        for item, size in zip(items, sizes, strict=True):
            full = len(waiting) == self.count - 1
            timed.append((self.count, size) if full else None)
            waiting.append(_timed(work, item) if self.count == 1 else self._submit(work, item))
            while len(waiting) >= self.count:
                yield self._taken(waiting.popleft(), timed.popleft())
        while waiting:
            yield self._taken(waiting.popleft(), timed.popleft())

    def _submit(self, work: Callable[[Item], Result], item: Item) -> "Future[tuple[Result, float]]":
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self._most, "encode")
        return self._pool.submit(_timed, work, item)

    def _taken(
        self, found: "Future[tuple[Result, float]] | tuple[Result, float]", timed: tuple[int, int] | None
    ) -> Result:
        result, seconds = found.result() if isinstance(found, Future) else found
        if timed is not None and not self._settled:
            self._cost.setdefault(timed[0], []).append(seconds / timed[1])
            self._choose()
        return result

    def _choose(self) -> None:
        # The first item at each number of threads has things done for the first time, or another number of others beside it.
        costs = self._cost.get(self.count, [])[1:]
        if len(costs) < SAMPLES:
            return
        before = self._cost.get(self.count // 2, [])[1:]
        # Twice as many items are under way.
        if before and 2.0 * statistics.median(before) < LEAST_GAIN * statistics.median(costs):
            self.count, self._settled = self.count // 2, True
        elif self.count * 2 > self._most:
            self._settled = True
        else:
            self.count *= 2


def mapped(work: Callable[[Item], Result], items: Sequence[Item], threads: int) -> list[Result]:
    """Results of `work`, in the order of `items`, by at most so many threads. Raises what `work` raises."""
    if threads <= 1 or len(items) <= 1:
        return [work(item) for item in items]
    with ThreadPoolExecutor(min(threads, len(items)), "part") as pool:
        return list(pool.map(work, items))


def _timed(work: Callable[[Item], Result], item: Item) -> tuple[Result, float]:
    began = time.perf_counter()
    result = work(item)
    return result, time.perf_counter() - began
