"""Measurement of textures in BC1, BC7 and ASTC. Results are cached by pixels and format."""

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from lab.studies.set_quality import PictureQuality, SetQuality, picture_quality, texel_count
from ntc.codec.mips import mip_sizes
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from ntc.io import write_text
from ntc.metrics.block_compression import BlockFormat, Effort, compress, compressed_bytes
from ntc.metrics.compressed_textures import VERSION


@dataclass(frozen=True)
class FormatQuality:
    """Quality of one texture in one format."""

    quality: PictureQuality
    cpu_seconds: float
    """CPU time of encoding mip 0."""


@dataclass(frozen=True)
class FormatStudy:
    """Measurement of textures in block formats, with a cache of the figures in `folder`."""

    folder: Path
    effort: Effort = "thorough"

    def measure(self, texture: SourceTexture, block_format: BlockFormat) -> FormatQuality:
        """Return the quality of a texture in a format, encoded now or read from the cache. Raises InputError like `compress`."""
        key = f"{VERSION} {hash_pixels(texture.pixels)} {block_format} {self.effort}"
        path = self.folder / f"quality-{block_format}-{hashlib.sha256(key.encode()).hexdigest()[:32]}.json"
        cached = _read_cached(path)
        if cached is not None:
            return cached
        began = time.thread_time()
        decoded = compress(texture.pixels, block_format, self.effort).decoded
        seconds = time.thread_time() - began
        truth = texture.pixels[..., : decoded.shape[2]]
        measured = FormatQuality(picture_quality(truth, decoded), seconds)
        with suppress(InputError):
            write_text(path, json.dumps(asdict(measured)) + "\n")
        return measured

    def measured(
        self,
        textures: Sequence[SourceTexture],
        block_format: BlockFormat,
        report: Callable[[int, int], None] = lambda _done, _of: None,
        flip_every: int = 1,
    ) -> tuple[tuple[PictureQuality, ...], SetQuality]:
        """Return the quality of each texture and of the set. Bits count all mips; FLIP is that of every `flip_every`-th texture."""
        qualities = []
        for number, texture in enumerate(textures):
            qualities.append(self.measure(texture, block_format))
            report(number + 1, len(textures))
        sizes = [texture.size for texture in textures]
        stored = sum(compressed_bytes(*mip, block_format) for size in sizes for mip in mip_sizes(*size))
        pictures = tuple(
            each.quality if number % flip_every == 0 else replace(each.quality, flip=None)
            for number, each in enumerate(qualities)
        )
        seconds = sum(each.cpu_seconds for each in qualities)
        return pictures, SetQuality.of(pictures, 8.0 * stored / texel_count(sizes), seconds)


def _read_cached(path: Path) -> FormatQuality | None:
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return FormatQuality(PictureQuality(**content["quality"]), float(content["cpu_seconds"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None
