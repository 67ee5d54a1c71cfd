"""How the time of a decode pass grows with the picture, the textures, the decoders and the size of a decoder."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from lab.bench.fixture import (
    BINNED_BYTES,
    PICTURE_BYTES,
    TEXTURE_SIDE,
    DecodeFixture,
    FixturePath,
    PackLoader,
    block_words,
    scattered_words,
)
from lab.bench.interleaved import Progress, no_progress, time_interleaved
from lab.bench.random_pack import square_pack
from lab.bench.tiles import PictureLimits, Tiling, tiling
from ntc.codec.grid.model import GridConfig
from viewer.gl.context import GraphicsContext
from viewer.render.gpu_packs import GpuPack

SweepName = Literal["resolution", "textures", "decoders", "decoder size"]
Layout = Literal["blocks", "interleaved"]
"""Blocks of 8x8 pixels with one texture each, or every pixel another one."""
PATHS: tuple[FixturePath, ...] = ("deferred", "binned")
LAYOUTS: tuple[Layout, ...] = ("blocks", "interleaved")


@dataclass(frozen=True)
class ScalingConfig:
    """Settings. A sweep changes one number; the others stay at `size`, `fixed_textures`, `fixed_decoders` and `codec`."""

    size: tuple[int, int] = (512, 512)
    sizes: tuple[tuple[int, int], ...] = ((256, 256), (512, 512), (1024, 1024))
    textures: tuple[int, ...] = (1, 10, 100, 500, 2000)
    decoders: tuple[int, ...] = (1, 10, 100, 500, 2000)
    """In the sweep of decoders there are as many textures as its largest number, so that only decoders change."""
    widths: tuple[int, ...] = (16, 32, 64, 128)
    """Neurons of each hidden layer."""
    fixed_textures: int = 20
    fixed_decoders: int = 5
    repeats: int = 5
    codec: GridConfig = field(default_factory=GridConfig)


@dataclass(frozen=True)
class ScalingRow:
    """Times of one point of one curve, in fp32."""

    sweep: SweepName
    value: int
    """The number that the sweep changes: pixels, textures, decoders, or neurons of a hidden layer."""
    layout: Layout
    path: FixturePath
    width: int
    height: int
    tiles: int
    textures: int
    decoders: int
    hidden_width: int
    median_ms: float
    min_ms: float
    max_ms: float
    nanoseconds_per_pixel: float
    """Median over all pixels."""


@dataclass(frozen=True)
class _Setup:
    """A point of a sweep, apart from the decode path."""

    sweep: SweepName
    value: int
    layout: Layout
    size: tuple[int, int]
    textures: int
    decoders: int
    codec: GridConfig


def _setups(config: ScalingConfig) -> Iterator[list[_Setup]]:
    """Each sweep's setups."""
    textures, decoders = config.fixed_textures, min(config.fixed_decoders, config.fixed_textures)
    most = max(config.decoders)
    yield [
        _Setup("resolution", size[0] * size[1], "blocks", size, textures, decoders, config.codec)
        for size in config.sizes
    ]
    yield [
        _Setup("textures", count, layout, config.size, count, 1, config.codec)
        for count in config.textures
        for layout in LAYOUTS
    ]
    yield [
        _Setup("decoders", count, layout, config.size, most, count, config.codec)
        for count in config.decoders
        for layout in LAYOUTS
    ]
    yield [
        _Setup(
            "decoder size", width, "blocks", config.size, textures, decoders, replace(config.codec, hidden_width=width)
        )
        for width in config.widths
    ]


def scaling(
    context: GraphicsContext,
    config: ScalingConfig,
    limits: PictureLimits,
    progress: Progress = no_progress,
) -> tuple[ScalingRow, ...]:
    """Times of all sweeps; the points of one sweep are timed interleaved, so that drift bends no curve.

    Raises InputError where `limits` leave no room for a tile, before anything is allocated.
    """
    sweeps = list(_setups(config))
    tilings = [_tilings(sweep, limits) for sweep in sweeps]
    loader = PackLoader(context)
    rows: list[ScalingRow] = []
    for number, (sweep, cut) in enumerate(zip(sweeps, tilings, strict=True)):

        def of_all(done: int, of: int, number: int = number) -> None:
            progress(number * of + done, len(sweeps) * of)

        rows += _swept(context, config, sweep, cut, loader, of_all)
    loader.release()
    return tuple(rows)


def _tilings(sweep: Sequence[_Setup], limits: PictureLimits) -> dict[tuple[int, int], Tiling]:
    """Tiling of each size of a sweep, such that the pictures of all its points fit into memory at once."""
    fixtures = {(setup.size, setup.layout, setup.textures) for setup in sweep}
    pixel_bytes = len(fixtures) * PICTURE_BYTES + len(sweep) * BINNED_BYTES
    return {size: tiling(size, pixel_bytes, limits) for size in dict.fromkeys(setup.size for setup in sweep)}


def _fixture(context: GraphicsContext, setup: _Setup, tiles: Tiling) -> DecodeFixture:
    words = block_words if setup.layout == "blocks" else scattered_words
    return DecodeFixture(context, tiles, words(tiles.tile, setup.textures))


def _swept(
    context: GraphicsContext,
    config: ScalingConfig,
    sweep: list[_Setup],
    tilings: dict[tuple[int, int], Tiling],
    loader: PackLoader,
    progress: Progress,
) -> list[ScalingRow]:
    fixtures: dict[tuple[tuple[int, int], Layout, int], DecodeFixture] = {}
    packs: dict[tuple[int, int, GridConfig], GpuPack] = {}
    candidates = []
    for setup in sweep:
        seen = (setup.size, setup.layout, setup.textures)
        if seen not in fixtures:
            fixtures[seen] = _fixture(context, setup, tilings[setup.size])
        content = (setup.textures, setup.decoders, setup.codec)
        if content not in packs:
            packs[content] = loader.load(square_pack(*content[:2], TEXTURE_SIDE, setup.codec), "fp32")
        candidates += [(setup, path, fixtures[seen].decoding(packs[content], path)) for path in PATHS]
    spreads = time_interleaved(context, [run for _, _, run in candidates], config.repeats, progress)
    for fixture in fixtures.values():
        fixture.release()
    for pack in packs.values():
        pack.release()
    return [
        ScalingRow(
            sweep=setup.sweep,
            value=setup.value,
            layout=setup.layout,
            path=path,
            width=setup.size[0],
            height=setup.size[1],
            tiles=tilings[setup.size].count,
            textures=setup.textures,
            decoders=setup.decoders,
            hidden_width=setup.codec.hidden_width,
            median_ms=spread.median_ms,
            min_ms=spread.min_ms,
            max_ms=spread.max_ms,
            nanoseconds_per_pixel=spread.median_ms * 1e6 / tilings[setup.size].pixels,
        )
        for (setup, path, _), spread in zip(candidates, spreads, strict=True)
    ]
