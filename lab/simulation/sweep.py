"""`python -m lab.simulation.sweep --json F --plot F.png`: 10^6 textures of 2048 x 2048 on 1 to 1000 machines, from measured costs.

What a texture takes is read from lab/benchmarks/results/encoding_cost.json (`lab.benchmarks.library.encoding_cost`).
"""

import json
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import tyro

from lab.simulation.cluster import Cluster, Job, Outcome, simulate
from ntc.io import atomic_path, write_text

MEASURED = Path(__file__).resolve().parents[1] / "benchmarks" / "results" / "encoding_cost.json"
TEXTURES = 1_000_000
MEGATEXELS = 2048 * 2048 / 1e6
NODES = (1, 3, 10, 30, 100, 300, 1000)
A_JOB = 64
"""Textures of a large job."""
PNG_BYTES_A_TEXEL = 2.0
"""Of photographs as PNG; the measured images are JPEG, three times smaller."""
USUAL = Cluster(nodes=1, hours_between_failures=1000.0, straggler_share=0.02)


@dataclass(frozen=True)
class Case:
    """One way to run it."""

    name: str
    cluster: Cluster
    textures_a_job: int = A_JOB


APART = replace(USUAL, writer_bytes_a_second=float("inf"))
TOGETHER = replace(APART, index_seconds=0.001)
CASES = (
    Case("jobs of 64 textures, one process writes shards", USUAL),
    Case("jobs of 4, as encode makes them", USUAL, 4),
    Case("and workers write shards", APART, 4),
    Case("and ten lines of the index at a time", TOGETHER, 4),
    Case("and storage of 40 GB/s", replace(TOGETHER, storage_bytes_a_second=40e9), 4),
)
"""Each takes away what the one before it breaks at first."""


@dataclass(frozen=True)
class Options:
    """Simulate clusters of growing size."""

    json: Path | None = None
    """Where to write the figures."""
    plot: Path | None = None
    """Where to write the picture."""


def job_of(textures: int) -> Job:
    """A job of so many textures under `universal`, from what was measured."""
    measured = json.loads(MEASURED.read_text(encoding="utf-8"))
    megatexels = textures * MEGATEXELS
    seconds = measured["read_seconds_a_megatexel"] + measured["universal"]["encode_seconds_a_megatexel"]
    return Job(
        textures,
        seconds * megatexels,
        PNG_BYTES_A_TEXEL * megatexels * 1e6,
        measured["universal"]["code_bytes_a_texel"] * megatexels * 1e6,
    )


def _row(case: Case, nodes: int) -> dict[str, Any]:
    job = job_of(case.textures_a_job)
    jobs = -(-TEXTURES // case.textures_a_job)
    found: Outcome = simulate(jobs, job, replace(case.cluster, nodes=nodes), seed=1)
    one_slot = jobs * job.compute_seconds
    return {
        "case": case.name,
        "nodes": nodes,
        "textures_a_job": case.textures_a_job,
        "jobs": jobs,
        "hours": found.seconds / 3600.0,
        "efficiency": one_slot / (found.seconds * nodes * case.cluster.slots),
        **{name: value for name, value in asdict(found).items() if name != "seconds"},
    }


def _draw(rows: list[dict[str, Any]], path: Path) -> None:
    figure, (time, efficiency) = plt.subplots(1, 2, figsize=(10, 4), dpi=100, constrained_layout=True)
    for case in CASES:
        own = [row for row in rows if row["case"] == case.name]
        nodes = [row["nodes"] for row in own]
        time.plot(nodes, [row["hours"] for row in own], marker="o", label=case.name)
        efficiency.plot(nodes, [100.0 * row["efficiency"] for row in own], marker="o", label=case.name)
    for axes in (time, efficiency):
        axes.set_xscale("log")
        axes.set_xlabel("machines of 32 cores")
        axes.grid(alpha=0.3)
    time.set_yscale("log")
    time.set_ylabel("hours for 10^6 textures of 2048 x 2048")
    efficiency.set_ylabel("% of all cores' time spent encoding")
    efficiency.set_ylim(0, 105)
    efficiency.legend(loc="lower left")
    with atomic_path(path) as temporary:
        figure.savefig(temporary)
    plt.close(figure)


def main(options: Options) -> None:
    """Run the sweep."""
    rows = [_row(case, nodes) for case in CASES for nodes in NODES]
    for row in rows:
        sys.stdout.write(
            f"{row['case']:46} {row['nodes']:5} nodes {row['hours']:9.3f} h  efficiency {row['efficiency']:.2f}  "
            f"writer {row['writer_share']:.2f}  storage {row['storage_share']:.2f}  "
            f"again {row['attempts'] - row['done']}  lost {row['lost']}\n"
        )
    if options.json is not None:
        write_text(options.json, json.dumps(rows, indent=2) + "\n")
    if options.plot is not None:
        _draw(rows, options.plot)


if __name__ == "__main__":
    main(tyro.cli(Options))
