"""Times of path cached with a resting and with a slowly moving camera, compared to path deferred.

    python -m lab.benchmarks.cached_motion SCENE --pack F.ntc [--cameras cameras.json --camera NAME] [--json FILE]

The picture is 1280x720 unless --size says otherwise. `turn` is a degree a frame, `walk` five centimetres a frame (in glTF's metres).
With --alone path deferred is left out, which takes long. Of whole materials all planes are drawn. The time on a GPU is estimated from
the tiles that frames decode, not measured.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from lab.runner import chosen_cameras, median, report, run, scene_options
from ntc.codec.maps import plane_channels
from ntc.codec.registry import codec_of
from ntc.pack.file import read_pack
from viewer.gl.context import create_headless_context
from viewer.inspect.gpu_estimate import ESTIMATED_GPU, PAGE_TEXELS, estimated_tile_ms
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
    parser.add_argument("--alone", action="store_true", help="leave out path deferred")
    options = parser.parse_args()
    scene = load_scene(options.scene)
    pack = read_pack(options.pack)
    planes = len(plane_channels(pack.config.maps, pack.config.output_channels))
    tile_ms = estimated_tile_ms(pack, Slot("p", "cached"))
    renderer = Renderer(create_headless_context(), scene)
    renderer.set_packs({"p": pack})

    def milliseconds(camera: Camera, path: PathChoice) -> tuple[float, int]:
        slot = Slot("p", path)
        view = ViewState(camera, options.size, slot, material_view="base" if planes == 1 else "lit")
        frame = renderer.render(view)
        decoded = frame.tiles[slot].decoded if slot in frame.tiles else 0
        return frame.timings_ms.get(f"decode_{path}", 0.0), decoded

    rows = []
    motions: dict[str, Callable[[Camera, int], Camera]] = {
        "turn": lambda camera, frame: turned(camera, DEGREES * frame),
        "walk": walked,
    }
    for camera in chosen_cameras(scene, options.cameras, options.camera):
        if not options.alone:
            milliseconds(camera, "deferred")
        cold_ms, tiles = milliseconds(camera, "cached")
        still = [milliseconds(camera, "cached")[0] for _ in range(options.frames)]
        for name, moved in motions.items():
            times: dict[str, list[float]] = {"deferred": [], "cached": []}
            fresh = []
            for frame in range(1, options.frames + 1):
                spent, now = milliseconds(moved(camera, frame), "cached")
                times["cached"].append(spent)
                fresh.append(now - tiles)
                tiles = now
                if not options.alone:
                    times["deferred"].append(milliseconds(moved(camera, frame), "deferred")[0])
            deferred, cached = median(times["deferred"]), median(times["cached"])
            rows.append(
                {
                    "camera": camera.name,
                    "motion": name,
                    "deferred ms": None if options.alone else deferred,
                    "cached, from nothing ms": cold_ms,
                    "cached, still ms": median(still),
                    "cached, moving ms": cached,
                    "max ms": max(times["cached"]),
                    "% of deferred": None if options.alone else 100.0 * cached / deferred,
                    "tiles a frame": median(fresh),
                    "most tiles": max(fresh),
                    "texels a frame": median(fresh) * PAGE_TEXELS,
                    "estimated ms": None if tile_ms is None else median(fresh) * tile_ms,
                    "estimated ms, most": None if tile_ms is None else max(fresh) * tile_ms,
                }
            )
    facts = {
        "scene": scene.name,
        "renderer": renderer.name,
        "size": list(options.size),
        "frames": options.frames,
        "estimated for": ESTIMATED_GPU,
        "codec": pack.config.kind,
        "planes": planes,
        "coefficients": codec_of(pack.config).gpu_tables(pack.config).coefficients(pack),
    }
    report("cached in motion", rows, facts, options.json)


if __name__ == "__main__":
    run(main)
