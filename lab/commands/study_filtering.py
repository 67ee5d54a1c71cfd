"""`ntc-viewer study filtering`: how well each path filters, against the supersampled originals."""

from collections.abc import Mapping
from dataclasses import asdict

from rich.console import Console
from rich.progress import Progress, TimeRemainingColumn

from lab.bench.filtering_plot import filtering_figure, filtering_table
from lab.bench.filtering_sweeps import FilteringConfig, floor_scene, floor_sweeps, motion_sweep, ways
from lab.commands.options import FilteringStudyOptions
from lab.runner import StudyOutput
from ntc.codec.model import Pack
from ntc.errors import InputError
from viewer.cli.sources import choose_source, open_scene, packs_for
from viewer.gl.context import create_headless_context
from viewer.render.renderer import Renderer
from viewer.state.framing import frame_all
from viewer.state.pack_files import match_scene
from viewer.state.view_state import is_image_source


def _sources(packs: Mapping[str, Pack], options: FilteringStudyOptions, scene: str) -> tuple[str, ...]:
    """Names of the packs to study: the one of --grouping, all of --pack, or the scene's own. Raises InputError where it has none."""
    named = tuple(name for name, pack in packs.items() if pack.path in options.pack)
    if options.grouping is None and len(named) > 1:
        return named
    source = choose_source(packs, options.grouping, options.pack)
    if is_image_source(source):
        raise InputError(
            f"{scene}: {source} is no pack; name one with --pack and its --grouping, or make one with encode"
        )
    return (source,)


def study_filtering(options: FilteringStudyOptions) -> int:
    """Run `ntc-viewer study filtering`. Raises InputError for bad input."""
    output = StudyOutput(options.out)
    if options.frames < 2:
        raise InputError(f"--frames {options.frames}: must be at least 2, for flicker is a change")
    scene = open_scene(options.scene)
    packs = packs_for(scene, options.pack)
    sources = _sources(packs, options, scene.name)
    studied = {source: packs[source] for source in sources}
    matches = [match_scene(pack, scene).texture_index for pack in studied.values()]
    encoded = [index for index, found in enumerate(zip(*matches, strict=True)) if min(found) >= 0]
    if not encoded:
        raise InputError(f"{scene.name}: no texture is in all of these packs; name packs of the same textures")
    config = FilteringConfig(size=options.size, frames=options.frames)
    step = max(1, len(encoded) // config.textures)
    textures = encoded[::step][: config.textures]
    kinds = [f"codec {pack.config.kind}" for pack in studied.values()]
    labels = dict(zip(studied, kinds if len(set(kinds)) > 1 else sources, strict=True))
    all_ways = ways(labels)
    context = output.context = create_headless_context()
    console = Console(stderr=True, soft_wrap=True)
    progress = Progress(*Progress.get_default_columns()[:-1], TimeRemainingColumn(), console=console, transient=True)
    with context.reset.watched(), progress as bar:
        total = len(config.texels_per_pixel) + len(config.tilts) + config.frames
        task = bar.add_task(scene.name, total=total)

        def advance() -> None:
            bar.advance(task)

        floor = Renderer(context, floor_scene(scene, textures))
        floor.set_packs(studied)
        rows = floor_sweeps(floor, scene, textures, all_ways, config, advance)
        floor.release()
        renderer = Renderer(context, scene)
        renderer.set_packs(studied)
        camera = scene.cameras[0] if scene.cameras else frame_all(scene)
        rows += motion_sweep(renderer, camera, all_ways, config, advance)
        renderer.release()
    table = filtering_table(rows)
    width, height = config.size
    drawn = f"{len(textures)} textures, {width}x{height}, {context.info.renderer}"
    title = f"{scene.name}, {' and '.join(labels.values())}: {drawn}"
    facts = {
        "scene": scene.name,
        "packs": dict(zip(sources, kinds, strict=True)),
        "textures": [scene.textures[index].name for index in textures],
        "camera": camera.name,
        "settings": asdict(config),
    }
    output.write("filtering", title, table, filtering_figure(rows, title), facts, [asdict(row) for row in rows])
    output.end()
    return 0
