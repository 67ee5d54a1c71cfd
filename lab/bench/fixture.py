"""Benchmark fixture: a visibility buffer in which pixels see textures in a given pattern, decoded from any pack by any path."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lab.bench.tiles import Tiling
from ntc.codec.model import Pack
from ntc.pack.match import PackMatch
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, ShaderLibrary
from viewer.gl.timer import PassTimer
from viewer.locations import shaders_folder
from viewer.render.gpu_packs import GpuPack, OpenPack, binned_pass, deferred_pass
from viewer.render.pass_scheduler import PassScheduler
from viewer.render.passes.decode import DecodePass
from viewer.render.render_context import RenderContext
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.layout import (
    GROUP_SIDE,
    MATERIAL_SHIFT,
    scene_includes,
)
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.render.resources.visibility_buffer import SurfaceContent, VisibilityInputs, VisibilityTarget
from viewer.scene.model import Geometry, Instances, LoadReport, Material, Scene
from viewer.state.view_state import Precision

FixturePath = Literal["deferred", "deferred, shared", "binned"]
"""`deferred` with a decoder index for each pixel, `deferred, shared` for packs of one decoder, or `binned`."""
TEXTURE_SIDE = 256
"""Side in texels of the textures of a fixture."""
PICTURE_BYTES = 16 + 4 + 16
"""GPU memory in bytes per pixel: visibility words, depth, albedo."""
BINNED_BYTES = 4
"""Further GPU memory in bytes per pixel for each pass of path `binned`."""


def white_scene() -> Scene:
    """Return a scene without geometry and with one material: white, with a repeating trilinear sampler."""
    none = np.zeros((0, 3), np.float32)
    return Scene(
        name="benchmark",
        path=None,
        geometry=Geometry(none, none[:, :2], None, np.zeros(0, np.uint32)),
        primitives=(),
        instances=Instances(np.zeros(0, np.int32), np.zeros((0, 4, 4), np.float32), np.zeros(0, np.int32)),
        materials=(Material("white", -1, (1.0, 1.0, 1.0, 1.0)),),
        textures=(),
        cameras=(),
        node_names=(),
        bounds=np.zeros((2, 3), np.float32),
        report=LoadReport(),
    )


def white_material(graphics: GraphicsContext) -> SceneBuffers:
    """Return the material of `white_scene` on the GPU. Its base colour is the texture in the visibility buffer."""
    buffers = SceneBuffers(graphics, white_scene())
    buffers.materials["planes"]["texture_id"], buffers.materials["planes"]["components"] = 0, 15
    buffers.upload_materials()
    return buffers


def _words(texture: NDArray[np.int32]) -> NDArray[np.uint32]:
    """Return [H, W, 4] visibility words of pixels that show the textures `texture` [H, W], one texel per pixel."""
    y, x = np.indices(texture.shape, np.int32)
    words = np.zeros((*texture.shape, 4), np.uint32)
    words[..., 0] = (texture + 1) | (1 << MATERIAL_SHIFT)
    words[..., 1] = ((x + 0.5) / TEXTURE_SIDE).astype(np.float32).view(np.uint32)
    words[..., 2] = ((y + 0.5) / TEXTURE_SIDE).astype(np.float32).view(np.uint32)
    words[..., 3] = np.float32(1.0 / TEXTURE_SIDE).view(np.uint32)
    return words


def interleaved_words(size: tuple[int, int], textures: int) -> NDArray[np.uint32]:
    """Return [H, W, 4] visibility words whose pixels show the textures in turn, one texel per pixel, the same in every block."""
    y, x = np.indices((size[1], size[0]), np.int32)
    return _words(((y % GROUP_SIDE) * GROUP_SIDE + x % GROUP_SIDE) % textures)


class PackLoader:
    """Loader of packs onto the GPU without a scene that shows their textures. Packs of one codec share their programs."""

    def __init__(self, graphics: GraphicsContext) -> None:
        library = ShaderLibrary(shaders_folder(), scene_includes())
        self.programs = ProgramFactory(graphics.gl, library)
        self.materials = white_material(graphics)
        scheduler = PassScheduler(PassTimer(graphics))
        self._context = RenderContext(graphics, self.programs, white_scene(), self.materials, scheduler)

    def load(self, pack: Pack, precision: Precision, emulate_half: bool = False) -> GpuPack:
        """Return `pack` on the GPU with all its latents; texture id i is its i-th texture. The caller releases it."""
        context = replace(self._context, emulate_half=emulate_half)
        match = PackMatch(tuple(range(len(pack.textures))), (), ())
        return GpuPack(context, OpenPack(pack, match, 1, {}), precision)

    def release(self) -> None:
        """Free all programs and the material."""
        self.programs.release()
        self.materials.release()


MAKE_PASS: Mapping[FixturePath, Callable[[GpuPack], DecodePass]] = {
    "deferred": partial(deferred_pass, may_share=False),
    "deferred, shared": deferred_pass,
    "binned": binned_pass,
}


class DecodeFixture:
    """Fixture of decode passes: a visibility buffer, and the target of decoding.

    For a picture of several tiles there are buffers for one tile, which is decoded once for each tile.
    """

    def __init__(self, context: GraphicsContext, tiles: Tiling, words: NDArray[np.uint32]) -> None:
        """Make the fixture with `words` [H, W, 4] uint32, the visibility words of one tile, row 0 at the bottom."""
        self._count = tiles.count
        self.visibility = VisibilityTarget(context, tiles.tile, SurfaceContent(False, False))
        self.visibility.write(words)
        self.target = ColorTarget(context, tiles.tile)
        self._passes: list[DecodePass] = []

    def inputs(self, materials: SceneBuffers, textures: int) -> VisibilityInputs:
        """Return the inputs of decode passes for a pack of `textures` textures."""
        return VisibilityInputs(self.visibility, materials, textures=tuple(range(textures)))

    def decoding(self, pack: GpuPack, path: FixturePath) -> Callable[[], None]:
        """Return a function that decodes the whole picture. Its pass is freed with the fixture."""
        decode = MAKE_PASS[path](pack)
        self._passes.append(decode)
        inputs = self.inputs(pack.context.scene_buffers, len(pack.pack.textures))

        def run() -> None:
            for _ in range(self._count):
                decode.run(inputs, self.target)

        return run

    def release(self) -> None:
        """Free all buffers."""
        self.visibility.release()
        self.target.release()
        for made in self._passes:
            made.release()
