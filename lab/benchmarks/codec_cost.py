"""Decoding time of the parts of a codec: the deferred pass with packs of several codec shapes, interleaved.

    python -m lab.benchmarks.codec_cost assets/courtyard.glb --size 640x360 --json lab/benchmarks/results/codec_cost_llvmpipe.json

Packs are trained for one step at 64 texels: what they show means nothing, what they cost does.
"""

import sys
from collections.abc import Mapping
from typing import Any

from lab.bench.scene import nudged
from lab.benchmarks.measuring import arguments, chosen_cameras, median, report
from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.training.config import TrainingConfig
from ntc.codec.model import Grouping, Pack
from ntc.errors import InputError
from ntc.training.encode import encode_textures
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.render.renderer import Renderer
from viewer.scene.load import load_scene
from viewer.scene.model import Camera, Scene
from viewer.scene.source_textures import source_textures
from viewer.state.view_state import Slot, ViewState

TEXTURE_SIZE = 64
CODECS: Mapping[str, GridConfig] = {
    "4 channels of 8 bits": GridConfig(),
    "+ scales and biases": GridConfig(adapters=True),
    "+ output layers": GridConfig(adapters=True, adapter_output=True),
    "8 channels of 4 bits": GridConfig(latent_channels=8, latent_bits=4),
    "8 of 4 bits, adapters (best)": GridConfig(latent_channels=8, latent_bits=4, adapters=True, adapter_output=True),
    "8 channels of 8 bits": GridConfig(latent_channels=8),
}


def packs_of(scene: Scene, decoders: int) -> dict[str, Pack]:
    """A pack of each codec for the scene's textures, which take decoders in turn."""
    textures = source_textures(scene, TEXTURE_SIZE)
    grouping = Grouping("in turn", tuple(index % decoders for index in range(len(textures))))
    training = TrainingConfig(steps=1, texels_per_texture=1, device="cpu")
    return {name: encode_textures(textures, grouping, codec, training) for name, codec in CODECS.items()}


def measure(
    context: GraphicsContext,
    scene: Scene,
    packs: Mapping[str, Pack],
    camera: Camera,
    size: tuple[int, int],
    frames: int,
) -> list[dict[str, Any]]:
    """A row of medians for each codec."""
    renderer = Renderer(context, scene)
    renderer.set_packs(dict(packs))
    times: dict[str, list[float]] = {name: [] for name in packs}
    for frame in range(-1, frames):
        for number, name in enumerate(packs):
            moved = nudged(camera, frame * len(packs) + number)
            timings = renderer.render(ViewState(moved, size, Slot(name))).timings_ms
            if frame >= 0:
                times[name].append(timings["decode_deferred"])
    renderer.release()
    first = median(times[next(iter(packs))])
    return [
        {
            "codec": name,
            "multiply-adds": pack.config.multiply_adds,
            "decode ms": median(times[name]),
            "min ms": min(times[name]),
            "to the first": median(times[name]) / first,
        }
        for name, pack in packs.items()
    ]


def main() -> int:
    """Run from the command line."""
    parser = arguments(__doc__.splitlines()[0])
    parser.add_argument("--decoders", type=int, default=10)
    given = parser.parse_args()
    try:
        scene = load_scene(given.scene)
        context = create_headless_context()
        camera = chosen_cameras(scene, given.cameras, given.camera)[0]
        rows = measure(context, scene, packs_of(scene, given.decoders), camera, given.size, given.frames)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    facts = {
        "scene": scene.name,
        "camera": camera.name,
        "size": "{}x{}".format(*given.size),
        "frames": given.frames,
        "decoders": given.decoders,
        "renderer": context.info.renderer,
    }
    report("Cost of the codec's parts", rows, facts, given.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
