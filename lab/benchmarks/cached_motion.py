"""Times of path cached with a resting and with a slowly moving camera, compared to path deferred.

    python -m lab.benchmarks.cached_motion SCENE --pack F.ntc [--cameras cameras.json --camera NAME] [--json FILE]

The picture is 1280x720 unless --size says otherwise. `turn` is a degree a frame, `walk` five centimetres a frame (in glTF's metres).
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from lab.runner import chosen_cameras, median, report, run, scene_options
from ntc.pack.file import read_pack
from viewer.gl.context import create_headless_context
from viewer.render.renderer import Renderer
from viewer.scene.load import load_scene
from viewer.scene.model import Camera
from viewer.state.navigation import turned
from viewer.state.view_state import PathChoice, Slot, ViewState

STEP = 0.05
"""Metres that the camera moves a frame."""
DEGREES = 1.0


def walked(camera: Camera, frames: int) -> Camera:
    """`camera` moved along its direction of view."""
    (x, y, z), (tx, ty, tz) = camera.eye, camera.target
    length = ((tx - x) ** 2 + (ty - y) ** 2 + (tz - z) ** 2) ** 0.5
    step = STEP * frames / max(length, 1e-9)
    move = ((tx - x) * step, (ty - y) * step, (tz - z) * step)
    eye, target = (x + move[0], y + move[1], z + move[2]), (tx + move[0], ty + move[1], tz + move[2])
    return replace(camera, eye=eye, target=target)


def main() -> None:
    """Print and write the table."""
    parser = scene_options(__doc__)
    parser.add_argument("--pack", type=Path, required=True)
    options = parser.parse_args()
    scene = load_scene(options.scene)
    renderer = Renderer(create_headless_context(), scene)
    renderer.set_packs({"p": read_pack(options.pack)})

    def milliseconds(camera: Camera, path: PathChoice) -> tuple[float, int]:
        slot = Slot("p", path)
        frame = renderer.render(ViewState(camera, options.size, slot))
        decoded = frame.tiles[slot].decoded if slot in frame.tiles else 0
        return frame.timings_ms.get(f"decode_{path}", 0.0), decoded

    rows = []
    motions: dict[str, Callable[[Camera, int], Camera]] = {
        "turn": lambda camera, frame: turned(camera, DEGREES * frame),
        "walk": walked,
    }
    for camera in chosen_cameras(scene, options.cameras, options.camera):
        milliseconds(camera, "deferred")
        cold_ms, tiles = milliseconds(camera, "cached")
        still = [milliseconds(camera, "cached")[0] for _ in range(options.frames)]
        for name, moved in motions.items():
            times: dict[str, list[float]] = {"deferred": [], "cached": []}
            fresh = []
            for frame in range(1, options.frames + 1):
                for path in ("cached", "deferred"):
                    before = tiles
                    spent, now = milliseconds(moved(camera, frame), path)
                    times[path].append(spent)
                    if path == "cached":
                        fresh.append(now - before)
                        tiles = now
            deferred, cached = median(times["deferred"]), median(times["cached"])
            rows.append(
                {
                    "camera": camera.name,
                    "motion": name,
                    "deferred ms": deferred,
                    "cached, from nothing ms": cold_ms,
                    "cached, still ms": median(still),
                    "cached, moving ms": cached,
                    "max ms": max(times["cached"]),
                    "% of deferred": 100.0 * cached / deferred,
                    "tiles a frame": median(fresh),
                }
            )
    facts = {"scene": scene.name, "renderer": renderer.name, "size": list(options.size), "frames": options.frames}
    report("cached in motion", rows, facts, options.json)


if __name__ == "__main__":
    run(main)
