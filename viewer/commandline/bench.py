"""`ntc-viewer bench`: the worst case for a wave, and time against error in a scene."""

import importlib.metadata
import io
import json
import platform
import sys
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import Progress, TimeRemainingColumn

from ntc.errors import InputError
from ntc.files import write_bytes, write_text
from ntc.training_config import recipe_codec
from viewer.bench.scene import SceneBenchConfig, bench_scene
from viewer.bench.tables import scene_table, time_error_figure, worst_case_table
from viewer.bench.worst_case import WorstCaseConfig, worst_case
from viewer.camera import frame_all
from viewer.commandline.bench_options import BenchOptions
from viewer.commandline.sources import open_scene, packs_for
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.gl.timer import PassTimer
from viewer.renderer import Renderer
from viewer.scene_views import ViewSource, cameras_of


def _check(options: BenchOptions) -> None:
    if options.json.suffix != ".json":
        raise InputError(f"--json {options.json}: a record's name ends in .json")
    if options.repeats < 1:
        raise InputError(f"--repeats {options.repeats}: must be at least 1")
    for count in options.decoders:
        if not 1 <= count <= 2000:
            raise InputError(f"--decoders {count}: must be 1 to 2000")


def _machine(context: GraphicsContext) -> dict[str, Any]:
    return {
        "renderer": context.info.renderer,
        "timer": PassTimer(context).kind,
        "processor": platform.machine(),
        "python": platform.python_version(),
        "moderngl": importlib.metadata.version("moderngl"),
        "numpy": np.__version__,
    }


def bench(options: BenchOptions) -> int:
    """Run `ntc-viewer bench`. Raises InputError for bad input."""
    _check(options)
    context = create_headless_context()
    record: dict[str, Any] = {"machine": _machine(context)}
    console = Console(stderr=True, soft_wrap=True)
    with Progress(*Progress.get_default_columns()[:-1], TimeRemainingColumn(), console=console, transient=True) as bar:
        if options.what in ("all", "worst-case"):
            task = bar.add_task("worst case", total=None)
            codec = recipe_codec(options.codec, 3, None)
            config = WorstCaseConfig(options.worst_size, options.decoders, options.precisions, options.repeats, codec)
            rows = worst_case(context, config, lambda done, of: bar.update(task, completed=done, total=of))
            table = worst_case_table(rows)
            record["worst_case"] = {"settings": asdict(config), "rows": [asdict(row) for row in rows]}
            title = "{}x{}, every decoder in every block, codec of recipe {}".format(*options.worst_size, options.codec)
            bar.print(f"{title}, {context.info.renderer}\n{table.text()}")
            write_text(options.json.with_suffix(".worst-case.md"), f"# {title}\n\n{table.markdown()}")
        if options.what in ("all", "scene"):
            _bench_scene(options, context, record, bar)
    write_text(options.json, json.dumps(record, indent=1, allow_nan=False) + "\n")
    sys.stdout.write(f"wrote {options.json}\n")
    return 0


def _bench_scene(options: BenchOptions, context: GraphicsContext, record: dict[str, Any], bar: Progress) -> None:
    scene = open_scene(options.scene)
    packs = packs_for(scene, options.pack)
    if not packs:
        raise InputError(f"{scene.name}: has no packs beside it; name some with --pack, or make one with encode")
    cameras = cameras_of(scene, ViewSource(options.views)) or (frame_all(scene.bounds),)
    config = SceneBenchConfig(options.size, options.paths, options.precisions, options.repeats)
    task = bar.add_task(scene.name, total=None)
    renderer = Renderer(context, scene)
    rows = bench_scene(renderer, packs, cameras, config, lambda done, of: bar.update(task, completed=done, total=of))
    renderer.release()
    table = scene_table(rows)
    title = f"{scene.name}: {len(cameras)} cameras, {config.size[0]}x{config.size[1]}, {context.info.renderer}"
    picture = io.BytesIO()
    time_error_figure(table, title).savefig(picture, format="png", dpi=110, metadata={"Software": None})
    write_bytes(options.json.with_suffix(".png"), picture.getvalue())
    write_text(options.json.with_suffix(".md"), f"# {title}\n\n{table.markdown()}")
    record["scene"] = {
        "name": scene.name,
        "settings": asdict(config),
        "table": [dict(row) for row in table.rows],
        "rows": [asdict(row) for row in rows],
    }
    bar.print(f"{title}\n{table.text()}")
