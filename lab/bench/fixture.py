"""A picture without a scene: pixels that see textures in a given pattern, and any pack and path to decode them."""

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lab.bench.tiles import Tiling
from ntc.codec.config import CodecConfig
from ntc.pack.model import Pack
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, ShaderLibrary
from viewer.locations import shaders_folder
from viewer.render.passes.decode_binned import DecodeBinnedPass
from viewer.render.passes.decode_deferred import DecodeDeferredPass
from viewer.render.resources.albedo_target import AlbedoTarget
from viewer.render.resources.decoder_ranges import DecoderRanges
from viewer.render.resources.layout import (
    GROUP_SIDE,
    MATERIAL_RECORD,
    MATERIAL_SHIFT,
    StorageBinding,
    scene_layout_glsl,
)
from viewer.render.resources.pack_buffers import PackBuffers, codec_programs
from viewer.render.resources.visibility_buffer import SurfaceContent, VisibilityInputs, VisibilityTarget
from viewer.state.view_state import Precision

FixturePath = Literal["deferred", "deferred, shared", "binned"]
"""`deferred` with a decoder index for each pixel, `deferred, shared` for packs of one decoder, or `binned`."""
TEXTURE_SIDE = 256
"""Texels a side of the textures that a fixture's pixels see."""
PICTURE_BYTES = 16 + 4 + 16
"""Of a pixel: visibility words, depth, albedo."""
BINNED_BYTES = 4
"""Of a pixel besides, for each pack and precision that is decoded by `binned`."""


class OneMaterial:
    """White, repeated, trilinear."""

    def __init__(self, context: GraphicsContext) -> None:
        record = np.zeros(1, MATERIAL_RECORD)
        record["factor"] = 1.0
        self._buffer = context.memory.buffer("materials", record.tobytes())

    def bind_materials(self) -> None:
        """Bind the materials to their storage binding."""
        self._buffer.bind_to_storage_buffer(int(StorageBinding.MATERIALS))

    def release(self) -> None:
        """Free the buffer."""
        self._buffer.release()


def _words(texture: NDArray[np.int32]) -> NDArray[np.uint32]:
    """[H, W, 4] visibility words of pixels that see these textures [H, W], one texel a pixel."""
    y, x = np.indices(texture.shape, np.int32)
    words = np.zeros((*texture.shape, 4), np.uint32)
    words[..., 0] = (texture + 1) | (1 << MATERIAL_SHIFT)
    words[..., 1] = ((x + 0.5) / TEXTURE_SIDE).astype(np.float32).view(np.uint32)
    words[..., 2] = ((y + 0.5) / TEXTURE_SIDE).astype(np.float32).view(np.uint32)
    words[..., 3] = np.float32(1.0 / TEXTURE_SIDE).view(np.uint32)
    return words


def _places(size: tuple[int, int]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """([H, W] number of each pixel's block, [H, W] its place in the block)."""
    y, x = np.indices((size[1], size[0]), np.int32)
    block = (y // GROUP_SIDE) * -(-size[0] // GROUP_SIDE) + x // GROUP_SIDE
    return block, (y % GROUP_SIDE) * GROUP_SIDE + x % GROUP_SIDE


def interleaved_words(size: tuple[int, int], textures: int) -> NDArray[np.uint32]:
    """[H, W, 4] visibility words: pixels take the textures in turn, the same in every block, one texel a pixel."""
    return _words(_places(size)[1] % textures)


def scattered_words(size: tuple[int, int], textures: int) -> NDArray[np.uint32]:
    """[H, W, 4] visibility words: pixels take all textures in turn, block after block: 64 others in the next one."""
    block, place = _places(size)
    return _words((block * GROUP_SIDE * GROUP_SIDE + place) % textures)


def block_words(size: tuple[int, int], textures: int) -> NDArray[np.uint32]:
    """[H, W, 4] visibility words: blocks take the textures in turn; all pixels of a block see the same one."""
    return _words(_places(size)[0] % textures)


class DecodePrograms:
    """Programs of the decoding passes, compiled once for each codec."""

    def __init__(self, context: GraphicsContext) -> None:
        library = ShaderLibrary(shaders_folder(), {"generated/layout.glsl": scene_layout_glsl()})
        self._factory = ProgramFactory(context.gl, library)
        self._of_codec: dict[CodecConfig, ProgramFactory] = {}

    def of(self, pack: Pack) -> ProgramFactory:
        """Programs for the codec of `pack`."""
        if pack.config not in self._of_codec:
            self._of_codec[pack.config] = codec_programs(self._factory, pack)
        return self._of_codec[pack.config]

    def release(self) -> None:
        """Free all programs."""
        for programs in (self._factory, *self._of_codec.values()):
            programs.release()


class LoadedPack:
    """A pack on the GPU in one precision, for every path of a fixture."""

    def __init__(
        self,
        context: GraphicsContext,
        programs: DecodePrograms,
        pack: Pack,
        precision: Precision,
        emulate_half: bool = False,
    ) -> None:
        self._context, self._programs, self._pack = context, programs, pack
        self._buffers = PackBuffers(context, pack, range(len(pack.textures)), precision, emulate_half)
        self._ranges = DecoderRanges(context, pack, precision)
        self._binned: DecodeBinnedPass | None = None

    def decode(self, path: FixturePath, fixture: "DecodeFixture") -> Callable[[], None]:
        """A call that decodes the whole picture of `fixture`."""
        programs, inputs = self._programs.of(self._pack), fixture.inputs(len(self._pack.textures))
        if path == "binned":
            if self._binned is None:
                self._binned = DecodeBinnedPass(self._context, programs, self._buffers, self._ranges, False)
            binned = self._binned
            return lambda: fixture.each_tile(lambda: binned.run(inputs, fixture.target))
        shared = 0 if path == "deferred, shared" else None
        deferred = DecodeDeferredPass(self._context, programs, self._buffers, self._ranges, False, shared)
        return lambda: fixture.each_tile(lambda: deferred.run(inputs, fixture.target))

    def release(self) -> None:
        """Free all buffers."""
        self._buffers.release()
        self._ranges.release()
        if self._binned is not None:
            self._binned.release()


class DecodeFixture:
    """What is seen, and where it is decoded to. A picture of several tiles has buffers for one and runs them in turn."""

    def __init__(self, context: GraphicsContext, tiles: Tiling, words: NDArray[np.uint32]) -> None:
        self._count = tiles.count
        self.material = OneMaterial(context)
        self.visibility = VisibilityTarget(context, tiles.tile, SurfaceContent(False, False))
        self.visibility.write(words)
        self.target = AlbedoTarget(context, tiles.tile)

    def inputs(self, textures: int) -> VisibilityInputs:
        """What decode passes read, for a pack of so many textures."""
        return VisibilityInputs(self.visibility, self.material, textures=tuple(range(textures)))

    def each_tile(self, run: Callable[[], None]) -> None:
        """Call `run` once for each tile."""
        for _ in range(self._count):
            run()

    def release(self) -> None:
        """Free all buffers."""
        self.material.release()
        self.visibility.release()
        self.target.release()
