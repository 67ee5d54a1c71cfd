"""Jobs in threads, in processes and on a cluster: results, errors, order, cancelling, and processes that die."""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from ntc.errors import InputError
from tests.support.shuffled_workers import ShuffledWorkers
from viewer.jobs import executor
from viewer.jobs.executor import MOST_ATTEMPTS, local_workers, ray_workers, run_jobs
from viewer.jobs.job import MOST_RESULTS, Background, Job, JobReport, Result
from viewer.state.message_log import details_of

SECONDS = 120.0


def wait_for(background: Background, key: object, work: Callable[[JobReport], Result]) -> Job[Result]:
    for _ in range(500):
        job = background.submit(key, work)
        if job.done:
            return job
        time.sleep(0.01)
    raise AssertionError("nothing came of it")


def test_a_job_is_done_once_and_errors_are_results() -> None:
    background, calls = Background(), []

    def job(report: JobReport) -> int:
        calls.append(threading.current_thread())
        report.progress(1, 2)
        return 7

    def broken(_report: JobReport) -> int:
        raise InputError("no weights") from OSError("disk")

    assert wait_for(background, "a", job).result() == 7
    assert wait_for(background, "a", job).result() == 7
    assert len(calls) == 1
    assert calls[0] is not threading.main_thread()
    assert background.take_news()
    failed = wait_for(background, "b", broken)
    assert failed.problem == "no weights"
    error = failed.future.exception()
    assert error is not None
    assert "OSError: disk" in details_of(error)
    background.close()


def test_a_cancelled_job_ends() -> None:
    background, started = Background(), threading.Event()
    ended: list[bool] = []

    def endless(report: JobReport) -> None:
        try:
            while True:
                started.set()
                report.progress(0, 1)
                time.sleep(0.001)
        finally:
            ended.append(True)

    background.submit("a", endless)
    assert started.wait(5.0)
    background.cancel("a")
    assert wait_for(background, "b", lambda _report: 3).result() == 3
    assert ended == [True]
    background.close()


def test_the_latest_job_comes_first_and_the_last_results_are_kept() -> None:
    background, started, go = Background(), threading.Event(), threading.Event()
    order: list[int] = []

    def first(_report: JobReport) -> None:
        started.set()
        go.wait(SECONDS)

    def later(number: int, _report: JobReport) -> None:
        order.append(number)

    background.submit("first", first)
    assert started.wait(SECONDS)
    for number in range(MOST_RESULTS + 1):
        background.submit(number, partial(later, number))
    go.set()
    began = time.monotonic()
    while background.is_busy:
        assert time.monotonic() - began < SECONDS
        time.sleep(0.01)
    assert order == [*range(MOST_RESULTS, -1, -1)]
    wait_for(background, MOST_RESULTS - 1, partial(later, -1))
    assert order[-1] == 0, "kept"
    wait_for(background, "first", partial(later, -2))
    assert order[-1] == -2, "dropped: it ended before the others"
    background.close()


def test_a_job_that_is_cancelled_before_it_runs() -> None:
    job = Job(lambda _report: 1)
    job.cancel()
    job.run()
    assert job.done
    assert job.problem == "cancelled"
    with pytest.raises(CancelledError):
        job.result()


@pytest.fixture
def _asked_often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(executor, "SECONDS_BETWEEN_QUESTIONS", 0.001)


def of_even(argument: int) -> int:
    if argument % 2:
        raise InputError(f"{argument} is odd")
    return argument * 10


@pytest.mark.usefixtures("_asked_often")
@pytest.mark.parametrize("seed", range(3))
def test_every_job_ends_once_and_what_fails_is_tried_three_times(seed: int) -> None:
    shuffled, found, again = ShuffledWorkers(of_even, seed), list[int](), list[str]()
    failures = run_jobs(
        shuffled.workers, range(20), lambda _job, result: found.append(result), tried_again=again.append
    )
    assert sorted(found) == [each * 10 for each in range(0, 20, 2)]
    assert sorted(each.argument for each in failures) == list(range(1, 20, 2))
    assert {each.problem for each in failures} == {f"{each} is odd" for each in range(1, 20, 2)}
    assert len(again) == 10 * (MOST_ATTEMPTS - 1)
    assert shuffled.most == 4


@pytest.mark.usefixtures("_asked_often")
def test_a_job_that_failed_so_often_is_cut() -> None:
    def total(numbers: list[int]) -> int:
        return sum(map(of_even, numbers))

    def halves(numbers: list[int]) -> list[list[int]]:
        return [numbers[: len(numbers) // 2], numbers[len(numbers) // 2 :]] if len(numbers) > 1 else []

    found = list[int]()
    workers = ShuffledWorkers(total, 0).workers
    failures = run_jobs(workers, [[2, 4, 5, 6]], lambda _job, result: found.append(result), parts=halves)
    assert sorted(found) == [60, 60]
    assert [each.argument for each in failures] == [[5]]


@pytest.mark.usefixtures("_asked_often")
def test_arguments_are_asked_for_when_a_slot_is_free_and_a_stop_ends_all() -> None:
    done, asked = list[int](), list[int]()

    def arguments() -> Iterator[int]:
        for each in range(0, 1000, 2):
            asked.append(each)
            yield each

    workers = ShuffledWorkers(of_even, 0).workers
    run_jobs(workers, arguments(), lambda _job, result: done.append(result), lambda: len(done) >= 5)
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
    found, again = list[int](), list[str]()
    places = [str(tmp_path / str(number)) for number in range(3)]
    with local_workers(fate, 2) as workers:
        assert not run_jobs(workers, places, lambda _job, result: found.append(result), tried_again=again.append)
    assert len(found) == 3
    assert os.getpid() not in found
    assert sum("gave no answer" in line for line in again) == 3
    assert again.count("not yet") == 3


def test_what_cannot_be_is_said_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="--workers 0: must be at least 1"), local_workers(fate, 0):
        pass
    monkeypatch.setitem(sys.modules, "ray", None)
    with (
        pytest.raises(InputError, match=r"needs the extra `ray`: pip install 'ntc-viewer\[ray\]'"),
        ray_workers(fate, "auto"),
    ):
        pass


SECONDS_OF_A_JOB = 0.1


def fate_by_name(place: str) -> tuple[str, int]:
    """Dies the first time that it is asked where the name says so, refuses where it says so, and else answers with its process."""
    path = Path(place)
    time.sleep(SECONDS_OF_A_JOB)
    if path.name == "refuses":
        raise InputError("refuses: is not done")
    if path.name == "breaks":
        raise ValueError("broken")
    if path.name == "dies" and not path.exists():
        path.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return path.name, os.getpid()


@pytest.fixture
def cluster() -> Iterator[Any]:
    """Two machines of one core each."""
    pytest.importorskip("ray", reason="ray is not installed (extra: ray)")
    from ray.cluster_utils import Cluster

    # A lost machine is to be noticed soon.
    checks = {"health_check_initial_delay_ms": 0, "health_check_period_ms": 300, "health_check_failure_threshold": 3}
    head = {"num_cpus": 1, "include_dashboard": False, "_system_config": checks}
    found = Cluster(initialize_head=True, head_node_args=head)
    yield found
    found.shutdown()


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_jobs_of_killed_workers_and_lost_machines_are_done_elsewhere(cluster: Any, tmp_path: Path) -> None:
    node = cluster.add_node(num_cpus=1)
    found, again = dict[str, int](), list[str]()

    def take(_job: str, result: tuple[str, int]) -> None:
        name, process = result
        assert name not in found
        found[name] = process
        if len(found) == 6:
            cluster.remove_node(node, allow_graceful=False)

    names = ["dies", "refuses", "breaks", *map(str, range(12))]
    with ray_workers(fate_by_name, cluster.address) as workers:
        slots = workers.slots()
        failures = run_jobs(workers, [str(tmp_path / name) for name in names], take, tried_again=again.append)
    assert slots == 2
    assert sorted(found) == sorted({*names} - {"refuses", "breaks"})
    assert os.getpid() not in found.values()
    told = {Path(each.argument).name: each.problem for each in failures}
    assert (told.keys(), told["refuses"]) == ({"refuses", "breaks"}, "refuses: is not done")
    # Its last try may have been on the machine that was lost.
    assert told["breaks"] == "ValueError: broken" or "its process or machine is gone" in told["breaks"]
    assert any("its process or machine is gone" in line for line in again)


def test_a_cluster_that_is_not_there_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    ray = pytest.importorskip("ray", reason="ray is not installed (extra: ray)")

    def absent(**_options: object) -> None:
        raise ConnectionError("nobody listens")

    monkeypatch.setattr(ray, "init", absent)
    with pytest.raises(InputError, match="--ray auto: no cluster answers"), ray_workers(fate_by_name, "auto"):
        pass
