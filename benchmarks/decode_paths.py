"""Frame times of the reference and of both decode paths in both precisions, one after the other in turn.

    python -m benchmarks.decode_paths scene.glb --packs clustered.ntc single.ntc --size 960x540

Times are those of the passes (timer queries on a GPU, wall time around `finish()` on a software renderer), medians in ms.
"""

import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

from benchmarks.measuring import arguments, chosen_cameras, median, report
from ntc.errors import InputError
from ntc.pack import Pack
from viewer.bench.scene import nudged
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.pack_files import open_packs
from viewer.renderer import Renderer
from viewer.scene.load import load_scene
from viewer.scene.model import Camera, Scene
from viewer.view_state import REFERENCE, DecodePath, Precision, Slot, ViewState

PATHS: tuple[DecodePath, ...] = ("deferred", "forward", "binned")
PRECISIONS: tuple[Precision, ...] = ("fp32", "fp16")
WARM_UP_FRAMES = 1


def slots_of(packs: dict[str, Pack], precisions: tuple[Precision, ...]) -> list[Slot]:
    """Everything that is compared."""
    decoded = [Slot(name, path, precision) for name in packs for path in PATHS for precision in precisions]
    return [Slot(REFERENCE), *decoded]


def measure(
    context: GraphicsContext,
    scene: Scene,
    packs: dict[str, Pack],
    cameras: tuple[Camera, ...],
    size: tuple[int, int],
    frames: int,
    precisions: tuple[Precision, ...],
) -> list[dict[str, Any]]:
    """One row of medians for each camera and slot."""
    renderer = Renderer(context, scene)
    renderer.set_packs(packs)
    rows: list[dict[str, Any]] = []
    slots = slots_of(packs, precisions)
    for camera in cameras:
        times: dict[Slot, dict[str, list[float]]] = {slot: defaultdict(list) for slot in slots}
        for frame in range(-WARM_UP_FRAMES, frames):
            for number, slot in enumerate(slots):
                moved = nudged(camera, frame * len(slots) + number)
                timings = renderer.render(ViewState(moved, size, slot)).timings_ms
                for name, milliseconds in timings.items() if frame >= 0 else ():
                    times[slot][name].append(milliseconds)
        for slot in slots:
            is_reference = slot.source == REFERENCE
            shading = REFERENCE if is_reference else f"decode_{slot.path}"
            medians = {name: median(values) for name, values in times[slot].items()}
            rows.append(
                {
                    "camera": camera.name,
                    "source": slot.source,
                    "path": "" if is_reference else slot.path,
                    "precision": "" if is_reference else slot.precision,
                    "visibility ms": medians.get("visibility", 0.0),
                    "shading ms": medians.get(shading, 0.0),
                    "composite ms": medians.get("composite", 0.0),
                    "frame ms": sum(medians.values()),
                }
            )
    renderer.release()
    return rows


def main() -> int:
    """Run from the command line."""
    parser = arguments(__doc__.splitlines()[0])
    parser.add_argument("--packs", type=Path, nargs="+", required=True)
    parser.add_argument("--precision", choices=PRECISIONS, help="only this one; default both")
    given = parser.parse_args()
    precisions: tuple[Precision, ...] = (given.precision,) if given.precision else PRECISIONS
    try:
        scene = load_scene(given.scene)
        packs = open_packs(given.packs)
        context = create_headless_context()
        cameras = chosen_cameras(scene, given.cameras, given.camera)
        rows = measure(context, scene, packs, cameras, given.size, given.frames, precisions)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    facts = {
        "scene": scene.name,
        "size": "{}x{}".format(*given.size),
        "frames": given.frames,
        "renderer": context.info.renderer,
    }
    report("Decode paths", rows, facts, given.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
