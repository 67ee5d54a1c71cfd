"""Running jobs: attempts, results that ask for another job, order, and processes that die."""

import os
import random
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from ntc.errors import InputError
from viewer.jobs.executor import MOST_ATTEMPTS, Ended, LocalExecutor, RayExecutor, run_jobs


class Shuffled:
    """An executor whose jobs end in any order, in the caller's own thread."""

    def __init__(self, seed: int, slots: int = 4) -> None:
        self.slots, self.most = slots, 0
        self._random, self._waiting = random.Random(seed), dict[int, int]()

    def submit(self, number: int, argument: int) -> None:
        self._waiting[number] = argument
        self.most = max(self.most, len(self._waiting))

    def wait(self, seconds: float) -> Sequence[Ended[int]]:
        number = self._random.choice(sorted(self._waiting))
        argument = self._waiting.pop(number)
        return [Ended(number, None, f"{argument} is odd") if argument % 2 else Ended(number, argument * 10)]

    def close(self) -> None:
        pass


@pytest.mark.parametrize("seed", range(3))
def test_every_job_ends_once_and_what_fails_is_tried_three_times(seed: int) -> None:
    executor, found, again = Shuffled(seed), list[int](), list[str]()
    failures = run_jobs(
        executor, range(20), lambda _job, result, _attempt: found.append(result), tried_again=again.append
    )
    assert sorted(found) == [each * 10 for each in range(0, 20, 2)]
    assert sorted(each.argument for each in failures) == list(range(1, 20, 2))
    assert {each.problem for each in failures} == {f"{each} is odd" for each in range(1, 20, 2)}
    assert len(again) == 10 * (MOST_ATTEMPTS - 1)
    assert executor.most == executor.slots


def test_a_result_may_ask_for_another_job_or_be_a_failure() -> None:
    seen = list[tuple[int, int]]()

    def take(argument: int, result: int, attempt: int) -> int | str | None:
        seen.append((argument, attempt))
        return 100 if argument == 2 else "is not kept" if argument == 4 else None

    failures = run_jobs(Shuffled(0, 1), [2, 4], take)
    assert seen == [(2, 0), (100, 0), (4, 0), (4, 1), (4, 2)]
    assert [(each.argument, each.problem) for each in failures] == [(4, "is not kept")]


def test_arguments_are_asked_for_when_a_slot_is_free_and_a_stop_ends_all() -> None:
    done, asked = list[int](), list[int]()

    def arguments() -> object:
        for each in range(0, 1000, 2):
            asked.append(each)
            yield each

    run_jobs(Shuffled(0), arguments(), lambda _job, result, _attempt: done.append(result), lambda: len(done) >= 5)  # type: ignore[arg-type]
    assert len(done) == 5
    assert len(asked) <= 9


def fate(place: str) -> int:
    """Dies the first time that it is asked, refuses the second time, and then answers with its process."""
    path = Path(place)
    count = len(path.read_text()) if path.exists() else 0
    path.write_text("x" * (count + 1))
    if count == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    if count == 1:
        raise InputError("not yet")
    return os.getpid()


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_jobs_of_a_killed_worker_are_done_by_another(tmp_path: Path) -> None:
    executor = LocalExecutor(fate, 2)
    found, again = list[int](), list[str]()
    try:
        places = [str(tmp_path / str(number)) for number in range(3)]
        assert not run_jobs(executor, places, lambda _job, result, _: found.append(result), tried_again=again.append)
    finally:
        executor.close()
    assert len(found) == 3
    assert os.getpid() not in found
    assert sum("gave no answer" in line for line in again) == 3
    assert again.count("not yet") == 3


def test_what_cannot_be_is_said_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="--workers 0: must be at least 1"):
        LocalExecutor(fate, 0)
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(InputError, match=r"needs the extra `ray`: pip install 'ntc-viewer\[ray\]'"):
        RayExecutor(fate, "auto")
