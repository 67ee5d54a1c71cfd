"""Processor time of the parts of encodings in codec `block`, and the constants of the work of forecasts that are fitted to it.

One thread encodes as a window does, twice: the second time counts, for the first one loads what is compiled. Each call replaces the
row of its scene. Without a scene, constants of `ntc.codec.block.encoding.rate` are fitted to all rows and printed.

    python -m lab.benchmarks.encoding_work courtyard --json lab/benchmarks/results/encoding_work.json
    python -m lab.benchmarks.encoding_work --json lab/benchmarks/results/encoding_work.json
"""

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from lab.benchmarks.time_left import ProcessorTimeHost, plan_of
from lab.runner import machine, run, write_record
from ntc.codec.block.config import BlockConfig, BlockOptions
from ntc.codec.block.encoding import encoder, groups, own_codes, stages, tables
from ntc.codec.block.encoding.rate import CHANNEL_COEFFICIENTS, JUDGED_BLOCKS, TYPICAL_KINDS, block_count
from ntc.errors import InputError
from ntc.training.messages import TrainingRequest, checked_request
from ntc.training.trainer import Trainer
from viewer.jobs.job import JobReport
from viewer.locations import CACHE_FOLDER_VARIABLE, DATA_FOLDER_VARIABLE, named_scene
from viewer.scene.load import load_scene
from viewer.training.preparation import EncodeScene, prepare

AGAIN = "again: "
"""Before the names of parts of encoding a texture again with fewer mips per code."""
ITERATIONS = 100
STEP, DAMPING = 0.5, 0.05
"""Of each iteration of a fit."""


def _blocks_of(sources: Sequence[Any], config: BlockConfig) -> list[float]:
    return [float(block_count([source.size], config)) for source in sources]


def _sampled(samples: Sequence[Any]) -> list[float]:
    return [float(sum(len(sample.blocks) for sample in samples))]


PARTS: Mapping[str, tuple[Any, str, Callable[..., list[float]]]] = {
    "sampling": (groups, "sample_textures", lambda sources, config, *_, **__: _blocks_of(sources, config)),
    "basis": (tables, "fitted_basis", lambda samples, _config: _sampled(samples)),
    "classes": (tables, "first_classes", lambda features, *_: [len(features)]),
    "modes": (tables, "_modes", lambda coefficients, *_: [len(coefficients)]),
    "fitting": (groups, "fit_decoder", lambda samples, *_: _sampled(samples)),
    "edge modes": (tables, "with_edge_modes", lambda _decoder, samples, _config: _sampled(samples)),
    "curves": (groups, "rate_curve", lambda sample, *_: [sample.block_count]),
    "sharing": (
        stages,
        "shared_words",
        lambda fitted, *_: [curve.block_count for each in fitted for curve in each.curves],
    ),
    "preparing": (groups, "prepare_texture", lambda source, config, *_: _blocks_of([source], config)),
    "kinds": (encoder, "paying_kinds", lambda texture, *_: [len(texture.texels)]),
    "choices": (encoder, "block_choices", lambda blocks, *_: [len(blocks)]),
    "codes": (encoder, "_codes", lambda texture, *_: [len(texture.texels)]),
    "measuring": (groups, "_measured", lambda _found, source, _fitted, config, _: _blocks_of([source], config)),
    "texture": (
        stages,
        "encode_member",
        lambda source, _words, _fitted, config, *_, **__: _blocks_of([source], config),
    ),
}
"""By part: the function whose time counts, without that of other parts within, and the blocks of each texture of a call to it."""


class Parts:
    """Processor time by part, with the calls and blocks of each."""

    def __init__(self) -> None:
        self.by_name: dict[str, dict[str, float]] = {}
        self._within: list[float] = []
        """Seconds of parts within each part that is under way."""
        self._again = False
        self.expected = 0
        """Textures of which a forecast says that they may be encoded again."""

    def timed(self, name: str, work: Callable[..., Any], blocks: Callable[..., list[float]]) -> Callable[..., Any]:
        """Return `work` with its time counted as that of the part `name`."""

        def call(*args: Any, **options: Any) -> Any:
            if name == "preparing" and len(args) > 2:
                self._again = True
            title = f"{AGAIN}{name}" if self._again and name != "texture" else name
            self._within.append(0.0)
            began = time.thread_time()
            result = work(*args, **options)
            took = time.thread_time() - began
            own = took - self._within.pop()
            if self._within:
                self._within[-1] += took
            if name == "texture":
                self._again = False
            each = blocks(*args, **options)
            found = self.by_name.setdefault(
                title, dict.fromkeys(("calls", "blocks", "judged", "kinds", "seconds"), 0.0)
            )
            found["calls"] += 1
            found["blocks"] += sum(each)
            found["judged"] += sum(min(count, JUDGED_BLOCKS) for count in each)
            found["kinds"] += sum(each) * len(args[5]) if name == "choices" else 0.0
            found["seconds"] += own
            return result

        return call

    @contextmanager
    def counted(self) -> Iterator[None]:
        """Count the time of all parts."""

        def is_doubtful(psnr_db: float, errors: Sequence[float]) -> bool:
            found = own_codes.is_doubtful(psnr_db, errors)
            self.expected += found
            return found

        with ExitStack() as stack:
            for name, (module, function, blocks) in PARTS.items():
                work = self.timed(name, getattr(module, function), blocks)
                stack.enter_context(mock.patch.object(module, function, work))
            stack.enter_context(mock.patch.object(stages, "is_doubtful", is_doubtful))
            yield


def row_of(title: str, request: TrainingRequest) -> dict[str, Any]:
    """Encode twice; returns the row of the second time."""
    assert isinstance(request.codec, BlockConfig)
    for parts in (Parts(), Parts()):
        trainer = Trainer(checked_request(request), ProcessorTimeHost())
        began = time.thread_time()
        with parts.counted():
            trainer.run()
        seconds = time.thread_time() - began
    config = request.codec
    return {
        "scene": title,
        "textures": len(request.textures),
        "groups": request.grouping.group_count,
        "channels": config.output_channels,
        "coefficients": config.coefficients,
        "words": config.mean_words,
        "seconds": seconds,
        "textures_expected_again": parts.expected,
        "parts": parts.by_name,
    }


def fitted(times: Sequence[float], *counts: Sequence[float]) -> tuple[list[float], float]:
    """Return (a factor of each of `counts` with which they sum up to `times`, the mean error of that as a ratio). Least squares of
    logarithms, so that a scene counts as much as another, whatever its size."""
    y, x = np.array(times), np.array(counts, np.float64).T
    factors = np.log(np.full(x.shape[1], (y / x.sum(1)).mean()))
    for _ in range(ITERATIONS):
        expected = x @ np.exp(factors)
        slopes = np.vstack([x * np.exp(factors) / expected[:, None], DAMPING * np.eye(len(factors))])
        step = np.linalg.lstsq(slopes, np.concatenate([np.log(y / expected), np.zeros(len(factors))]), rcond=None)[0]
        factors += STEP * step
    errors = np.log(y / (x @ np.exp(factors)))
    return np.exp(factors).tolist(), float(np.exp(np.sqrt(np.square(errors).mean())))


def constants(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Return the constants of `ntc.codec.block.encoding.rate` that suit `rows` best, and the error of each part as a ratio."""
    rows = [row for row in rows if "fitting" in row["parts"]]
    scales = [row["channels"] + row["coefficients"] / CHANNEL_COEFFICIENTS for row in rows]

    def total(names: Sequence[str], key: str = "seconds") -> list[float]:
        """Per row; seconds are in units of the work of a channel."""
        found = []
        for row, scale in zip(rows, scales, strict=True):
            own = sum(row["parts"].get(name, {}).get(key, 0.0) for name in names)
            found.append(own / scale if key == "seconds" else own)
        return found

    (fit,), fit_error = fitted(total(["basis", "classes", "modes", "fitting"]), total(["fitting"], "blocks"))
    calls = [count * scale for count, scale in zip(total(["edge modes"], "calls"), scales, strict=True)]
    (edges,), edges_error = fitted(total(["edge modes"]), calls)
    (sampling, sharing), sharing_error = fitted(
        total(["sampling", "curves", "sharing"]), total(["sampling"], "blocks"), total(["sampling"], "judged")
    )
    (choices,), choices_error = fitted(total(["choices"]), total(["choices"], "kinds"))
    of_textures = total(["texture"], "blocks"), total(["texture"], "judged")
    (codes, judging), codes_error = fitted(total(["codes", "kinds"]), *of_textures)
    (measure, comparing), measure_error = fitted(total(["measuring", "texture"]), *of_textures)
    block = TYPICAL_KINDS * choices + codes + measure
    every = [name for row in rows for name in row["parts"]]
    again = sorted({name for name in every if name.startswith(AGAIN)})
    redone, prepared = total(again), total([f"{AGAIN}preparing"], "blocks")
    blocks, count = total(["texture"], "blocks"), total([f"{AGAIN}preparing"], "calls")
    ratios = [seconds / number for seconds, number in zip(redone, prepared, strict=True) if number]
    return {
        "FIT_WORK": fit / block,
        "EDGE_BLOCKS": edges / fit,
        "SAMPLING_WORK": sampling / block,
        "SHARING_WORK": sharing / block,
        "JUDGING_WORK": (judging + comparing) / block,
        "CHOICES_WORK": choices / block,
        "CODES_WORK": codes / block,
        "MEASURE_WORK": measure / block,
        "REDONE_WORK": float(np.exp(np.mean(np.log(ratios)))) / block,
        "REDONE_SHARE": float(np.mean(np.array(prepared) / np.array(blocks))),
        "DOUBTFUL_SHARE": sum(count) / sum(row["textures_expected_again"] for row in rows),
        "error of fits": fit_error,
        "error of edge modes": edges_error,
        "error of sampling and sharing": sharing_error,
        "error of choices": choices_error,
        "error of codes": codes_error,
        "error of measuring": measure_error,
    }


def main() -> None:
    """Encode and add the row to the record, or print the constants."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path, nargs="?", help="default: constants are printed")
    parser.add_argument("--title", help="name of the row; default: that of the scene")
    parser.add_argument(
        "--set", nargs="*", default=[], metavar="NAME=VALUE", help="settings as training.set takes them"
    )
    parser.add_argument("--json", type=Path, required=True, help="the record")
    options = parser.parse_args()
    rows = json.loads(options.json.read_text())["rows"] if options.json.exists() else []
    if options.scene is None:
        for name, value in constants(rows).items():
            sys.stdout.write(f"{name} {value:.3g}\n")
        return
    with tempfile.TemporaryDirectory() as folder:
        for variable in (CACHE_FOLDER_VARIABLE, DATA_FOLDER_VARIABLE):
            os.environ.setdefault(variable, folder)
        scene = load_scene(named_scene(options.scene))
        request = prepare(EncodeScene(plan_of(options)), scene, None, JobReport())
    if not isinstance(request.training, BlockOptions):
        raise InputError("codec: must be block")
    row = row_of(options.title or scene.name, replace(request, training=replace(request.training, threads=1)))
    sys.stdout.write(f"{row['scene']}: {row['seconds']:.2f} s\n")
    kept = [each for each in rows if each["scene"] != row["scene"]]
    write_record(options.json, {**machine(), "rows": [*kept, row]})


if __name__ == "__main__":
    run(main)
