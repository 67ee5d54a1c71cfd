"""Trainings of a study, each kept in a file of its own, so that a study which was stopped goes on where it was."""

import hashlib
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ntc.config import CodecConfig
from ntc.files import write_text
from ntc.metrics import psnr_table
from ntc.pack import Grouping
from ntc.textures import SourceTexture
from ntc.train import train
from ntc.training_config import TrainingConfig

LARGEST_FILE = 1 << 24
"""Bytes of a kept run."""


@dataclass(frozen=True, eq=False)
class Run:
    """One training that is wanted."""

    name: str
    """Of the variant."""
    grouping: Grouping
    codec: CodecConfig
    training: TrainingConfig


@dataclass(frozen=True)
class RunResult:
    """What came of it."""

    name: str
    grouping: str
    groups: int
    seed: int
    psnr_db: tuple[float | None, ...]
    """Of each texture, mip 0, 8-bit sRGB; None where it is exact."""
    bits_per_texel: float
    """Latents, decoders and adapters."""
    seconds: float
    texels: int
    """Samples in all."""


def _settings(run: Run, textures: Sequence[SourceTexture]) -> dict[str, Any]:
    return {
        "name": run.name,
        "grouping": {"name": run.grouping.name, "groups": list(run.grouping.groups)},
        "codec": asdict(run.codec),
        "training": asdict(run.training),
        "textures": [[texture.pixel_hash, *texture.size] for texture in textures],
    }


def _kept(path: Path, settings: dict[str, Any]) -> RunResult | None:
    """The result in a file, if it is of just these settings."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            return None
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["settings"] != json.loads(json.dumps(settings)):
            return None
        result = dict(content["result"])
        return RunResult(**{**result, "psnr_db": tuple(result["psnr_db"])})
    except (OSError, ValueError, KeyError, TypeError):
        return None


def finished_run(
    run: Run, textures: Sequence[SourceTexture], folder: Path, progress: Callable[[int, int], None]
) -> RunResult:
    """The result of a run: from `folder` if it was done before with the same settings, else trained now and kept there.

    `progress` is called with (steps done, steps in all). Raises InputError where the folder cannot be written.
    """
    settings = _settings(run, textures)
    key = hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:16]
    path = folder / f"{key}.json"
    kept = _kept(path, settings)
    if kept is not None:
        return kept
    began = time.monotonic()
    pack = train(textures, run.grouping, run.codec, run.training, lambda report: progress(report.step, report.steps))
    steps, seconds = int(pack.training["steps"]), time.monotonic() - began
    psnr = [texture.psnr_db for texture in pack.textures]
    result = RunResult(
        name=run.name,
        grouping=run.grouping.name,
        groups=run.grouping.group_count,
        seed=run.training.seed,
        psnr_db=tuple(value if value is not None and math.isfinite(value) else None for value in psnr),
        bits_per_texel=psnr_table(pack).bits_per_texel,
        seconds=seconds,
        texels=steps * run.training.texels_per_texture * len(textures),
    )
    write_text(path, json.dumps({"settings": settings, "result": asdict(result)}, indent=1, allow_nan=False) + "\n")
    return result
