"""Subcommand `ntc-viewer bench`: time and error of every path in a scene, and the worst case for a wave."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import get_args

from rich.console import Console
from rich.progress import Progress, TimeRemainingColumn

from lab.bench.figures import time_error_figure
from lab.bench.interleaved import Progress as Report
from lab.bench.record import BenchRecord
from lab.bench.scene import PICTURE_BYTES, SceneBenchConfig, bench_scene
from lab.bench.tables import path_to_take, scene_table, worst_case_table
from lab.bench.tiles import MEBIBYTE, PictureLimits, require_memory
from lab.bench.worst_case import BLOCK_PIXELS, WorstCaseConfig, worst_case
from lab.commands.options import BenchOptions
from lab.runner import machine
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
from viewer.scene.json_text import counted
from viewer.scene.model import Camera, Scene
from viewer.state.framing import frame_all
from viewer.state.view_state import DecodePath, Precision
from viewer.viewpoints.scene_views import ViewSource, cameras_of

LEAST_MEMORY_MB = 16


def _check(options: BenchOptions) -> None:
    if options.json is not None and options.json.suffix != ".json":
        raise InputError(f"--json {options.json}: the name of a record must end in .json")
    if options.decoder_variant and options.what == "worst-case":
        raise InputError(f"--decoder-variant {options.decoder_variant}: only --what scene and all use it")
    if options.repeats is not None and options.repeats < 1:
        raise InputError(f"--repeats {options.repeats}: must be at least 1")
    if options.memory_mb < LEAST_MEMORY_MB:
        raise InputError(f"--memory-mb {options.memory_mb}: must be at least {LEAST_MEMORY_MB}")
    for option, names in (
        ("--paths", options.paths),
        ("--precisions", ("fp32",) if options.precisions is None else options.precisions),
        ("--filters", options.filters),
    ):
        if not names:
            raise InputError(f"{option}: name at least one")
    if options.worst_sizes is not None and not options.worst_sizes:
        raise InputError("--worst-sizes: name at least one size")
    if not options.decoders:
        raise InputError("--decoders: name at least one number")
    for count in options.decoders:
        if not 1 <= count <= BLOCK_PIXELS:
            raise InputError(f"--decoders {count}: must be 1 to {BLOCK_PIXELS}, the pixels of a block")
    _codec(options)


def _codec(options: BenchOptions) -> GridConfig:
    codec, width = recipe_codec(options.codec, 3, None), options.hidden_width
    try:
        return codec if width is None else replace(codec, hidden_width=width)
    except ValueError as error:
        raise InputError(f"--hidden-width {width}: must be a multiple of 4 from 4 to 256") from error


def _size(options: BenchOptions, context: GraphicsContext) -> tuple[int, int]:
    if options.size is not None:
        return options.size
    return (320, 180) if context.info.is_software and not options.thorough else (640, 360)


def _repeats(options: BenchOptions) -> int:
    return options.repeats or (5 if options.thorough else 3)


def _squares(least: int, most: int) -> tuple[tuple[int, int], ...]:
    """Return squares from `least` to `most` pixels on each side, each twice as wide as the one before."""
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
    """Return the scene to time, with its packs and cameras. Raises InputError."""
    scene = open_scene(options.scene)
    packs = packs_for(scene, options.pack)
    if not packs:
        raise InputError(f"{scene.name}: has no packs beside it; name some with --pack, or make one with encode")
    cameras = cameras_of(scene, ViewSource(options.views)) or (frame_all(scene),)
    if options.views is None and not options.thorough:
        cameras = cameras[:1]
    compressed = {block_format: compress_scene(scene, block_format) for block_format in options.formats}
    return _SceneToBench(scene, packs, cameras, compressed)


def _precisions(options: BenchOptions, context: GraphicsContext) -> tuple[Precision, ...]:
    """Return the precisions to time. Raises InputError for one that this driver does not support."""
    supported = supported_precisions(context)
    if options.precisions is None:
        return supported if options.thorough else ("fp32",)
    if set(options.precisions) == set(get_args(Precision)):
        return supported
    for precision in options.precisions:
        if precision not in supported:
            raise InputError(
                f"--precisions {precision}: {context.info.renderer} has no half arithmetic in shaders; name fp32 or fp16"
            )
    return options.precisions


def _paths(options: BenchOptions, context: GraphicsContext) -> tuple[DecodePath, ...]:
    """Return the paths to time: those of the options, or where these are all, those that this driver can run.

    Raises InputError for a path that it cannot run.
    """
    if set(options.paths) == set(get_args(DecodePath)):
        return drawable_paths(context)
    lacking = unsupported_paths(context)
    for path in options.paths:
        if path in lacking:
            raise InputError(f"--paths {path}: {lacking[path]}")
    return options.paths


def _parts(options: BenchOptions, context: GraphicsContext) -> tuple[str, ...]:
    """Return the parts to time. Of all parts, those that this driver cannot run are left out with a line on standard error.

    Raises InputError where the user named such a part.
    """
    what = options.what or ("all" if options.thorough else "scene")
    if context.features.compute:
        return ("worst-case", "scene") if what == "all" else (what,)
    reason = f"the worst case needs compute shaders (OpenGL 4.3), which this driver lacks ({context.info.version})"
    if what == "all":
        sys.stderr.write(f"{reason}: the scene alone is timed\n")
    elif what != "scene":
        raise InputError(f"--what {options.what}: {reason}; take --what scene")
    return ("scene",)


def bench(options: BenchOptions) -> int:
    """Run `ntc-viewer bench`. Raises InputError for bad input, before anything is timed."""
    _check(options)
    context = create_headless_context(options.device)
    _precisions(options, context)
    options = replace(options, paths=_paths(options, context))
    wanted = _parts(options, context)
    limits = PictureLimits(int(context.gl.info["GL_MAX_TEXTURE_SIZE"]), options.memory_mb * MEBIBYTE)
    opened = None
    if "scene" in wanted:
        require_memory("--size", _size(options, context), PICTURE_BYTES, limits)
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
    if options.json is not None:
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
    config = WorstCaseConfig(sizes, options.decoders, _precisions(options, context), _repeats(options), _codec(options))
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
        _size(options, context),
        options.paths,
        _precisions(options, context),
        _repeats(options),
        options.formats,
        options.filters,
    )
    name = opened.scene.name
    compressed = opened.compressed
    places = (opened.scene, opened.packs, opened.cameras)
    rows = bench_scene(context, *places, config, report(name), compressed, options.decoder_variant)
    table = scene_table(rows)
    width, height = config.size
    title = f"{name}: {counted(len(opened.cameras), 'camera')}, {width}x{height}, {context.info.renderer}"
    content = {
        "name": name,
        "settings": {**asdict(config), "decoder_variant": options.decoder_variant},
        "block_compression": [compression_statistics(textures) for textures in compressed.values()],
        "table": [dict(row) for row in table.rows],
        "rows": [asdict(row) for row in rows],
    }
    record.plot("", time_error_figure(table, title))
    record.add("scene", content, "", title, table)
    return f"{title}\n{table.text()}\n{path_to_take(table)}"
