"""Many jobs in processes of this machine or in tasks of a Ray cluster. A job that fails is tried again, and named at last.

Ray is an extra of its own.
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
"""Environment of workers: one for each core, and numbers that do not depend on how many threads add them up."""
MOST_ATTEMPTS = 3
SECONDS_BETWEEN_QUESTIONS = 0.2
"""Time between questions to `stopped` while no job ends, in seconds."""
CPU, GPU = "CPU", "GPU"
Argument = TypeVar("Argument")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Workers(Generic[Argument, Result]):
    """Workers that call one function, each for one argument at a time. Any of them may be lost."""

    slots: Callable[[], int]
    """Returns the number of jobs that run at the same time, at least 1. It may change while machines come and go."""
    submit: Callable[[Argument], Future[Result]]
    """Begins a job; at most `slots` at the same time."""


@contextmanager
def local_workers(function: Callable[[Argument], Result], count: int) -> Iterator[Workers[Argument, Result]]:
    """Yield `count` helper processes of this machine, which end with the block, in the middle of a job too.

    `function` is found by its module and name. Raises InputError for less than one process.
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
    """Yield the cores of the Ray cluster at `address` (`auto`: the one that runs on this machine), each with a share `gpus` of a GPU.

    Raises InputError without Ray, where no cluster answers, and where it has no such GPU.
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

    # Leaving the cluster ends the tasks that are under way.
    try:
        if gpus > 0.0 and ray.cluster_resources().get(GPU, 0.0) < min(gpus, 1.0):
            raise InputError(f"--gpus-per-job {gpus:g}: the cluster at {address} has no GPU; leave it out")
        # Whoever runs the jobs counts attempts, so Ray does not begin tasks again.
        options = {"num_cpus": 1, "num_gpus": gpus, "max_retries": 0, "scheduling_strategy": "SPREAD"}
        task = ray.remote(function).options(**options, runtime_env={"env_vars": ONE_THREAD})
        yield Workers(slots, lambda argument: task.remote(argument).future())
    finally:
        ray.shutdown()


@dataclass(frozen=True, eq=False)
class Failure(Generic[Argument]):
    """A job that failed every time."""

    argument: Argument
    problem: str
    """Error of the last attempt, one line."""


def _problem(error: BaseException) -> str:
    """Return one line: why a job failed."""
    # Ray wraps what the function raised.
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
    """Run a job for each argument and hand the results to `take` as they come; returns the jobs that failed MOST_ATTEMPTS times.

    A job that failed so often is cut into `parts`, where it has some: those fail alone that must. Arguments are asked for when a slot
    is free, so neither they nor results pile up. `stopped` ends the run early; jobs that are under way then are lost. `tried_again`
    gets the reason why a job is begun once more.
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
