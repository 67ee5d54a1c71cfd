"""The simulated cluster against what can be told without simulating."""

import math
from dataclasses import replace

import pytest

from lab.simulation.cluster import MOST_ATTEMPTS, Cluster, Job, simulate

PLAIN = Cluster(
    nodes=4, slots=8, storage_bytes_a_second=math.inf, writer_bytes_a_second=math.inf, index_seconds=0.0, spread=0.0
)
JOB = Job(textures=10, compute_seconds=100.0, read_bytes=1e6, result_bytes=1e6)


@pytest.mark.parametrize("jobs", [1, 31, 32, 33, 1000])
def test_equal_jobs_take_as_many_rounds_as_slots_need(jobs: int) -> None:
    found = simulate(jobs, JOB, PLAIN)
    assert found.seconds == pytest.approx(math.ceil(jobs / 32) * 100.0)
    assert (found.done, found.lost, found.attempts) == (jobs, 0, jobs)
    assert found.compute_share == pytest.approx(jobs / (32 * math.ceil(jobs / 32)))


def test_no_job_takes_no_time() -> None:
    assert simulate(0, JOB, PLAIN).seconds == 0.0


def test_one_writer_is_the_limit_where_it_is_slower_than_the_slots() -> None:
    """32 slots give a job every 3.125 s, the writer takes 10 s for one."""
    slow = replace(PLAIN, writer_bytes_a_second=1e5)
    found = simulate(500, JOB, slow)
    assert found.seconds == pytest.approx(100.0 + 500 * 10.0, rel=0.01)
    assert found.writer_share == pytest.approx(1.0, abs=0.03)


def test_storage_is_the_limit_alike() -> None:
    found = simulate(500, JOB, replace(PLAIN, storage_bytes_a_second=1e5))
    assert found.seconds == pytest.approx(500 * 10.0 + 100.0, rel=0.01)
    assert found.storage_share == pytest.approx(1.0, abs=0.03)


def test_waiting_for_a_writer_is_that_of_a_queue_with_equal_services() -> None:
    """Many slots and few jobs at a time are close to arrivals by chance: M/D/1, mean wait rho s / (2 (1 - rho))."""
    cluster = replace(PLAIN, nodes=1, slots=400, writer_bytes_a_second=1e6, spread=0.5)
    found = simulate(40_000, replace(JOB, compute_seconds=500.0), cluster)
    load = found.writer_share
    assert 0.6 < load < 0.8
    assert found.writer_wait_seconds == pytest.approx(load / (2.0 * (1.0 - load)), rel=0.15)


def test_failures_cost_what_was_under_way_and_lose_nothing_while_they_are_rare() -> None:
    found = simulate(5000, JOB, replace(PLAIN, hours_between_failures=2.0, repair_seconds=0.0), seed=3)
    assert (found.done, found.lost) == (5000, 0)
    failures = found.seconds / 7200.0 * 4
    # Each takes half a job of each of the node's slots, on average.
    assert found.attempts - 5000 == pytest.approx(failures * 8, rel=0.35)


def test_a_job_that_is_lost_too_often_is_given_up() -> None:
    found = simulate(50, JOB, replace(PLAIN, hours_between_failures=1e-3, repair_seconds=1.0))
    assert found.lost + found.done == 50
    assert found.lost > 40
    assert found.attempts <= 50 * MOST_ATTEMPTS


def test_stragglers_show_at_the_end() -> None:
    found = simulate(640, JOB, replace(PLAIN, straggler_share=0.02, straggler_factor=10.0), seed=1)
    assert 2000.0 < found.seconds <= 2000.0 * 1.18 + 1000.0


def test_the_same_seed_gives_the_same_run() -> None:
    cluster = replace(PLAIN, spread=0.3, hours_between_failures=1.0, straggler_share=0.1)
    assert simulate(300, JOB, cluster, 5) == simulate(300, JOB, cluster, 5)
    assert simulate(300, JOB, cluster, 5) != simulate(300, JOB, cluster, 6)
