"""Processor time of decoding packs of both codecs in one scene: every way in turn, in one run.

    python -m lab.benchmarks.decode_in_turns bistro.gltf --cameras cameras.json --camera square --pack grid=grid.ntc \
        --pack block=block.ntc --json lab/benchmarks/results/decode_in_turns_bistro_llvmpipe.json

    python -m lab.benchmarks.decode_in_turns bistro.gltf ... --before CHECKOUT      in turns with an earlier commit

Paths that decode every pixel are timed on whole pictures; of path `cached`, decoding the tiles of an empty cache, and apart from
that drawing from a full one. Processor time, as `time.process_time` counts it, for a software renderer decodes on the processor: a
busy machine does not change it much. The first tiles of a run are not counted.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lab.runner import chosen_cameras, median, processor_ms, report, run, scene_options
from ntc.codec.model import Pack
from ntc.pack.file import read_pack
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.gl.program import ProgramFactory, ShaderLibrary
from viewer.gl.timer import PassTimer
from viewer.locations import shaders_folder
from viewer.render.gpu_packs import GpuPack, OpenPack, binned_pass, deferred_pass
from viewer.render.pass_scheduler import PassScheduler, Step
from viewer.render.passes.visible_latents import VisibleLatents
from viewer.render.render_context import RenderContext
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.layout import scene_includes
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.render.resources.visibility_buffer import SurfaceContent, VisibilityInputs, VisibilityTarget
from viewer.render.scene_drawer import SceneDrawer
from viewer.scene.load import load_scene
from viewer.scene.model import Camera, Scene
from viewer.state.pack_files import match_scene

WHOLE_PICTURES = ("deferred", "deferred, stochastic", "binned")
ROOT = Path(__file__).resolve().parents[2]
TURNS = 2
"""Runs of each of two commits."""


@dataclass(frozen=True)
class Cost:
    """One measurement of one way."""

    processor_ms: float
    units: int
    """Pixels or tiles that were decoded."""


class PackInScene:
    """One pack, ready to be decoded over the visibility buffer of one view."""

    def __init__(self, context: RenderContext, pack: Pack, inputs: VisibilityInputs) -> None:
        match = match_scene(pack, context.scene)
        self._gpu = GpuPack(context, OpenPack(pack, match, 1), "fp32")
        self._gl, self._inputs = context.graphics.gl, inputs
        self._target = ColorTarget(context.graphics, inputs.visibility.size)
        step = Step(whole=True, is_same_view=False, is_stale=False)
        self._gpu.latents(inputs.plane).advance(inputs, VisibleLatents(), step)
        self._passes = {
            "deferred": deferred_pass(self._gpu, may_share=False),
            "deferred, stochastic": deferred_pass(self._gpu, "stochastic", may_share=False),
            "binned": binned_pass(self._gpu),
        }

    def _measured(self, action: Callable[[], object]) -> float:
        return processor_ms(action, self._gl.finish)

    def decode(self, name: str) -> Cost:
        """Decode the picture by the pass `name`; with the stochastic filter one sample."""
        width, height = self._target.size
        return Cost(self._measured(lambda: self._passes[name].run(self._inputs, self._target)), width * height)

    def decode_tiles(self) -> tuple[Cost, Cost]:
        """(decoding all tiles of the view into an empty cache, drawing from them)."""
        context, cache = self._gpu.context, self._gpu.tile_cache()
        cache.request(self._inputs)
        cache.answer(waits=True)
        # Once before it is timed: memory of the atlas is mapped when it is first written.
        cache.decode(cache.tiles_now(whole=True))
        cache.mark_stale(range(len(context.scene.textures)))
        tiles = cache.tiles_now(whole=True)
        decoding = self._measured(lambda: cache.decode(tiles))
        drawing = self._measured(lambda: cache.sample(self._inputs, self._target))
        cache.release()
        return Cost(decoding, tiles), Cost(drawing, self._target.size[0] * self._target.size[1])


def measure(
    graphics: GraphicsContext,
    scene: Scene,
    packs: Mapping[str, Pack],
    camera: Camera,
    size: tuple[int, int],
    rounds: int,
) -> list[dict[str, Any]]:
    """A row of medians for each pack and way."""
    programs = ProgramFactory(graphics.gl, ShaderLibrary(shaders_folder(), scene_includes()))
    buffers = SceneBuffers(graphics, scene)
    context = RenderContext(graphics, programs, scene, buffers, PassScheduler(PassTimer(graphics)))
    visibility = VisibilityTarget(graphics, size, SurfaceContent(buffers.has_colors, gradients=False))
    inputs = SceneDrawer(context).draw(camera, visibility)
    made = {name: PackInScene(context, pack, inputs) for name, pack in packs.items()}
    costs: dict[tuple[str, str], list[Cost]] = {}
    for turn in range(-1, rounds):
        for name, pack in made.items():
            decoding, drawing = pack.decode_tiles()
            found = {
                **{way: pack.decode(way) for way in WHOLE_PICTURES},
                "cached, tiles": decoding,
                "cached, drawing": drawing,
            }
            for way, cost in found.items():
                if turn >= 0:
                    costs.setdefault((way, name), []).append(cost)
    first = next(iter(made))
    medians = {key: median([cost.processor_ms / cost.units for cost in own]) for key, own in costs.items()}
    return [
        {
            "way": way,
            "pack": name,
            "processor ms": median([cost.processor_ms for cost in costs[way, name]]),
            "units": costs[way, name][0].units,
            "microseconds each": 1e3 * medians[way, name],
            f"{first} takes as many": medians[way, first] / medians[way, name],
        }
        for way, name in sorted(medians, key=lambda key: key[0])
    ]


def _recorded(checkout: Path, given: argparse.Namespace) -> list[dict[str, Any]]:
    """Rows of one run of `checkout`, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / "record.json"
        # Not from the folder at hand: both find the same files, each its own modules.
        command = [
            sys.executable,
            "-P",
            "-m",
            "lab.benchmarks.decode_in_turns",
            str(given.scene),
            "--json",
            str(record),
        ]
        command += ["--size", "{}x{}".format(*given.size), "--frames", str(given.frames)]
        command += ["--cameras", str(given.cameras)] if given.cameras else []
        command += [text for name in given.camera or () for text in ("--camera", name)]
        command += [text for entry in given.pack for text in ("--pack", entry)]
        environment = {**os.environ, "PYTHONPATH": str(checkout.resolve())}
        subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=True)
        rows: list[dict[str, Any]] = json.loads(record.read_text(encoding="utf-8"))["rows"]
        return rows


def in_turns(before: Path, given: argparse.Namespace) -> list[dict[str, Any]]:
    """A row for each pack and way: medians of this commit and of the one in `before`, run by turns."""
    times: dict[tuple[str, str], tuple[list[float], list[float]]] = {}
    for _ in range(TURNS):
        for place, checkout in enumerate((before, ROOT)):
            for row in _recorded(checkout, given):
                times.setdefault((row["way"], row["pack"]), ([], []))[place].append(row["processor ms"])
    medians = {key: (median(old), median(new)) for key, (old, new) in times.items()}
    return [
        {"way": way, "pack": name, "before, processor ms": old, "processor ms": new, "times faster": old / new}
        for (way, name), (old, new) in medians.items()
    ]


def main() -> None:
    """Run from the command line. Raises InputError."""
    parser = scene_options(__doc__)
    parser.add_argument("--pack", action="append", required=True, metavar="NAME=FILE", help="may be given again")
    parser.add_argument("--before", type=Path, metavar="CHECKOUT", help="measure in turns with this earlier commit")
    given = parser.parse_args()
    scene = load_scene(given.scene)
    packs = {name: read_pack(Path(file)) for name, _, file in (entry.partition("=") for entry in given.pack)}
    graphics = create_headless_context()
    camera = chosen_cameras(scene, given.cameras, given.camera)[0]
    rows = (
        measure(graphics, scene, packs, camera, given.size, given.frames)
        if given.before is None
        else in_turns(given.before, given)
    )
    facts = {
        "scene": scene.name,
        "camera": camera.name,
        "size": "{}x{}".format(*given.size),
        "rounds": given.frames,
        "packs": {name: f"codec {pack.config.kind}, {len(pack.decoders)} decoders" for name, pack in packs.items()},
        "renderer": graphics.info.renderer,
    }
    report("Processor time of decoding", rows, facts, given.json)


if __name__ == "__main__":
    run(main)
