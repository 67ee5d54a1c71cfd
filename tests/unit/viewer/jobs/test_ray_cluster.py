"""Jobs on a cluster of two machines, both of them here: killed workers, errors, and a machine that goes away."""

import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from ntc.errors import InputError
from viewer.jobs.executor import RayExecutor, run_jobs

SECONDS_OF_A_JOB = 0.1


def fate(place: str) -> tuple[str, int]:
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
    executor = RayExecutor(fate, cluster.address)
    found, again = dict[str, int](), list[str]()

    def take(_job: str, result: tuple[str, int], _attempt: int) -> None:
        name, process = result
        assert name not in found
        found[name] = process
        if len(found) == 6:
            cluster.remove_node(node, allow_graceful=False)

    names = ["dies", "refuses", "breaks", *map(str, range(12))]
    try:
        slots = executor.slots
        failures = run_jobs(executor, [str(tmp_path / name) for name in names], take, tried_again=again.append)
    finally:
        executor.close()
    assert slots == 2
    assert sorted(found) == sorted({*names} - {"refuses", "breaks"})
    assert os.getpid() not in found.values()
    told = {Path(each.argument).name: each.problem for each in failures}
    assert told == {"refuses": "refuses: is not done", "breaks": "ValueError: broken"}
    assert any("its process or machine is gone" in line for line in again)


def test_a_cluster_that_is_not_there_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    ray = pytest.importorskip("ray", reason="ray is not installed (extra: ray)")

    def absent(**_options: object) -> None:
        raise ConnectionError("nobody listens")

    monkeypatch.setattr(ray, "init", absent)
    with pytest.raises(InputError, match="--ray auto: no cluster answers"):
        RayExecutor(fate, "auto")
