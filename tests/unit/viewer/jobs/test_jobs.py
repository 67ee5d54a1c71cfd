"""Jobs in threads and in processes: results, errors, cancelling, and that no process outlives the program."""

import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError
from functools import partial
from pathlib import Path

import pytest

from ntc.errors import InputError
from ntc.worker.process import FunctionProcess
from viewer.jobs.job import RESULTS_KEPT, Background, Job, JobReport, Result
from viewer.state.message_log import details_of

SECONDS = 30.0


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
    for number in range(RESULTS_KEPT + 1):
        background.submit(number, partial(later, number))
    go.set()
    began = time.monotonic()
    while background.is_busy:
        assert time.monotonic() - began < SECONDS
        time.sleep(0.01)
    assert order == [*range(RESULTS_KEPT, -1, -1)]
    wait_for(background, RESULTS_KEPT - 1, partial(later, -1))
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


@pytest.mark.process
def test_a_process_answers_call_after_call_and_survives_errors() -> None:
    process = FunctionProcess(math.factorial, "factorial")
    assert [process.call(number) for number in (3, 5)] == [6, 120]
    with pytest.raises(InputError, match="ValueError"):
        process.call(-1)
    assert process.call(4) == 24
    process.close()
    with pytest.raises(InputError, match="factorial: its process gave no answer"):
        process.call(4)


@pytest.mark.process
def test_closing_ends_a_process_in_the_middle_of_a_call() -> None:
    process = FunctionProcess(time.sleep, "sleep")
    job = Job(lambda _report: process.call(600)).start("sleep")
    time.sleep(0.5)
    began = time.monotonic()
    process.close()
    assert time.monotonic() - began < 5.0
    job.join(SECONDS)
    assert "gave no answer" in job.problem


@pytest.mark.process
def test_a_cancelled_job_does_not_wait_for_its_process() -> None:
    process = FunctionProcess(time.sleep, "sleep")
    job = Job(lambda report: process.call(600, report.check)).start("sleep")
    job.cancel()
    job.join(SECONDS)
    with pytest.raises(CancelledError):
        job.result()
    process.close()


@pytest.mark.process
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs /proc")
def test_a_process_ends_with_a_parent_that_was_killed() -> None:
    code = (
        "from ntc.worker.process import FunctionProcess\n"
        "if __name__ == '__main__':\n"
        "    process = FunctionProcess(eval, 'eval')\n"
        "    print(process.call('__import__(\"os\").getpid()'), flush=True)\n"
        "    process.call('__import__(\"time\").sleep(600)')\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    os.kill(parent.pid, signal.SIGKILL)
    parent.wait()
    parent.stdout.close()
    began = time.monotonic()
    while Path(f"/proc/{child}/stat").exists() and Path(f"/proc/{child}/stat").read_text().split()[2] != "Z":
        assert time.monotonic() - began < SECONDS
        time.sleep(0.05)
