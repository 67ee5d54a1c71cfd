"""Trainings of a study. The result of each is a file, so that a stopped study can resume."""

import hashlib
import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from lab.runner import Report
from lab.studies.hardware_formats import FormatStudy
from lab.studies.set_quality import texel_count
from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.torch_twin import TorchGrid
from ntc.codec.grid.training.config import TrainingConfig
from ntc.codec.model import Grouping, Pack
from ntc.codec.quality import finite_or_none
from ntc.codec.textures import SourceTexture
from ntc.io import write_text
from ntc.metrics.block_compression import BlockFormat, compressed_bytes
from ntc.metrics.image_quality import flip, ssim
from ntc.metrics.metrics import psnr_table
from ntc.pack.file import write_pack
from ntc.torch_device import choose_device
from ntc.training.encode import encode_textures
from ntc.training.messages import TrainingProgress

LARGEST_FILE = 1 << 26
"""Largest file of a result in bytes."""


@dataclass(frozen=True, eq=False)
class Run:
    """Training of a study."""

    name: str
    """Name of the variant."""
    grouping: Grouping
    codec: GridConfig
    training: TrainingConfig
    pictures: bool = False
    """True where SSIM and FLIP are measured too. They take longer than PSNR."""


@dataclass(frozen=True)
class RunResult:
    """Results of a run."""

    name: str
    grouping: str
    groups: int
    seed: int
    psnr_db: tuple[float | None, ...]
    """PSNR of each texture, mip 0, 8-bit sRGB; None where it is exact."""
    bits_per_texel: float
    """Bits of latents, decoders and adapters per texel of mip 0."""
    seconds: float
    texels: int
    """Number of samples in all."""
    ssim: tuple[float, ...] = ()
    """SSIM of each texture; empty where it was not measured."""
    flip: tuple[float, ...] = ()
    """Mean FLIP of each texture; empty where it was not measured."""
    multiply_adds: int = 0
    """Multiply-adds of one decode."""


def _settings(run: Run, textures: Sequence[SourceTexture]) -> dict[str, Any]:
    return {
        "name": run.name,
        "grouping": {"name": run.grouping.name, "groups": list(run.grouping.groups)},
        "codec": asdict(run.codec),
        "training": asdict(run.training),
        "pictures": run.pictures,
        "textures": [[texture.pixel_hash, *texture.size] for texture in textures],
    }


def _cached(path: Path, settings: dict[str, Any]) -> RunResult | None:
    """Return the result in a file with equal settings; None without one."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            return None
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["settings"] != json.loads(json.dumps(settings)):
            return None
        result: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value for key, value in content["result"].items()
        }
        return RunResult(**result)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _path(folder: Path, settings: dict[str, Any]) -> Path:
    key = hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:16]
    return folder / f"{key}.json"


def _write(path: Path, settings: dict[str, Any], result: RunResult) -> None:
    content = {"settings": settings, "result": asdict(result)}
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def _measured(result: RunResult, run: Run, pack: Pack, textures: Sequence[SourceTexture]) -> RunResult:
    if not run.pictures:
        return result
    codec = TorchGrid(pack, choose_device(run.training.device))
    pairs = [(texture.pixels, codec.decode_image(index)) for index, texture in enumerate(textures)]
    return replace(result, ssim=tuple(ssim(a, b) for a, b in pairs), flip=tuple(flip(a, b) for a, b in pairs))


def finished_run(
    run: Run, textures: Sequence[SourceTexture], folder: Path, report: Report, pack_file: Path | None = None
) -> RunResult:
    """Return the result of a run: from `folder` if a run with the same settings was finished, otherwise trained now.

    New results are written to `folder`, and packs to `pack_file`. Raises InputError where a folder cannot be written.
    """
    settings = _settings(run, textures)
    path = _path(folder, settings)
    cached = _cached(path, settings)
    if cached is not None and (pack_file is None or pack_file.exists()):
        return cached

    def listen(progress: TrainingProgress) -> None:
        report(progress.step, progress.steps)

    state = path.with_suffix(".state")
    began = time.monotonic()
    pack = encode_textures(textures, run.grouping, run.codec, run.training, listen, state=state)
    seconds = time.monotonic() - began
    steps = int(pack.training["steps"])
    result = RunResult(
        name=run.name,
        grouping=run.grouping.name,
        groups=run.grouping.group_count,
        seed=run.training.seed,
        psnr_db=tuple(finite_or_none(texture.psnr_db) for texture in pack.textures),
        bits_per_texel=psnr_table(pack).bits_per_texel,
        seconds=seconds,
        texels=steps * run.training.texels_per_texture * len(textures),
        multiply_adds=run.codec.multiply_adds,
    )
    if pack_file is not None:
        write_pack(pack_file, pack)
    measured = _measured(result, run, pack, textures)
    _write(path, settings, measured)
    return measured


def block_compressed(
    block_format: BlockFormat, textures: Sequence[SourceTexture], folder: Path, report: Report
) -> RunResult:
    """Return the result of the textures in a block format of graphics hardware, cached in `folder`.

    Raises InputError where the encoder is not installed.
    """
    pictures, quality = FormatStudy(folder, "medium").measured(textures, block_format, report)
    sizes = [texture.size for texture in textures]
    return RunResult(
        name=block_format.upper(),
        grouping="-",
        groups=0,
        seed=0,
        psnr_db=tuple(picture.psnr_db for picture in pictures),
        bits_per_texel=8.0 * sum(compressed_bytes(*size, block_format) for size in sizes) / texel_count(sizes),
        seconds=quality.seconds,
        texels=0,
        ssim=tuple(picture.ssim for picture in pictures),
        flip=tuple(picture.flip for picture in pictures if picture.flip is not None),
    )
