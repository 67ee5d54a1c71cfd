"""Benchmark of the worst case for a wave: all decoders occur in every block of 8x8 pixels (paper, Sec. 4)."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lab.bench.fixture import (
    BINNED_BYTES,
    PICTURE_BYTES,
    TEXTURE_SIDE,
    DecodeFixture,
    FixturePath,
    PackLoader,
    interleaved_words,
)
from lab.bench.interleaved import Progress, Spread, no_progress, time_interleaved
from lab.bench.random_pack import square_pack
from lab.bench.tiles import PictureLimits, Tiling, tiling
from ntc.codec.grid.model import GridConfig
from viewer.gl.context import GraphicsContext
from viewer.render.gpu_packs import GpuPack
from viewer.render.resources.decoding_shaders import EVERYWHERE
from viewer.render.resources.layout import GROUP_SIDE
from viewer.state.view_state import Precision

SHARED = 1
BLOCK_PIXELS = GROUP_SIDE * GROUP_SIDE
"""Number of pixels of a block. Each shows another texture, so that rows differ only in the number of decoders."""


@dataclass(frozen=True)
class WorstCaseConfig:
    """Settings of the worst case."""

    sizes: tuple[tuple[int, int], ...] = ((512, 512),)
    """Sizes (width, height) in pixels."""
    decoders: tuple[int, ...] = (1, 5, 10, 20)
    """Numbers of decoders, 1 to BLOCK_PIXELS."""
    precisions: tuple[Precision, ...] = EVERYWHERE
    repeats: int = 7
    codec: GridConfig = field(default_factory=GridConfig)


@dataclass(frozen=True)
class WorstCaseRow:
    """Row of the benchmark: times of one way to decode one size."""

    width: int
    height: int
    tile_width: int
    tile_height: int
    tiles: int
    """Number of tiles, decoded in turn; more than 1 where the picture exceeds the largest texture or the allowed memory."""
    decoders: int
    """Number of decoders in every block."""
    path: FixturePath
    precision: Precision
    median_ms: float
    min_ms: float
    max_ms: float
    to_shared: float | None
    """Median divided by that of `deferred, shared` with one decoder in the same precision; None if that was not timed."""
    to_one: float | None
    """Median divided by that of the same path with one decoder in the same precision; None if that was not timed."""
    gigaflops: float
    """Multiplications and additions of the decoders' layers, in 10^9 per second."""
    largest_difference: float
    """Largest difference of a tile's albedo from that of path `deferred` with a decoder index; linear, 0 to 1."""


@dataclass(frozen=True)
class _Candidate:
    decoders: int
    path: FixturePath
    precision: Precision


def _candidates(config: WorstCaseConfig) -> list[_Candidate]:
    candidates = []
    for decoders in config.decoders:
        paths: tuple[FixturePath, ...] = ("deferred", "deferred, shared", "binned")
        for precision in config.precisions:
            possible = [path for path in paths if decoders == SHARED or path != "deferred, shared"]
            candidates += [_Candidate(decoders, path, precision) for path in possible]
    return candidates


def worst_case(
    context: GraphicsContext,
    config: WorstCaseConfig,
    limits: PictureLimits,
    progress: Progress = no_progress,
) -> tuple[WorstCaseRow, ...]:
    """Time every size, path, number of decoders and precision; the candidates of a size are timed interleaved.

    Raises InputError, before anything is allocated, where no tile is within `limits`.
    """
    candidates = _candidates(config)
    bytes_each = PICTURE_BYTES + BINNED_BYTES * sum(candidate.path == "binned" for candidate in candidates)
    tilings = [tiling(size, bytes_each, limits) for size in config.sizes]
    loader = PackLoader(context)
    rows: list[WorstCaseRow] = []
    for number, (size, tiles) in enumerate(zip(config.sizes, tilings, strict=True)):

        def of_all(done: int, of: int, number: int = number) -> None:
            progress(number * of + done, len(config.sizes) * of)

        rows += _of_size(context, config, size, tiles, loader, of_all)
    loader.release()
    return tuple(rows)


def _of_size(
    context: GraphicsContext,
    config: WorstCaseConfig,
    size: tuple[int, int],
    tiles: Tiling,
    loader: PackLoader,
    progress: Progress,
) -> list[WorstCaseRow]:
    fixture = DecodeFixture(context, tiles, interleaved_words(tiles.tile, BLOCK_PIXELS))
    loaded: dict[tuple[int, Precision], GpuPack] = {}
    for decoders in config.decoders:
        pack = square_pack(BLOCK_PIXELS, decoders, TEXTURE_SIDE, config.codec)
        for precision in config.precisions:
            loaded[decoders, precision] = loader.load(pack, precision)
    candidates = _candidates(config)
    runs = [fixture.decoding(loaded[each.decoders, each.precision], each.path) for each in candidates]
    differences = []
    truth: NDArray[np.float32] = np.zeros(0, np.float32)
    for candidate, run in zip(candidates, runs, strict=True):
        run()
        albedo = fixture.target.read()
        truth = albedo if candidate.path == "deferred" else truth
        differences.append(float(np.abs(albedo - truth).max()))
    spreads = time_interleaved(context, runs, config.repeats, progress)
    for pack_on_gpu in loaded.values():
        pack_on_gpu.release()
    fixture.release()
    return _rows(config, size, tiles, candidates, spreads, differences)


def _rows(
    config: WorstCaseConfig,
    size: tuple[int, int],
    tiles: Tiling,
    candidates: Sequence[_Candidate],
    spreads: Sequence[Spread],
    differences: Sequence[float],
) -> list[WorstCaseRow]:
    medians = {candidate: spread.median_ms for candidate, spread in zip(candidates, spreads, strict=True)}

    def multiple(candidate: _Candidate, path: FixturePath) -> float | None:
        base = medians.get(_Candidate(SHARED, path, candidate.precision))
        return medians[candidate] / base if base else None

    work = 2.0 * config.codec.multiply_adds * tiles.pixels
    return [
        WorstCaseRow(
            width=size[0],
            height=size[1],
            tile_width=tiles.tile[0],
            tile_height=tiles.tile[1],
            tiles=tiles.count,
            decoders=candidate.decoders,
            path=candidate.path,
            precision=candidate.precision,
            median_ms=spread.median_ms,
            min_ms=spread.min_ms,
            max_ms=spread.max_ms,
            to_shared=multiple(candidate, "deferred, shared"),
            to_one=multiple(candidate, candidate.path),
            gigaflops=work / max(spread.median_ms, 1e-6) / 1e6,
            largest_difference=difference,
        )
        for candidate, spread, difference in zip(candidates, spreads, differences, strict=True)
    ]
