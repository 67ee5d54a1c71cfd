"""Many jobs in processes of this machine or in tasks of a Ray cluster. A job that fails is tried again elsewhere, and named at last.

Ray is an extra of its own.
"""

import importlib
import os
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, wait
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from ntc.errors import InputError
from ntc.worker.process import Argument, FunctionProcess
from viewer.jobs.job import Job, JobReport, Result

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment of workers: one for each core, and numbers that do not depend on how many threads add them up."""
MOST_ATTEMPTS = 3
SECONDS_BETWEEN_QUESTIONS = 0.2
"""Time between questions to `stopped` while no job ends, in seconds."""
CPU, GPU = "CPU", "GPU"
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

    def submit(self, number: int, argument: Given_contra) -> None:
        """Begin a job. One that failed is begun in another process, on another machine where there is one."""
        ...

    def wait(self, seconds: float) -> Sequence[Ended[Found_co]]:
        """Return the jobs that have ended since the last call; wait for one for at most `seconds`."""
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
        self._free = [FunctionProcess(function, f"worker {number}") for number in range(workers)]
        self._busy: dict[int, tuple[FunctionProcess[Argument, Result], Job[Result]]] = {}
        self.slots = workers

    def submit(self, number: int, argument: Argument) -> None:
        """Begin a job in a process that is free."""
        process = self._free.pop(0)

        def call(_report: JobReport) -> Result:
            return process.call(argument)

        self._busy[number] = (process, Job(call).start(process.name))

    def wait(self, seconds: float) -> list[Ended[Result]]:
        """Return the jobs that have ended."""
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


def _ray() -> Any:
    try:
        return importlib.import_module("ray")
    except ImportError as error:
        raise InputError("--ray: needs the extra `ray`: pip install 'ntc-viewer[ray]'") from error


class RayExecutor(Generic[Argument, Result]):
    """Tasks of a Ray cluster, each on one core, and a share of a GPU where that is asked for.

    Ray itself does not begin tasks again: whoever runs the jobs counts attempts, whichever executor they run in.
    """

    def __init__(self, function: Callable[[Argument], Result], address: str, gpus: float = 0.0) -> None:
        """`address` of the cluster, or `auto` for the one that runs on this machine. `gpus` for each job, also less than one.

        Raises InputError without Ray, where no cluster answers, and where it has no such GPU.
        """
        self._ray = _ray()
        try:
            self._ray.init(address=address, log_to_driver=False, configure_logging=False, logging_level="error")
        except (ConnectionError, RuntimeError, ValueError, OSError) as error:
            raise InputError(
                f"--ray {address}: no cluster answers ({error}); start one with: ray start --head"
            ) from error
        self._gpus = gpus
        options = {"num_cpus": 1, "num_gpus": gpus, "max_retries": 0, "scheduling_strategy": "SPREAD"}
        self._task = self._ray.remote(function).options(**options, runtime_env={"env_vars": ONE_THREAD})
        self._waiting: dict[Any, int] = {}
        if gpus > 0.0 and self._ray.cluster_resources().get(GPU, 0.0) < min(gpus, 1.0):
            self.close()
            raise InputError(f"--gpus-per-job {gpus:g}: the cluster at {address} has no GPU; leave it out")

    @property
    def slots(self) -> int:
        """Jobs that the cluster has room for at this moment."""
        resources = self._ray.cluster_resources()
        most = resources.get(CPU, 1.0)
        return max(1, int(min(most, resources.get(GPU, 0.0) / self._gpus) if self._gpus > 0.0 else most))

    def submit(self, number: int, argument: Argument) -> None:
        """Begin a job; Ray spreads tasks over its machines."""
        self._waiting[self._task.remote(argument)] = number

    def wait(self, seconds: float) -> list[Ended[Result]]:
        """Return the jobs that have ended."""
        done, _ = self._ray.wait(list(self._waiting), num_returns=1, timeout=seconds)
        return [self._ended(reference) for reference in done]

    def _ended(self, reference: Any) -> Ended[Result]:
        number = self._waiting.pop(reference)
        try:
            return Ended(number, self._ray.get(reference))
        except self._ray.exceptions.RayTaskError as error:
            cause = error.cause
            text = str(cause) if isinstance(cause, InputError) else f"{type(cause).__name__}: {cause}"
            return Ended(number, None, text)
        except self._ray.exceptions.RayError as error:
            return Ended(
                number, None, f"worker: gave no answer ({type(error).__name__}); its process or machine is gone"
            )

    def close(self) -> None:
        """Cancel what is under way, and leave the cluster."""
        for reference in self._waiting:
            self._ray.cancel(reference, force=True)
        self._waiting.clear()
        self._ray.shutdown()


@dataclass(frozen=True, eq=False)
class Failure(Generic[Argument]):
    """A job that failed every time."""

    argument: Argument
    problem: str
    """Error of the last attempt, one line."""


Take = Callable[[Argument, Result, int], Argument | str | None]
"""(argument, result, attempt from 0) -> None: it is kept. A line: the job failed. Another argument: that job is to be done instead."""


def run_jobs(
    executor: Executor[Argument, Result],
    arguments: Iterable[Argument],
    take: Take[Argument, Result],
    stopped: Callable[[], bool] = lambda: False,
    tried_again: Callable[[str], None] = lambda _problem: None,
    parts: Callable[[Argument], Sequence[Argument]] = lambda _argument: (),
) -> list[Failure[Argument]]:
    """Run a job for each argument and hand the results to `take` as they come; returns the jobs that failed MOST_ATTEMPTS times.

    A job that no worker survives, or whose function raises, is cut into `parts` then, where it has some: those fail alone that must.

    Arguments are asked for when a slot is free, so neither they nor results pile up. `stopped` ends it early; jobs that are under
    way then are lost. `tried_again` is told why a job is begun once more.
    """
    # Jobs as (argument, attempt).
    coming = ((argument, 0) for argument in arguments)
    again, under_way = deque[tuple[Argument, int]](), dict[int, tuple[Argument, int]]()
    failures, number = list[Failure[Argument]](), 0

    def failed(argument: Argument, attempt: int, problem: str, cut: Sequence[Argument]) -> None:
        if attempt + 1 < MOST_ATTEMPTS:
            tried_again(problem)
            again.append((argument, attempt + 1))
        elif cut:
            tried_again(problem)
            again.extend((each, 0) for each in cut)
        else:
            failures.append(Failure(argument, problem))

    while not stopped():
        while len(under_way) < executor.slots:
            due = again.popleft() if again else next(coming, None)
            if due is None:
                break
            executor.submit(number, due[0])
            under_way[number] = due
            number += 1
        if not under_way:
            break
        for ended in executor.wait(SECONDS_BETWEEN_QUESTIONS):
            argument, attempt = under_way.pop(ended.number)
            if ended.result is None:
                failed(argument, attempt, ended.problem, parts(argument))
                continue
            answer = take(argument, ended.result, attempt)
            if isinstance(answer, str):
                failed(argument, attempt, answer, ())
            elif answer is not None:
                again.append((answer, 0))
    return failures
