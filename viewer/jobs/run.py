"""Running many jobs in an executor: each is tried again elsewhere when it fails, and named when it fails again and again."""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Generic

from viewer.jobs.executor import Executor
from viewer.jobs.function_process import Argument
from viewer.jobs.job import Result

MOST_ATTEMPTS = 3
SECONDS_BETWEEN_QUESTIONS = 0.2
"""How often `stopped` is asked while no job ends."""


@dataclass(frozen=True, eq=False)
class Failure(Generic[Argument]):
    """A job that failed every time."""

    argument: Argument
    problem: str
    """Of the last attempt, one line."""


Take = Callable[[Argument, Result, int], Argument | str | None]
"""(argument, result, attempt from 0) -> None: it is kept. A line: the job failed. Another argument: that job is to be done instead."""


@dataclass(frozen=True, eq=False)
class _Due(Generic[Argument]):
    argument: Argument
    attempt: int


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
    coming, again = iter(arguments), deque[_Due[Argument]]()
    under_way: dict[int, _Due[Argument]] = {}
    failures, number = list[Failure[Argument]](), 0

    def failed(due: _Due[Argument], problem: str, cut: Sequence[Argument]) -> None:
        if due.attempt + 1 < MOST_ATTEMPTS:
            tried_again(problem)
            again.append(_Due(due.argument, due.attempt + 1))
        elif cut:
            tried_again(problem)
            again.extend(_Due(each, 0) for each in cut)
        else:
            failures.append(Failure(due.argument, problem))

    while not stopped():
        while len(under_way) < executor.slots:
            due = again.popleft() if again else next((_Due(each, 0) for each in coming), None)
            if due is None:
                break
            executor.submit(number, due.argument, due.attempt)
            under_way[number] = due
            number += 1
        if not under_way:
            break
        for ended in executor.wait(SECONDS_BETWEEN_QUESTIONS):
            due = under_way.pop(ended.number)
            if ended.result is None:
                failed(due, ended.problem, parts(due.argument))
                continue
            answer = take(due.argument, ended.result, due.attempt)
            if isinstance(answer, str):
                failed(due, answer, ())
            elif answer is not None:
                again.append(_Due(answer, 0))
    return failures
