"""The pool of helper processes: answers, errors, cancelling, progress, and when helpers end."""

import os
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError
from pathlib import Path

import pytest

from ntc.errors import InputError
from ntc.worker.helpers import HelperReport, Helpers
from tests.support.processes import assert_ends_with_its_parent, state_of, wait_for_end
from viewer.jobs.job import Job

pytestmark = [
    pytest.mark.process,
    pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs /proc"),
]
SECONDS = 120.0


@pytest.fixture(scope="module")
def shared() -> Iterator[Helpers]:
    """Helpers that the tests of this file share: starting one takes longer than a call."""
    helpers = Helpers()
    yield helpers
    helpers.close()


def process(argument: object) -> int:
    """Return the id of the process, or fail."""
    if argument == "fail":
        raise ValueError("no number")
    return os.getpid()


def steps(count: int, report: HelperReport) -> int:
    for number in range(count):
        report.progress(number, count)
        time.sleep(0.01)
    return count


def test_a_helper_answers_for_any_function_and_survives_errors(shared: Helpers) -> None:
    helper = shared.call("process", process, None)
    assert helper != os.getpid()
    with pytest.raises(InputError, match="ValueError: no number"):
        shared.call("process", process, "fail")
    assert shared.call("sum", sum, (1, 2)) == 3
    assert shared.call("process", process, None) == helper


def test_progress_comes_in_order_while_the_work_goes_on(shared: Helpers) -> None:
    seen: list[tuple[int, int]] = []
    assert shared.call("steps", steps, 40, progress=lambda *step: seen.append(step)) == 40
    assert len(seen) > 1
    assert seen == sorted(seen)
    assert {of for _, of in seen} == {40}


def test_calls_at_the_same_time_have_helpers_of_their_own(shared: Helpers) -> None:
    job = Job(lambda report: shared.call("sleep", time.sleep, 600, report.check)).start("sleep")
    other = shared.call("process", process, None)
    assert state_of(other) not in ("", "Z")
    job.cancel()
    job.join(SECONDS)
    with pytest.raises(CancelledError):
        job.result()


def test_work_alone_ends_its_helper(shared: Helpers) -> None:
    other = shared.call("process", process, None)
    helper = shared.call("process", process, None, alone=True)
    assert helper != other
    wait_for_end(helper)
    assert state_of(other) not in ("", "Z")


def test_a_killed_helper_is_reported_and_replaced() -> None:
    helpers = Helpers()
    helper = helpers.call("process", process, None)
    with pytest.raises(InputError, match="ending: its process gave no answer"):
        helpers.call("ending", os._exit, 3)
    assert helpers.call("process", process, None) != helper
    helpers.close()


def test_an_idle_helper_ends() -> None:
    helpers = Helpers(idle_seconds=0.5)
    helper = helpers.call("process", process, None)
    # A call begins the time again.
    assert helpers.call("process", process, None) == helper
    wait_for_end(helper)
    assert helpers.call("process", process, None) != helper
    helpers.close()


def test_closing_ends_helpers_in_the_middle_of_a_call() -> None:
    helpers = Helpers()
    idle = helpers.call("process", process, None)
    job = Job(lambda _report: helpers.call("sleep", time.sleep, 600)).start("sleep")
    time.sleep(0.5)
    helpers.close()
    job.join(SECONDS)
    assert "sleep: its process gave no answer" in job.problem
    wait_for_end(idle)
    with pytest.raises(InputError, match="gave no answer"):
        helpers.call("process", process, None)


def test_a_helper_ends_with_a_program_that_was_killed() -> None:
    assert_ends_with_its_parent(
        "from ntc.worker.helpers import HELPERS\n"
        "if __name__ == '__main__':\n"
        "    print(HELPERS.call('eval', eval, '__import__(\"os\").getpid()'), flush=True)\n"
        "    HELPERS.call('eval', eval, '__import__(\"time\").sleep(600)')\n"
    )
