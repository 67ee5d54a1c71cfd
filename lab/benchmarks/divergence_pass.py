"""Time of the divergence pass beside that of the visibility pass, in the same frames.

    python -m lab.benchmarks.divergence_pass scene.gltf --cameras cameras.json --size 1280x720

Groupings: a decoder for each texture, ten groups, and both at once; each by compute and by fragment shader. Medians in ms.
"""

import sys
from collections import defaultdict

from lab.bench.scene import nudged
from lab.benchmarks.measuring import arguments, chosen_cameras, median, report
from ntc.errors import InputError
from viewer.gl.context import create_headless_context
from viewer.gl.program import ProgramFactory, ShaderLibrary
from viewer.gl.timer import PassTimer
from viewer.locations import shaders_folder
from viewer.render.passes.divergence import DivergenceInputs, DivergencePass
from viewer.render.renderer import Renderer
from viewer.render.resources.divergence_maps import DecoderTables, DivergenceTarget, Stage
from viewer.render.resources.layout import scene_includes
from viewer.scene.load import load_scene
from viewer.state.view_state import BLOCKS, ViewState

STAGES: tuple[Stage, ...] = ("compute", "fragment")


def main() -> int:
    """Run from the command line."""
    given = arguments(__doc__.splitlines()[0]).parse_args()
    try:
        scene = load_scene(given.scene)
        context = create_headless_context()
        cameras = chosen_cameras(scene, given.cameras, given.camera)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    renderer = Renderer(context, scene)
    library = ShaderLibrary(shaders_folder(), scene_includes())
    programs, timer = ProgramFactory(context.gl, library), PassTimer(context)
    passes = {stage: DivergencePass(context, programs, stage) for stage in STAGES}
    count = len(scene.textures)
    each, ten = tuple(range(count)), tuple(texture % 10 for texture in range(count))
    variants = {"baseline": [each], "10 groups": [ten], "both at once": [each, ten]}
    tables = {name: DecoderTables(context, groupings) for name, groupings in variants.items()}
    targets = {name: DivergenceTarget(context, given.size, BLOCKS["8x8"], len(g)) for name, g in variants.items()}
    rows = []
    for camera in cameras:
        times: defaultdict[str, list[float]] = defaultdict(list)
        for frame in range(-1, given.frames):
            timings = renderer.render(ViewState(nudged(camera, frame), given.size)).timings_ms
            for stage, counting in passes.items():
                for name, table in tables.items():
                    with timer.measure(f"{name} {stage}"):
                        counting.run(DivergenceInputs(renderer.visibility, frame, table), targets[name])
                    with timer.measure(f"{name} {stage} statistics"):
                        targets[name].statistics()
            for name, milliseconds in {"visibility": timings["visibility"], **timer.take()}.items():
                if frame >= 0:
                    times[name].append(milliseconds)
        medians = {name: median(values) for name, values in times.items()}
        row: dict[str, str | float] = {"camera": camera.name, "visibility ms": medians["visibility"]}
        for stage in STAGES:
            row |= {f"{name}, {stage} ms": medians[f"{name} {stage}"] for name in variants}
        row["statistics ms"] = medians["baseline compute statistics"]
        row["baseline / visibility"] = medians["baseline compute"] / medians["visibility"]
        rows.append(row)
    facts = {"scene": scene.name, "size": "{}x{}".format(*given.size), "frames": given.frames, "timer": timer.kind}
    report("Divergence pass", rows, {**facts, "renderer": context.info.renderer}, given.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
