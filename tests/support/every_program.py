"""Every program that the renderer can assemble. None is compiled: for compilers other than the driver's, and for counts."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final, get_args

import numpy as np

from lab.bench.random_pack import random_block_pack, random_pack
from lab.benchmarks.shaders.recording import HALF_EXTENSION, AssembledProgram, ProgramRecorder
from ntc.codec.block.config import BlockConfig
from ntc.codec.grid.model import GridConfig
from ntc.codec.maps import MAP_CHANNELS, MAPS, MapName
from ntc.codec.model import Pack
from tests.support.picture_scenes import WHITE, Part, as_set, cube, placed, scene_of, texture
from viewer.gl.context import ContextInformation, GraphicsContext
from viewer.gl.features import Features
from viewer.render.passes.composite import COMPARISONS
from viewer.render.passes.cull import cluster_programs
from viewer.render.passes.decode_texels import GlTexelDecoder
from viewer.render.passes.pose_vertices import pose_program
from viewer.render.renderer import Renderer
from viewer.render.resources.decoding_shaders import LEVELS
from viewer.render.resources.divergence_maps import Stage
from viewer.render.resources.pack_buffers import scene_programs
from viewer.scene.model import Camera, Light, Material, PlaneTexture, Scene, SceneTexture, SurfaceFactors
from viewer.state.view_state import (
    BLOCKS,
    FILTERED_PATHS,
    DecodePath,
    Difference,
    Lighting,
    MaterialView,
    Overlay,
    Precision,
    Slot,
    TexelFilter,
    ToneMap,
    ViewState,
    Zoom,
)

GPU: Final = ContextInformation("a GPU", "its vendor", "4.6")
"""What takes the variants of a GPU (viewer/render/resources/decoding_shaders.py)."""
SIZE: Final = (16, 16)
CAMERA: Final = Camera("front", (0.5, 0.6, 4.0), (0.0, 0.0, 0.0))
SOME: Final = ("grid-adapters", "grid-sets", "block-4x4", "block-sets-one-decoder")
"""Packs of both codecs, of single maps and of sets, each with a decoder per texture and with one for all."""
PLAIN: Final = "plain"
"""The scene with little."""
SIDE: Final = 16
"""Texels along a side of each texture."""
TEXTURES: Final = 3


def _grid(config: GridConfig, groups: tuple[int, ...] = (0, 1, 0)) -> Pack:
    made = random_pack([(SIDE, SIDE)] * TEXTURES, groups, config, _hashes(config.maps))
    return replace(made, textures=tuple(replace(texture, maps=config.maps) for texture in made.textures))


def _blocks(config: BlockConfig, groups: tuple[int, ...] = (0, 1, 0)) -> Pack:
    return random_block_pack([(SIDE, SIDE)] * TEXTURES, groups, config, _hashes(config.maps))


def _hashes(maps: tuple[MapName, ...]) -> list[str]:
    """Return the hashes of a pack of `maps` that match the textures of both scenes."""
    return [texture.set_hash or texture.pixel_hash for texture in (_sets() if len(maps) > 1 else _textures())]


def packs() -> dict[str, Pack]:
    """Return packs of every kind of codec, each with a decoder per texture and with one for all."""
    adapted = GridConfig(hidden_width=64, adapters=True)
    sets = BlockConfig(
        block_words=(3, 8, 32), mean_words=8.0, modes=128, coefficients=88, output_channels=11, maps=MAPS
    )
    return {
        "grid": _grid(GridConfig()),
        "grid-one-decoder": _grid(GridConfig(), (0, 0, 0)),
        "grid-one-mip": _grid(GridConfig(latent_channels=8, latent_bits=4, levels=1, hidden_width=16)),
        "grid-adapters": _grid(adapted, (0, 0, 0)),
        "grid-adapter-output": _grid(replace(adapted, adapter_output=True), (0, 0, 0)),
        "grid-sets": _grid(GridConfig(output_channels=11, maps=MAPS)),
        "block": _blocks(BlockConfig()),
        "block-one-decoder": _blocks(BlockConfig(), (0, 0, 0)),
        "block-4x4": _blocks(BlockConfig(block_side=4, block_words=(2,), coefficients=24)),
        "block-sets": _blocks(sets),
        "block-sets-one-decoder": _blocks(sets, (0, 0, 0)),
    }


def _textures() -> list[SceneTexture]:
    return [texture(SIDE, SIDE, number) for number in range(TEXTURES)]


def _sets() -> list[SceneTexture]:
    """The same images as material sets."""
    further: dict[MapName, Any] = {
        name: np.full((SIDE, SIDE, MAP_CHANNELS[name]), 128, np.uint8) for name in MAPS if name != "base"
    }
    return [as_set(own, MAPS, further, f"set {number}") for number, own in enumerate(_textures())]


def scenes() -> dict[str, Scene]:
    """Return a plain scene, and one with every feature that changes programs."""
    places = [placed(x=number - 1.0, scale=(0.5, 0.5, 0.5)) for number in range(TEXTURES)]
    parts = [cube(number, place) for number, place in enumerate(places)]
    plain = scene_of(parts, [Material(f"m{number}", number, WHITE) for number in range(TEXTURES)], _textures())
    factors = SurfaceFactors(clearcoat=0.5, emissive=(1.0, 1.0, 1.0), ior=1.8)
    materials = [
        Material(
            f"m{number}",
            number,
            (1.0, 1.0, 1.0, 0.7),
            alpha_mode=("opaque", "mask", "blend")[number],
            surface=PlaneTexture(number, maps=MAPS[1:4], second_uvs=True),
            emission=PlaneTexture(number, maps=MAPS[4:]),
            factors=factors,
            unlit=number == 1,
        )
        for number in range(TEXTURES)
    ]
    colored: list[Part] = [replace(part, colors=np.ones((len(part.positions), 4), np.float32)) for part in parts]
    rich = scene_of(colored, materials, _sets())
    vertices = len(rich.geometry.positions)
    geometry = replace(
        rich.geometry,
        normals=np.tile(np.array([0, 0, 1], np.float32), (vertices, 1)),
        tangents=np.tile(np.array([1, 0, 0, 1], np.float32), (vertices, 1)),
        second_uvs=rich.geometry.uvs,
    )
    lights = (Light("point", (1.0, 1.0, 1.0), (0.0, 2.0, 0.0)),)
    return {PLAIN: plain, "rich": replace(rich, geometry=geometry, lights=lights)}


def _feature_sets(features: Features) -> Iterator[tuple[Features, bool]]:
    """Features, and whether halves are emulated: weights in an image, in buffers, and in buffers with none that is uniform."""
    halves = replace(features, half_arithmetic=HALF_EXTENSION, anisotropy=16)
    for emulated in (False, True):
        yield replace(halves, weights_in_image=True, shared_sums=False), emulated
        yield replace(halves, weights_in_image=False, shared_sums=True), emulated
        yield replace(halves, weights_in_image=False, uniform_block_bytes=0), emulated


def _precisions(name: str) -> tuple[Precision, ...]:
    """Return the precisions and variants in which different programs decode the pack `name`."""
    return tuple(LEVELS) if name.startswith("grid") else ("fp32",)


def _decoding_views(name: str) -> Iterator[ViewState]:
    """Every way to decode the pack `name`."""
    plain = ViewState(CAMERA, SIZE, material_view="lit")
    filters: dict[DecodePath, tuple[TexelFilter, ...]] = {"cached": ("exact",), "on-load": ("exact",)}
    for precision in _precisions(name):
        for path in get_args(DecodePath):
            for texel_filter in filters.get(path, get_args(TexelFilter)):
                slot = Slot(name, path, precision, texel_filter)
                yield replace(plain, slot_a=slot)
                if path in FILTERED_PATHS:
                    yield replace(plain, slot_a=slot, anisotropy=8)


def _other_views(name: str) -> Iterator[ViewState]:
    """Every way to show what was decoded, and the original images."""
    decoded = Slot(name)
    both = ViewState(CAMERA, SIZE, Slot(), decoded)
    overlays = [Overlay(), Overlay("error-texture"), *(Overlay("divergence", block=block) for block in BLOCKS)]
    for zoom in (Zoom(), Zoom(2.0)):
        for overlay in overlays:
            for compare, kind in COMPARISONS:
                view = replace(both, compare=compare, difference=Difference(kind), overlay=overlay, zoom=zoom)
                yield view
                yield replace(view, highlight=(0,))
    for shown in get_args(MaterialView):
        for anisotropy in (1, 8):
            for slot in (Slot(), decoded, replace(decoded, maps="normal"), replace(decoded, maps="emissive")):
                yield replace(both, slot_a=slot, material_view=shown, anisotropy=anisotropy)
    for tone_map in get_args(ToneMap):
        for strength in (0.0, 1.0):
            lighting = Lighting(tone_map=tone_map, sun_strength=strength)
            yield replace(both, material_view="lit", lighting=lighting)


def _assemble_drawing(
    context: GraphicsContext, recorder: ProgramRecorder, scene: Scene, opened: dict[str, Pack]
) -> None:
    """The programs that decode packs in GLSL 4.10, where nothing computes."""
    drawing = replace(context.features, compute=False, weights_in_image=True, half_arithmetic=None, anisotropy=16)
    renderer = Renderer(replace(context, features=drawing), scene)
    renderer.set_packs(opened)
    for name in opened:
        recorder.codec = name
        for view in _decoding_views(name):
            if view.slot_a.path == "forward" and view.slot_a.precision in ("fp32", "fp16"):
                renderer.render(view)
    renderer.release()


def every_program(context: GraphicsContext, sparse: bool = False) -> tuple[AssembledProgram, ...]:
    """All distinct programs of every decode path, codec, precision (halves native and emulated), filter, view and overlay.

    `sparse`: with the first set of a driver's features all of them; with the other sets those of some packs in the scene with much.
    `context` holds what is uploaded meanwhile; whether its driver has half arithmetic does not matter.
    """
    recorder = ProgramRecorder()
    opened = packs()
    stages = get_args(Stage)
    with recorder.recording():
        for own, scene in scenes().items():
            sets = list(_feature_sets(context.features))
            for number, (features, emulated) in enumerate(sets[:1] if sparse and own == PLAIN else sets):
                graphics = replace(context, features=features, info=context.info if features.weights_in_image else GPU)
                renderer = Renderer(graphics, scene, stages[number % len(stages)], emulate_half=emulated)
                renderer.set_packs(opened)
                for name, pack in opened.items():
                    if sparse and number > 0 and name not in SOME:
                        continue
                    recorder.codec = name
                    for view in _decoding_views(name):
                        renderer.render(view)
                    for precision in _precisions(name):
                        decoder = GlTexelDecoder(graphics, pack, precision, emulated)
                        decoder.decode_texels(0, np.zeros((1, 2)), np.zeros(1))
                        decoder.release()
                recorder.codec = ""
                if number < len(stages):
                    for view in _other_views("block-sets"):
                        renderer.render(view)
                    renderer.render(ViewState(CAMERA, SIZE, Slot("grid", filter="stochastic")), whole=True)
                renderer.release()
            for padded in (False, True):
                cluster_programs(scene_programs(context), padded)
            pose_program(scene_programs(context))
            _assemble_drawing(context, recorder, scene, opened)
    return tuple(recorder.programs.values())
