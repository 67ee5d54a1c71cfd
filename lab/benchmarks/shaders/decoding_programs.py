"""Decoding programs of a GPU by path, codec and precision."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from lab.bench.random_pack import random_block_pack, random_pack
from lab.benchmarks.shaders.recording import HALF_EXTENSION, AssembledProgram, ProgramRecorder
from ntc.codec.block.config import BlockConfig
from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.training.config import recipe_codec
from ntc.codec.model import Pack
from viewer.gl.context import GraphicsContext
from viewer.locations import builtin_scene_path
from viewer.render.renderer import Renderer
from viewer.render.resources.decoding_shaders import LEVELS
from viewer.scene.load import load_scene
from viewer.state.view_state import EXACT_PATHS, Precision, Slot, ViewState

CODECS: Final[dict[str, GridConfig | BlockConfig]] = {
    "paper": recipe_codec("paper", 3, None),
    "adapters": GridConfig(adapters=True),
    "grid of best": recipe_codec("best", 3, None),
    "block": BlockConfig(),
}
"""By a short name: codec `grid` of both recipes, with adapters that leave the output layer shared, and codec `block`."""
SIZE: Final = (16, 16)


@dataclass(frozen=True)
class DecodingProgram:
    """Decoding program with its path, codec and precision."""

    path: str
    """`deferred, shared`: with one decoder for all."""
    codec: str
    """A key of CODECS."""
    precision: Precision
    program: AssembledProgram

    @property
    def config(self) -> GridConfig | BlockConfig:
        """The codec's settings."""
        return CODECS[self.codec]


def gpu_of(context: GraphicsContext) -> GraphicsContext:
    """`context` as if it drew on a GPU with half arithmetic, whatever draws."""
    features = replace(
        context.features, weights_in_image=False, half_arithmetic=HALF_EXTENSION, uniform_block_bytes=65536
    )
    return replace(context, features=features, info=replace(context.info, renderer="AMD Radeon", vendor="AMD"))


def _pack(config: GridConfig | BlockConfig, groups: tuple[int, ...], hashes: list[str]) -> Pack:
    sizes = [(32, 32)] * len(hashes)
    if isinstance(config, GridConfig):
        return random_pack(sizes, groups, config, hashes)
    return random_block_pack(sizes, groups, config, hashes)


def _slots(name: str) -> Iterator[tuple[str, Slot]]:
    """Each path, and each precision in which the codec `name` is decoded by another program."""
    precisions: tuple[Precision, ...] = tuple(LEVELS) if isinstance(CODECS[name], GridConfig) else ("fp32",)
    for path in EXACT_PATHS:
        for precision in precisions:
            yield path, Slot(name, path, precision)
            if path == "deferred":
                yield f"{path}, shared", Slot(f"{name}, shared", path, precision)


def decoding_programs(context: GraphicsContext, codecs: tuple[str, ...] = tuple(CODECS)) -> tuple[DecodingProgram, ...]:
    """Return the decoding programs of a GPU for `codecs`, with exact filters. `context` takes the uploads; nothing is drawn."""
    scene = load_scene(builtin_scene_path())
    hashes = [texture.pixel_hash for texture in scene.textures]
    several = tuple(number % 3 for number in range(len(hashes)))
    packs: dict[str, Pack] = {}
    for name in codecs:
        packs[name] = _pack(CODECS[name], several, hashes)
        packs[f"{name}, shared"] = _pack(CODECS[name], (0,) * len(hashes), hashes)
    recorder = ProgramRecorder()
    programs: list[DecodingProgram] = []
    with recorder.recording():
        renderer = Renderer(gpu_of(context), scene)
        renderer.set_packs(packs)
        for name in codecs:
            for path, slot in _slots(name):
                before = len(recorder.programs)
                renderer.render(ViewState(scene.cameras[0], SIZE, slot))
                made = [
                    program
                    for program in list(recorder.programs.values())[before:]
                    if program.files[-1].startswith("passes/decode_")
                ]
                decoding = [program for program in made if program.files[-1].split("/")[-1].startswith("decode")]
                programs += [DecodingProgram(path, name, slot.precision, program) for program in decoding]
        renderer.release()
    return tuple(programs)
