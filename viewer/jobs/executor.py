"""Where jobs run: the interface of all executors, and the one of this machine, a process for each slot."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, wait
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from ntc.errors import InputError
from viewer.jobs.function_process import Argument, FunctionProcess
from viewer.jobs.job import Job, Result

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment of workers: one for each core, and numbers that do not depend on how many threads add them up."""
Given_contra = TypeVar("Given_contra", contravariant=True)
Found_co = TypeVar("Found_co", covariant=True)


@dataclass(frozen=True, eq=False)
class Ended(Generic[Found_co]):
    """One job that came to an end."""

    number: int
    """The job's own."""
    result: Found_co | None
    """None where it failed."""
    problem: str = ""
    """One line: why it failed; the worker was killed, its machine is gone, or what the function raised."""


class Executor(Protocol[Given_contra, Found_co]):
    """Calls one function for many arguments, in workers that may be lost. Called from one thread."""

    @property
    def slots(self) -> int:
        """Jobs that run at the same time; may change while machines come and go. At least 1."""
        ...

    def submit(self, number: int, argument: Given_contra, attempt: int) -> None:
        """Begin a job; `attempt` counts from 0. One that failed is begun in another process, on another machine where there is one."""
        ...

    def wait(self, seconds: float) -> Sequence[Ended[Found_co]]:
        """The jobs that have ended since; waits for one at most so long."""
        ...

    def close(self) -> None:
        """End all workers, in the middle of a job too."""
        ...


class LocalExecutor(Generic[Argument, Result]):
    """Spawned processes of this machine, one for each slot. A process that failed a job is ended: the next one begins anew."""

    def __init__(self, function: Callable[[Argument], Result], workers: int) -> None:
        """`function` is found by its module and name. Raises InputError for less than one worker."""
        if workers < 1:
            raise InputError(f"--workers {workers}: must be at least 1")
        self._function = function
        self._before = {name: os.environ.get(name) for name in ONE_THREAD}
        os.environ.update(ONE_THREAD)
        self._free = [self._process(number) for number in range(workers)]
        self._busy: dict[int, tuple[FunctionProcess[Argument, Result], Job[Result]]] = {}
        self.slots = workers

    def _process(self, number: int) -> FunctionProcess[Argument, Result]:
        return FunctionProcess(self._function, f"worker {number}")

    def submit(self, number: int, argument: Argument, attempt: int) -> None:
        """Begin a job in a process that is free."""
        del attempt
        process = self._free.pop(0)
        self._busy[number] = (process, process.call(argument))

    def wait(self, seconds: float) -> list[Ended[Result]]:
        """The jobs that have ended."""
        futures = {job.future: number for number, (_, job) in self._busy.items()}
        done, _ = wait(futures, seconds, FIRST_COMPLETED)
        return [self._ended(number) for number in sorted(futures[future] for future in done)]

    def _ended(self, number: int) -> Ended[Result]:
        process, job = self._busy.pop(number)
        try:
            ended = Ended(number, job.result())
        except InputError as error:
            process.close()
            process = FunctionProcess(self._function, process.name)
            ended = Ended(number, None, str(error))
        # Behind the others: a job that is tried again goes elsewhere.
        self._free.append(process)
        return ended

    def close(self) -> None:
        """End all processes."""
        for process in [*self._free, *(process for process, _ in self._busy.values())]:
            process.close()
        for name, value in self._before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
