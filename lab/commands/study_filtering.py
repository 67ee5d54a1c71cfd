"""`ntc-viewer study filtering`: how well each path filters, against the supersampled originals."""

import sys
from dataclasses import asdict
from typing import get_args

from rich.console import Console
from rich.progress import Progress, TimeRemainingColumn

from lab.bench.filtering_plot import filtering_figure, filtering_table
from lab.bench.filtering_sweeps import FilteringConfig, floor_scene, floor_sweeps, motion_sweep, ways
from lab.commands.options import FilteringStudyOptions
from lab.commands.study_output import check_output, write_study
from ntc.errors import InputError
from viewer.cli.sources import choose_source, open_scene, packs_for
from viewer.gl.context import create_headless_context
from viewer.render.renderer import Renderer
from viewer.state.camera import frame_all
from viewer.state.pack_files import match_scene
from viewer.state.view_state import DecodePath, is_image_source


def study_filtering(options: FilteringStudyOptions) -> int:
    """Run `ntc-viewer study filtering`. Raises InputError for bad input."""
    check_output(options.out)
    if options.frames < 2:
        raise InputError(f"--frames {options.frames}: must be at least 2, for flicker is a change")
    scene = open_scene(options.scene)
    packs = packs_for(scene, options.pack)
    source = choose_source(packs, options.grouping, options.pack)
    if is_image_source(source):
        raise InputError(
            f"{scene.name}: {source} is no pack; name one with --pack and its --grouping, or make one with encode"
        )
    pack = packs[source]
    encoded = [index for index, found in enumerate(match_scene(pack, scene).texture_index) if found >= 0]
    config = FilteringConfig(size=options.size, frames=options.frames)
    step = max(1, len(encoded) // config.textures)
    textures = encoded[::step][: config.textures]
    all_ways = ways(source, get_args(DecodePath))
    context = create_headless_context()
    console = Console(stderr=True, soft_wrap=True)
    progress = Progress(*Progress.get_default_columns()[:-1], TimeRemainingColumn(), console=console, transient=True)
    with context.reset.watched(), progress as bar:
        total = len(config.texels_per_pixel) + len(config.tilts) + config.frames
        task = bar.add_task(scene.name, total=total)

        def advance() -> None:
            bar.advance(task)

        floor = Renderer(context, floor_scene(scene, textures))
        floor.set_packs({source: pack})
        rows = floor_sweeps(floor, scene, textures, all_ways, config, advance)
        floor.release()
        renderer = Renderer(context, scene)
        renderer.set_packs({source: pack})
        camera = scene.cameras[0] if scene.cameras else frame_all(scene.bounds)
        rows += motion_sweep(renderer, camera, all_ways, config, advance)
        renderer.release()
    table = filtering_table(rows)
    title = (
        f"{scene.name}, {source}: {len(textures)} textures, {config.size[0]}x{config.size[1]}, {context.info.renderer}"
    )
    record = {
        "study": "filtering",
        "scene": scene.name,
        "pack": source,
        "textures": [scene.textures[index].name for index in textures],
        "camera": camera.name,
        "settings": asdict(config),
        "rows": [asdict(row) for row in rows],
    }
    write_study(options.out, "filtering", title, table, filtering_figure(rows, title), record)
    sys.stdout.write(f"{title}\n{table.text()}wrote {options.out}\n")
    return 0
