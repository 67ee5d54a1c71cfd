"""Samples a second of a training step, beside a plain torch loop of the same shape, interleaved in one process.

python -m lab.benchmarks.training_throughput scene.gltf --json lab/benchmarks/results/training_throughput_cpu.json
"""

import argparse
import json
import platform
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch

from lab.benchmarks.plain_training import PlainTraining
from lab.studies.settings import StudySettings
from ntc.codec.config import GroupingConfig
from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.training.batch import TrainingBatch
from ntc.errors import InputError
from ntc.grouping import GroupingInputs, make_grouping
from ntc.io import write_text
from ntc.torch_device import choose_device, peak_memory_bytes
from viewer.cli.encode import read_source

STEPS_A_TURN = 10


def timed(step: Callable[[], object], device: torch.device) -> float:
    """Seconds of a step, over a few."""
    began = time.perf_counter()
    for _ in range(STEPS_A_TURN):
        step()
    if device.type == "cuda":
        torch.cuda.synchronize(device)
    return (time.perf_counter() - began) / STEPS_A_TURN


def measure(source: Path, texture_size: int, clusters: int, turns: int, device: torch.device) -> dict[str, Any]:
    """Medians over the rounds."""
    textures = read_source(source, texture_size).textures
    grouping = make_grouping(GroupingConfig("clustered", clusters), textures, GroupingInputs())
    settings = StudySettings(steps=100000)
    paper = settings.codec("paper", 3)
    plain = PlainTraining(textures, grouping.groups, GridConfig(levels=1), device)
    per_texture = settings.texels_per_texture

    def batch(codec: GridConfig, recipe: str) -> TrainingBatch:
        training = settings.training("paper" if recipe == "paper" else "best", 0)
        return TrainingBatch(textures, grouping.groups, codec, training, device, torch.Generator().manual_seed(0))

    steps: dict[str, Callable[[], object]] = {"plain loop": lambda: plain.step(per_texture)}
    batches = {"recipe paper": batch(paper, "paper"), "recipe best": batch(settings.codec("best", 3), "best")}
    for name, trained in batches.items():
        steps[name] = lambda trained=trained: trained.advance(1.0)  # type: ignore[misc]
    seconds: dict[str, list[float]] = {name: [] for name in steps}
    for turn in range(turns + 1):
        for name, step in steps.items():
            elapsed = timed(step, device)
            if turn:
                seconds[name].append(elapsed)
    samples = per_texture * len(textures)
    medians = {name: statistics.median(values) for name, values in seconds.items()}
    return {
        "textures": len(textures),
        "texture_size": texture_size,
        "decoders": grouping.group_count,
        "texels_in_a_step": samples,
        "ktexels_per_second": {name: round(samples / value / 1e3, 1) for name, value in medians.items()},
        "times_the_plain_loop": {name: round(medians["plain loop"] / value, 2) for name, value in medians.items()},
        "milliseconds_a_step": {name: round(value * 1e3, 2) for name, value in medians.items()},
        "spread_milliseconds": {
            name: [round(min(values) * 1e3, 2), round(max(values) * 1e3, 2)] for name, values in seconds.items()
        },
        "peak_memory_bytes": peak_memory_bytes(device),
        "machine": {
            "device": torch.cuda.get_device_name(device) if device.type == "cuda" else platform.machine(),
            "threads": torch.get_num_threads(),
            "torch": torch.__version__,
        },
    }


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", type=Path, help="scene or folder of images")
    parser.add_argument("--texture-size", type=int, default=256)
    parser.add_argument("--clusters", type=int, default=10)
    parser.add_argument("--turns", type=int, default=9)
    parser.add_argument("--device", choices=("auto", "cpu", "cuda"), default="auto")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    try:
        figures = measure(
            options.source, options.texture_size, options.clusters, options.turns, choose_device(options.device)
        )
    except InputError as error:
        sys.stderr.write(f"error: {error}\n")
        return 2
    text = json.dumps(figures, indent=1) + "\n"
    print(text)
    if options.json:
        write_text(options.json, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
