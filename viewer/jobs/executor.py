"""Many jobs in processes of this machine or in tasks of a Ray cluster (extra `ray`), with retries.

As many jobs run as there are slots; each result is handed over as it comes. A job that fails, or whose process or machine is lost, is
tried up to MOST_ATTEMPTS times. If it still fails, it is cut into parts, such as halves, each with as many attempts. One broken image
then fails alone, and the other textures of its job are encoded.
"""

import importlib
import math
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from ntc.errors import InputError, ProcessEndedError
from ntc.worker.helpers import Helpers
from viewer.jobs.job import Job

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment of workers: there is one for each core, and sums must not depend on the number of threads."""
MOST_ATTEMPTS = 3
SECONDS_BETWEEN_QUESTIONS = 0.2
"""Seconds between calls of `stopped` while no job ends."""
CPU, GPU = "CPU", "GPU"
Argument = TypeVar("Argument")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Workers(Generic[Argument, Result]):
    """Workers that each call one function for one argument at a time. Any of them may be lost."""

    slots: Callable[[], int]
    """Function that returns the number of jobs that run at the same time, at least 1. It may change as machines come and go."""
    submit: Callable[[Argument], Future[Result]]
    """Function that begins a job. At most `slots` jobs may run at the same time."""


@contextmanager
def local_workers(function: Callable[[Argument], Result], count: int) -> Iterator[Workers[Argument, Result]]:
    """Yield `count` helper processes of this machine. They end with the block, even in the middle of a job.

    Processes import `function` by its module and name. Raises InputError for less than one process.
    """
    if count < 1:
        raise InputError(f"--workers {count}: must be at least 1")
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    helpers = Helpers(idle_seconds=math.inf, niceness=0)

    def submit(argument: Argument) -> Future[Result]:
        return Job(lambda _report: helpers.call("job", function, argument)).start("job").future

    try:
        yield Workers(lambda: count, submit)
    finally:
        helpers.close()
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def ray_workers(
    function: Callable[[Argument], Result], address: str, gpus: float = 0.0
) -> Iterator[Workers[Argument, Result]]:
    """Yield the cores of the Ray cluster at `address` (`auto`: the cluster on this machine) as workers, each with a share `gpus` of
    a GPU.

    Raises InputError without Ray, where no cluster answers, and where the cluster has no GPU.
    """
    try:
        ray: Any = importlib.import_module("ray")
    except ImportError as error:
        raise InputError("--ray: needs the extra `ray`: pip install 'ntc-viewer[ray]'") from error
    try:
        ray.init(address=address, log_to_driver=False, configure_logging=False, logging_level="error")
    except (ConnectionError, RuntimeError, ValueError, OSError) as error:
        raise InputError(f"--ray {address}: no cluster answers ({error}); start one with: ray start --head") from error

    def slots() -> int:
        resources = ray.cluster_resources()
        most = resources.get(CPU, 1.0)
        return max(1, int(min(most, resources.get(GPU, 0.0) / gpus) if gpus > 0.0 else most))

    # Leaving the cluster ends its running tasks.
    try:
        if gpus > 0.0 and ray.cluster_resources().get(GPU, 0.0) < min(gpus, 1.0):
            raise InputError(f"--gpus-per-job {gpus:g}: the cluster at {address} has no GPU; leave it out")
        # `run_jobs` retries jobs, so Ray must not.
        options = {"num_cpus": 1, "num_gpus": gpus, "max_retries": 0, "scheduling_strategy": "SPREAD"}
        task = ray.remote(function).options(**options, runtime_env={"env_vars": ONE_THREAD})
        yield Workers(slots, lambda argument: task.remote(argument).future())
    finally:
        ray.shutdown()


@dataclass(frozen=True, eq=False)
class Failure(Generic[Argument]):
    """Job that failed in every attempt."""

    argument: Argument
    problem: str
    """Error of the last attempt, one line."""


def _problem(error: BaseException) -> str:
    """Return the reason why a job failed, one line."""
    # Ray wraps the exception of the function.
    cause = getattr(error, "cause", None) or error
    ended = cause.__cause__ if isinstance(cause.__cause__, ProcessEndedError) else cause
    name = type(ended).__name__
    if isinstance(ended, ProcessEndedError) or type(ended).__module__.startswith("ray."):
        return f"the worker gave no answer ({name}): its process or machine is gone"
    if isinstance(cause, InputError):
        return str(cause)
    return str(InputError(f"{name}: {cause}"))


def run_jobs(
    workers: Workers[Argument, Result],
    arguments: Iterable[Argument],
    take: Callable[[Argument, Result], None],
    stopped: Callable[[], bool] = lambda: False,
    tried_again: Callable[[str], None] = lambda _problem: None,
    parts: Callable[[Argument], Sequence[Argument]] = lambda _argument: (),
) -> list[Failure[Argument]]:
    """Run a job for each argument, hand the results to `take` as they come, and return the jobs that failed in every attempt.

    A job that failed MOST_ATTEMPTS times is replaced by its `parts`, if it has any. Arguments are taken when a slot is free, so
    neither they nor results pile up. When `stopped` returns True the run ends, and running jobs are lost. `tried_again` receives the
    reason of each retry.
    """
    # Jobs as (argument, attempt).
    coming = ((argument, 1) for argument in arguments)
    again, under_way = deque[tuple[Argument, int]](), dict[Future[Result], tuple[Argument, int]]()
    failures = list[Failure[Argument]]()
    while not stopped():
        while len(under_way) < workers.slots() and (due := again.popleft() if again else next(coming, None)):
            under_way[workers.submit(due[0])] = due
        if not under_way:
            break
        for future in wait(under_way, SECONDS_BETWEEN_QUESTIONS, FIRST_COMPLETED).done:
            argument, attempt = under_way.pop(future)
            error = future.exception()
            if error is None:
                take(argument, future.result())
                continue
            due_again = (
                [(argument, attempt + 1)] if attempt < MOST_ATTEMPTS else [(each, 1) for each in parts(argument)]
            )
            again.extend(due_again)
            if due_again:
                tried_again(_problem(error))
            else:
                failures.append(Failure(argument, _problem(error)))
    return failures
