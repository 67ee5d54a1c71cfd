"""`ntc-viewer bench`: the worst case for a wave, time against error in a scene, and how time grows."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import get_args

from rich.console import Console
from rich.progress import Progress, TimeRemainingColumn

from lab.bench.figures import scaling_figure, time_error_figure
from lab.bench.interleaved import Progress as Report
from lab.bench.record import BenchRecord, machine
from lab.bench.scaling import ScalingConfig, scaling
from lab.bench.scene import PICTURE_BYTES, SceneBenchConfig, bench_scene
from lab.bench.tables import scaling_table, scene_table, worst_case_table
from lab.bench.tiles import MEBIBYTE, PictureLimits, require_memory
from lab.bench.worst_case import BLOCK_PIXELS, WorstCaseConfig, worst_case
from lab.commands.options import BenchOptions
from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.training.config import recipe_codec
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.metrics.block_compression import BlockFormat
from ntc.metrics.compressed_textures import CompressedTextures
from viewer.cli.render import compression_statistics
from viewer.cli.sources import compress_scene, open_scene, packs_for
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.render.path_choice import drawable_paths, unsupported_paths
from viewer.render.resources.decoding_shaders import supported_precisions
from viewer.render.variants import VariantChoice
from viewer.scene.model import Camera, Scene
from viewer.state.camera import frame_all
from viewer.state.view_state import DecodePath, Precision
from viewer.viewpoints.scene_views import ViewSource, cameras_of

MOST = 2000
"""Largest number of textures, and of decoders, of the scaling."""
LEAST_MEMORY_MB = 16


def _check_counts(option: str, counts: tuple[int, ...], most: int, why: str = "") -> None:
    if not counts:
        raise InputError(f"{option}: name at least one number")
    for count in counts:
        if not 1 <= count <= most:
            raise InputError(f"{option} {count}: must be 1 to {most}{why}")


def _check(options: BenchOptions) -> None:
    if options.json.suffix != ".json":
        raise InputError(f"--json {options.json}: a record's name ends in .json")
    VariantChoice(options.decoder_variant)
    if options.decoder_variant and options.what not in ("all", "scene"):
        raise InputError(f"--decoder-variant {options.decoder_variant}: only --what scene and all have it")
    if options.repeats < 1:
        raise InputError(f"--repeats {options.repeats}: must be at least 1")
    if options.memory_mb < LEAST_MEMORY_MB:
        raise InputError(f"--memory-mb {options.memory_mb}: must be at least {LEAST_MEMORY_MB}")
    for option, names in (
        ("--paths", options.paths),
        ("--precisions", options.precisions),
        ("--filters", options.filters),
    ):
        if not names:
            raise InputError(f"{option}: name at least one")
    for option, sizes in (("--worst-sizes", options.worst_sizes), ("--scaling-sizes", options.scaling_sizes)):
        if sizes is not None and not sizes:
            raise InputError(f"{option}: name at least one size")
    _check_counts("--decoders", options.decoders, BLOCK_PIXELS, ", the pixels of a block")
    _check_counts("--scaling-textures", options.scaling_textures, MOST)
    _check_counts("--scaling-decoders", options.scaling_decoders, MOST)
    _codec(options)
    for width in options.scaling_widths:
        _with_width(_codec(options), "--scaling-widths", width)


def _with_width(codec: GridConfig, option: str, width: int) -> GridConfig:
    try:
        return replace(codec, hidden_width=width)
    except ValueError as error:
        raise InputError(f"{option} {width}: must be a multiple of 4 from 4 to 256") from error


def _codec(options: BenchOptions) -> GridConfig:
    codec = recipe_codec(options.codec, 3, None)
    return codec if options.hidden_width is None else _with_width(codec, "--hidden-width", options.hidden_width)


def _squares(least: int, most: int) -> tuple[tuple[int, int], ...]:
    """Squares from `least` to `most` pixels a side, each twice as wide as the one before."""
    sides = [least]
    while sides[-1] < most:
        sides.append(sides[-1] * 2)
    return tuple((side, side) for side in sides)


@dataclass(frozen=True, eq=False)
class _SceneToBench:
    scene: Scene
    packs: Mapping[str, Pack]
    cameras: tuple[Camera, ...]
    compressed: Mapping[BlockFormat, CompressedTextures]


def _open(options: BenchOptions) -> _SceneToBench:
    """The scene, packs and cameras of the scene's part. Raises InputError."""
    scene = open_scene(options.scene)
    packs = packs_for(scene, options.pack)
    if not packs:
        raise InputError(f"{scene.name}: has no packs beside it; name some with --pack, or make one with encode")
    cameras = cameras_of(scene, ViewSource(options.views)) or (frame_all(scene.bounds),)
    compressed = {block_format: compress_scene(scene, block_format) for block_format in options.formats}
    return _SceneToBench(scene, packs, cameras, compressed)


def _precisions(options: BenchOptions, context: GraphicsContext) -> tuple[Precision, ...]:
    """The precisions of the options; if those are all, the ones this driver supports. Raises InputError for one that it does not."""
    supported = supported_precisions(context)
    if set(options.precisions) == set(get_args(Precision)):
        return supported
    for precision in options.precisions:
        if precision not in supported:
            raise InputError(
                f"--precisions {precision}: {context.info.renderer} has no half arithmetic in shaders; name fp32 or fp16"
            )
    return options.precisions


def _paths(options: BenchOptions, context: GraphicsContext) -> tuple[DecodePath, ...]:
    """The paths of the options; if those are all, the ones this driver can run. Raises InputError for one that it cannot."""
    if set(options.paths) == set(get_args(DecodePath)):
        return drawable_paths(context)
    lacking = unsupported_paths(context)
    for path in options.paths:
        if path in lacking:
            raise InputError(f"--paths {path}: {lacking[path]}")
    return options.paths


def _parts(options: BenchOptions, context: GraphicsContext) -> tuple[str, ...]:
    """What is timed. Raises InputError for a part that this driver cannot run; of all of them it is left out, and a line says so."""
    every = ("worst-case", "scene", "scaling")
    if context.features.compute:
        return every if options.what == "all" else (options.what,)
    reason = f"worst-case and scaling need compute shaders (OpenGL 4.3), which are not to be had here ({context.info.version})"
    if options.what == "all":
        sys.stderr.write(f"{reason}: the scene alone is timed\n")
    elif options.what != "scene":
        raise InputError(f"--what {options.what}: {reason}; take --what scene")
    return ("scene",)


def bench(options: BenchOptions) -> int:
    """Run `ntc-viewer bench`. Raises InputError for bad input, before anything is timed."""
    _check(options)
    context = create_headless_context(options.device)
    options = replace(options, precisions=_precisions(options, context), paths=_paths(options, context))
    wanted = _parts(options, context)
    limits = PictureLimits(int(context.gl.info["GL_MAX_TEXTURE_SIZE"]), options.memory_mb * MEBIBYTE)
    opened = None
    if "scene" in wanted:
        require_memory("--size", options.size, PICTURE_BYTES, limits)
        opened = _open(options)
    record = BenchRecord(options.json, machine(context))
    console = Console(stderr=True, soft_wrap=True)
    progress = Progress(*Progress.get_default_columns()[:-1], TimeRemainingColumn(), console=console, transient=True)
    with context.reset.watched(), progress as bar:

        def report(name: str) -> Report:
            task = bar.add_task(name, total=None)
            return lambda done, of: bar.update(task, completed=done, total=of)

        if "worst-case" in wanted:
            bar.print(_bench_worst_case(options, context, limits, record, report))
        if opened is not None:
            bar.print(_bench_scene(options, context, opened, record, report))
        if "scaling" in wanted:
            bar.print(_bench_scaling(options, context, limits, record, report))
    sys.stdout.write(f"wrote {options.json}\n")
    return 0


MakeReport = Callable[[str], Report]


def _bench_worst_case(
    options: BenchOptions,
    context: GraphicsContext,
    limits: PictureLimits,
    record: BenchRecord,
    report: MakeReport,
) -> str:
    sizes = options.worst_sizes or _squares(512, 512 if context.info.is_software else 8192)
    config = WorstCaseConfig(sizes, options.decoders, options.precisions, options.repeats, _codec(options))
    rows = worst_case(context, config, limits, report("worst case"))
    table = worst_case_table(rows)
    title = f"Every decoder in every block, codec of recipe {options.codec}, {context.info.renderer}"
    content = {"settings": asdict(config), "rows": [asdict(row) for row in rows]}
    record.add("worst_case", content, ".worst-case", title, table)
    return f"{title}\n{table.text()}"


def _bench_scene(
    options: BenchOptions,
    context: GraphicsContext,
    opened: _SceneToBench,
    record: BenchRecord,
    report: MakeReport,
) -> str:
    config = SceneBenchConfig(
        options.size, options.paths, options.precisions, options.repeats, options.formats, options.filters
    )
    name = opened.scene.name
    compressed = opened.compressed
    places = (opened.scene, opened.packs, opened.cameras)
    variants = VariantChoice.of_environment(options.decoder_variant, print)
    rows = bench_scene(context, *places, config, report(name), compressed, variants)
    table = scene_table(rows)
    width, height = config.size
    title = f"{name}: {len(opened.cameras)} cameras, {width}x{height}, {context.info.renderer}"
    content = {
        "name": name,
        "settings": {**asdict(config), "decoder_variant": options.decoder_variant},
        "block_compression": [compression_statistics(found) for found in compressed.values()],
        "table": [dict(row) for row in table.rows],
        "rows": [asdict(row) for row in rows],
    }
    record.plot("", time_error_figure(table, title))
    record.add("scene", content, "", title, table)
    return f"{title}\n{table.text()}"


def _bench_scaling(
    options: BenchOptions,
    context: GraphicsContext,
    limits: PictureLimits,
    record: BenchRecord,
    report: MakeReport,
) -> str:
    sizes = options.scaling_sizes or _squares(256, 1024 if context.info.is_software else 4096)
    config = ScalingConfig(
        size=sizes[len(sizes) // 2],
        sizes=sizes,
        textures=options.scaling_textures,
        decoders=options.scaling_decoders,
        widths=options.scaling_widths,
        repeats=options.repeats,
        codec=_codec(options),
    )
    rows = scaling(context, config, limits, report("scaling"))
    table = scaling_table(rows)
    width, height = config.size
    title = f"How decoding scales: codec of recipe {options.codec}, {width}x{height} where not swept, {context.info.renderer}"
    record.plot(".scaling", scaling_figure(rows, title))
    record.add("scaling", {"settings": asdict(config), "rows": [asdict(row) for row in rows]}, ".scaling", title, table)
    return f"{title}\n{table.text()}"
