"""Time of lighting a frame beside that of sampling the original base colours, in turns.

    python -m lab.benchmarks.lit_frame assets/courtyard.glb --cameras assets/courtyard.cameras.json --json FILE

`reference` is the pass of a view of base colours; `planes` all planes that the lit view samples, `shade` its lighting. Then, once for
each camera: what dragging the sun costs, and each view of a map. Medians in ms; `fastest` is the ratio of the fastest of each.
"""

import sys
from collections import defaultdict
from dataclasses import replace
from typing import Any, get_args

from lab.bench.scene import nudged
from lab.benchmarks.measuring import arguments, chosen_cameras, median, report
from ntc.errors import InputError
from viewer.gl.context import create_headless_context
from viewer.render.renderer import Renderer
from viewer.scene.load import load_scene
from viewer.state.view_state import Lighting, MaterialView, ViewState

MAPS: tuple[MaterialView, ...] = tuple(view for view in get_args(MaterialView) if view not in ("lit", "base"))


def main() -> int:
    """Run from the command line."""
    parser = arguments(__doc__.splitlines()[0])
    parser.add_argument("--environment", help="panorama; without it the sky")
    given = parser.parse_args()
    try:
        scene = load_scene(given.scene)
        context = create_headless_context()
        cameras = chosen_cameras(scene, given.cameras, given.camera)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    # A renderer for each kind of view: neither's visibility buffer is made anew while the other draws.
    plain, lit = Renderer(context, scene), Renderer(context, scene)
    lighting = Lighting(environment=given.environment) if given.environment else Lighting()
    rows: list[dict[str, Any]] = []
    for camera in cameras:
        times: defaultdict[str, list[float]] = defaultdict(list)
        for frame in range(-2, given.frames):
            view = ViewState(nudged(camera, frame), given.size, material_view="base")
            found = {"reference": plain.render(view).timings_ms["reference"]}
            bright = lit.render(replace(view, material_view="lit", lighting=lighting)).timings_ms
            found |= {"planes": bright["reference"], "shade": bright["shade"], "visibility": bright["visibility"]}
            dragged = replace(lighting, sun_elevation=lighting.sun_elevation + 0.1 * (frame + 3))
            moved = lit.render(replace(view, material_view="lit", lighting=dragged)).timings_ms
            found |= {name: moved[name] for name in ("prefilter", "shadow") if name in moved}
            for name, milliseconds in found.items():
                if frame >= 0:
                    times[name].append(milliseconds)
        for shown in MAPS:
            frame_times = lit.render(ViewState(camera, given.size, material_view=shown)).timings_ms
            times[f"view {shown}"].append(frame_times["shade"])
        row: dict[str, Any] = {
            "camera": camera.name,
            **{f"{name} ms": median(values) for name, values in times.items()},
        }
        row["shade / reference"] = median(times["shade"]) / median(times["reference"])
        row["fastest"] = min(times["shade"]) / min(times["reference"])
        rows.append(row)
    timer = "gpu timer query" if context.features.timer_queries else "wall time around finish"
    facts = {"scene": scene.name, "size": "{}x{}".format(*given.size), "frames": given.frames, "timer": timer}
    report("Lighting", rows, {**facts, "renderer": context.info.renderer}, given.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
