"""Open one scene of many textures, draw it as a window does, and print what that took as JSON, in a process of its own.

python -m lab.benchmarks.many_textures.open_scene SCENE --camera street [--pack F.ntc] [--make-pack F.ntc]
"""

import argparse
import json
import resource
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from ntc.codec.block.config import BlockConfig
from ntc.codec.model import Grouping
from ntc.pack.file import read_pack, write_pack
from viewer.gl.context import create_headless_context
from viewer.render.renderer import Renderer
from viewer.scene.cameras_file import find_camera, with_cameras_beside
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.scene.source_textures import source_textures
from viewer.state.view_state import REFERENCE, Slot, ViewState

SIZE = (1280, 720)
PACK_SIDE = 64
"""Largest side in texels of the textures of a stand-in pack."""
REST_SECONDS = 0.02


def measured(scene_path: Path, camera: str, pack_path: Path | None, whole: bool = True) -> dict[str, Any]:
    """Seconds from the beginning to: the scene is open, a first picture, the whole picture; and the largest memory."""
    began = time.monotonic()
    scene = with_cameras_beside(load_scene(scene_path))
    found: dict[str, Any] = {"textures": len(scene.textures), "open_s": time.monotonic() - began}
    context = create_headless_context()
    renderer = Renderer(replace(context, waits=False), scene)
    slot = Slot(REFERENCE)
    if pack_path is not None:
        renderer.set_packs({"pack": read_pack(pack_path)})
        slot = Slot("pack", "deferred")
    view = ViewState(find_camera(scene.cameras, camera), SIZE, slot, slot, material_view="lit")
    frame = renderer.render(view)
    context.gl.finish()
    found["first_picture_s"] = time.monotonic() - began
    while whole and not frame.is_complete:
        time.sleep(REST_SECONDS)
        frame = renderer.render(view)
    context.gl.finish()
    usage = resource.getrusage(resource.RUSAGE_SELF)
    found |= {
        "whole_picture_s": time.monotonic() - began if whole else None,
        "cpu_s": usage.ru_utime + usage.ru_stime,
        "peak_mb": usage.ru_maxrss / 1024,
        "largest_side": renderer.images.largest_side,
        "renderer": renderer.name,
    }
    return found


def write_stand_in(scene: Scene, path: Path) -> None:
    """A pack of base colours, each texture all in its mean colour: nothing is trained."""
    from ntc.codec.block.start import mean_colour_pack

    textures = source_textures(scene, PACK_SIDE)
    write_pack(path, mean_colour_pack(textures, Grouping("single", (0,) * len(textures)), BlockConfig()))


def main() -> None:
    """Measure, or make a pack."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--camera", default="street")
    parser.add_argument("--pack", type=Path)
    parser.add_argument("--make-pack", type=Path)
    parser.add_argument("--first", action="store_true", help="end with the first picture")
    options = parser.parse_args()
    if options.make_pack is not None:
        write_stand_in(load_scene(options.scene), options.make_pack)
        return
    print(json.dumps(measured(options.scene, options.camera, options.pack, not options.first)))


if __name__ == "__main__":
    main()
