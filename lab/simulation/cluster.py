"""Encoding a library on a simulated cluster: jobs, machines that fail, stragglers, shared storage, one process that writes.

Discrete events by simpy. Storage and the writer's network are servers that serve one request after the other at their full rate: the
same throughput as if requests shared it, and the same point at which they are overloaded.
"""

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import numpy as np
import simpy

MOST_ATTEMPTS = 3
"""Of a job, as in `ntc-viewer encode`: one that is lost as often is named in the report."""
Steps = Generator[simpy.Event, Any, None]


@dataclass(frozen=True)
class Job:
    """What each job takes."""

    textures: int
    compute_seconds: float
    """Of one thread, all textures together."""
    read_bytes: float
    """Of images, from shared storage."""
    result_bytes: float
    """Of the shard."""


@dataclass(frozen=True)
class Cluster:
    """Machines, and what they share."""

    nodes: int
    slots: int = 32
    """Jobs that a node runs at the same time."""
    storage_bytes_a_second: float = 10e9
    """Of shared storage, reading."""
    writer_bytes_a_second: float = 1.25e9
    """Network of the process that writes shards; infinite where workers write them themselves."""
    index_seconds: float = 0.01
    """To append a line to the index and wait until it is on disk."""
    hours_between_failures: float = float("inf")
    """Of one node, on average."""
    repair_seconds: float = 600.0
    straggler_share: float = 0.0
    """Of jobs."""
    straggler_factor: float = 5.0
    """How many times as long they compute."""
    spread: float = 0.1
    """Standard deviation of the logarithm of compute times."""


@dataclass(frozen=True)
class Outcome:
    """What a run came to."""

    seconds: float
    """Until the last job ended."""
    done: int
    """Jobs."""
    lost: int
    """Jobs that were lost MOST_ATTEMPTS times."""
    attempts: int
    """Jobs begun."""
    compute_share: float
    """Of all slots' time: spent computing what was kept."""
    writer_share: float
    """Of the time: the writer at work."""
    storage_share: float
    """Of the time: shared storage at work."""
    writer_wait_seconds: float
    """Mean over jobs: from the end of computing until the writer begins."""


class _Run:
    """One simulation."""

    def __init__(self, jobs: int, job: Job, cluster: Cluster, seed: int) -> None:
        self._job, self._cluster, self._left = job, cluster, jobs
        self._random = np.random.default_rng(seed)
        self._environment = simpy.Environment()
        self._queue: list[tuple[float, int]] = [(self._compute_seconds(), 0) for _ in range(jobs)][::-1]
        self._storage = simpy.Resource(self._environment)
        self._writer = simpy.Resource(self._environment)
        self._waiting: list[simpy.Event] = []
        self._all_ended = self._environment.event()
        self.done = self.lost = self.attempts = 0
        self.kept_seconds = self.writer_seconds = self.storage_seconds = self.waited_seconds = 0.0

    def _compute_seconds(self) -> float:
        cluster, job = self._cluster, self._job
        factor = cluster.straggler_factor if self._random.random() < cluster.straggler_share else 1.0
        spread = self._random.lognormal(0.0, cluster.spread) if cluster.spread > 0.0 else 1.0
        return job.compute_seconds * factor * spread

    def run(self) -> float:
        """Simulate; the seconds until all jobs have ended."""
        for _ in range(self._cluster.nodes):
            slots = [self._environment.process(self._slot()) for _ in range(self._cluster.slots)]
            if np.isfinite(self._cluster.hours_between_failures):
                self._environment.process(self._failures(slots))
        if self._left:
            self._environment.run(self._all_ended)
        return float(self._environment.now)

    def _failures(self, slots: list[simpy.Process]) -> Steps:
        while True:
            pause = self._random.exponential(self._cluster.hours_between_failures * 3600.0)
            yield self._environment.timeout(pause)
            for slot in slots:
                slot.interrupt()

    def _slot(self) -> Steps:
        """One slot: job after job, until its node fails, is repaired, and goes on."""
        while True:
            job: tuple[float, int] | None = None
            try:
                while not self._queue:
                    waiting = self._environment.event()
                    self._waiting.append(waiting)
                    yield waiting
                job = self._queue.pop()
                self.attempts += 1
                yield from self._work(job[0])
            except simpy.Interrupt:
                if job is not None:
                    self._again(job)
                yield from self._repair()
                continue
            self.done += 1
            self.kept_seconds += job[0]
            self._end_one()

    def _repair(self) -> Steps:
        until = self._environment.now + self._cluster.repair_seconds
        while self._environment.now < until:
            try:
                yield self._environment.timeout(until - self._environment.now)
            except simpy.Interrupt:
                until = self._environment.now + self._cluster.repair_seconds

    def _work(self, compute_seconds: float) -> Steps:
        cluster, job = self._cluster, self._job
        read = job.read_bytes / cluster.storage_bytes_a_second
        with self._storage.request() as turn:
            yield turn
            yield self._environment.timeout(read)
            self.storage_seconds += read
        yield self._environment.timeout(compute_seconds)
        write = job.result_bytes / cluster.writer_bytes_a_second + cluster.index_seconds
        ready = self._environment.now
        with self._writer.request() as turn:
            yield turn
            self.waited_seconds += self._environment.now - ready
            yield self._environment.timeout(write)
            self.writer_seconds += write

    def _again(self, job: tuple[float, int]) -> None:
        seconds, failed = job
        if failed + 1 >= MOST_ATTEMPTS:
            self.lost += 1
            self._end_one()
            return
        self._queue.append((seconds, failed + 1))
        if self._waiting:
            self._waiting.pop().succeed()

    def _end_one(self) -> None:
        self._left -= 1
        if self._left == 0:
            self._all_ended.succeed()


def simulate(jobs: int, job: Job, cluster: Cluster, seed: int = 0) -> Outcome:
    """Run `jobs` jobs, all alike but for their spread, on `cluster`. The same seed gives the same outcome."""
    run = _Run(jobs, job, cluster, seed)
    seconds = run.run()
    slot_seconds = max(seconds * cluster.nodes * cluster.slots, 1e-12)
    return Outcome(
        seconds,
        run.done,
        run.lost,
        run.attempts,
        run.kept_seconds / slot_seconds,
        run.writer_seconds / max(seconds, 1e-12),
        run.storage_seconds / max(seconds, 1e-12),
        run.waited_seconds / max(run.attempts, 1),
    )
