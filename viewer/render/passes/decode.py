"""Decode paths `forward`, `deferred` and `binned`, which decode every visible pixel, and their stochastic filter."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from weakref import WeakKeyDictionary

import moderngl
import numpy as np

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.pass_scheduler import Progress, Step, ToCome
from viewer.render.passes.accumulate import SAMPLES, AccumulatePass
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.layout import BIN_GROUP, BIN_RECORD, GROUP_SIDE, BinBinding, ImageUnit
from viewer.render.resources.pack_buffers import DecoderRanges, PackBuffers
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.render.resources.visibility_buffer import PlaneReading, VisibilityInputs
from viewer.state.view_state import TexelFilter

BIN_PIXEL_BYTES = 4
"""Size of a pixel in the list that path `binned` sorts."""


class DecodePass(ABC):
    """Pass that decodes one pack. Inputs: visibility buffer, materials, the pack's buffers. Output: a plane of the whole picture."""

    name: str
    """Name of the decode path after `decode_`."""

    def __init__(
        self, context: GraphicsContext, buffers: PackBuffers, reading: PlaneReading, texel_filter: TexelFilter
    ) -> None:
        """Take the pack in `buffers`, and the defines of the shaders that decode it with a filter."""
        self._gl, self._buffers = context.gl, buffers
        self._defines = {**reading.defines(), **buffers.defines, "FILTER_STOCHASTIC": int(texel_filter == "stochastic")}

    def _bind(self, program: moderngl.Program | moderngl.ComputeShader, inputs: VisibilityInputs) -> None:
        """Bind the view and the pack for `program`, which decodes."""
        inputs.bind()
        self._buffers.bind()
        set_uniforms(program, {"network_blocks": self._buffers.network_blocks, "sample_number": inputs.sample})

    @abstractmethod
    def run(self, inputs: VisibilityInputs, target: ColorTarget) -> None:
        """Decode every visible pixel once."""

    def own_buffers(self) -> Sequence[moderngl.Buffer]:
        """Return the GPU buffers that belong to this pass alone."""
        return ()

    @property
    def bytes_on_gpu(self) -> int:
        """Number of bytes of the pass's own buffers."""
        return sum(buffer.size for buffer in self.own_buffers())

    def release(self) -> None:
        """Free the pass's own buffers."""
        for buffer in self.own_buffers():
            buffer.release()


class DecodeForwardPass(DecodePass):
    """Pass of path `forward`: draws the draw list of the visibility buffer again, with its matrix."""

    name = "decode_forward"

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        buffers: PackBuffers,
        scene_buffers: SceneBuffers,
        reading: PlaneReading,
        texel_filter: TexelFilter = "exact",
    ) -> None:
        super().__init__(context, buffers, reading, texel_filter)
        self._scene_buffers = scene_buffers
        self._program = programs.program("common/scene.vert", "passes/decode_forward/decode.frag", self._defines)

    def run(self, inputs: VisibilityInputs, target: ColorTarget) -> None:
        """Decode in the fragments that lie at the visible depth."""
        gl = self._gl
        framebuffer = target.framebuffer_with_depth(inputs.visibility.depth)
        try:
            framebuffer.use()
            framebuffer.color_mask = (True, True, True, True)
            framebuffer.depth_mask = False
            target.framebuffer.clear()
            framebuffer.use()
            gl.enable_only(moderngl.DEPTH_TEST)
            gl.depth_func = "=="
            self._bind(self._program, inputs)
            set_uniforms(self._program, {"view_projection": inputs.matrix.T.astype("<f4").tobytes()})
            self._scene_buffers.draw(self._program, self._program)
        finally:
            gl.depth_func = "<"


class DecodeDeferredPass(DecodePass):
    """Pass of path `deferred`. Where all textures share one decoder (`shared_decoder`), an invocation decodes several pixels.

    `ranges` may be None where they have not.
    """

    name = "decode_deferred"

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        buffers: PackBuffers,
        ranges: DecoderRanges | None,
        reading: PlaneReading,
        shared_decoder: int | None,
        texel_filter: TexelFilter = "exact",
    ) -> None:
        super().__init__(context, buffers, reading, texel_filter)
        self._shared_decoder = shared_decoder
        # Where codes are decoded together, one decoder for all makes no difference.
        self._ranges = ranges if shared_decoder is not None and not buffers.decodes_together else None
        name, defines = "decode", self._defines
        if self._ranges is not None:
            name, defines = "decode_shared", {**defines, **self._ranges.defines}
        self._program = programs.compute(f"passes/decode_deferred/{name}.comp", defines)

    def run(self, inputs: VisibilityInputs, target: ColorTarget) -> None:
        """Decode the whole picture."""
        self._bind(self._program, inputs)
        target.texture.bind_to_image(int(ImageUnit.TARGET), read=False, write=True)
        rows = GROUP_SIDE
        if self._ranges is not None and self._shared_decoder is not None:
            self._ranges.bind(self._shared_decoder)
            rows = GROUP_SIDE * self._ranges.pixels
        self._program.run(-(-target.size[0] // GROUP_SIDE), -(-target.size[1] // rows))
        self._gl.memory_barrier()


class DecodeBinnedPass(DecodePass):
    """Pass of path `binned`: count, scan and scatter fill the bins; each decoder that may be visible has an indirect dispatch."""

    name = "decode_binned"

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        buffers: PackBuffers,
        ranges: DecoderRanges,
        reading: PlaneReading,
        texel_filter: TexelFilter = "exact",
    ) -> None:
        super().__init__(context, buffers, reading, texel_filter)
        self._memory, self._ranges, self._bin_count = context.memory, ranges, len(buffers.pack.decoders)
        sorting = {**reading.defines(), "SHARED_SUMS": int(context.features.shared_sums)}
        self._count = programs.compute("passes/decode_binned/count.comp", sorting)
        self._scan = programs.compute("passes/decode_binned/scan.comp")
        self._scatter = programs.compute("passes/decode_binned/scatter.comp", sorting)
        self._decode = programs.compute("passes/decode_binned/decode.comp", {**self._defines, **ranges.defines})
        what = "path binned"
        with self._memory.transaction():
            self._bins = self._memory.buffer(what, np.zeros(max(1, self._bin_count), BIN_RECORD).tobytes())
            self._pixels = self._memory.buffer(what, reserve=BIN_PIXEL_BYTES)

    def run(self, inputs: VisibilityInputs, target: ColorTarget) -> None:
        """Decode the whole picture."""
        needed = target.size[0] * target.size[1] * BIN_PIXEL_BYTES
        self._pixels = self._memory.grown("pixels of path binned", self._pixels, needed, storage=True)
        self._bind(self._decode, inputs)
        target.texture.bind_to_image(int(ImageUnit.TARGET), read=False, write=True)
        self._bins.bind_to_storage_buffer(int(BinBinding.BINS))
        self._pixels.bind_to_storage_buffer(int(BinBinding.BIN_PIXELS))
        blocks = tuple(-(-side // GROUP_SIDE) for side in target.size)
        self._count.run(*blocks)
        self._gl.memory_barrier()
        set_uniforms(self._scan, {"bin_count": self._bin_count, "pixels_per_group": BIN_GROUP * self._ranges.pixels})
        self._scan.run(1)
        self._gl.memory_barrier()
        self._scatter.run(*blocks)
        self._gl.memory_barrier()
        decoders = np.unique(self._buffers.decoder_of_texture[list(inputs.textures)])
        for decoder in decoders[decoders >= 0].tolist():
            self._ranges.bind(decoder)
            set_uniforms(self._decode, {"bin": decoder})
            self._decode.run_indirect(self._bins, decoder * BIN_RECORD.itemsize)
        self._gl.memory_barrier()

    def own_buffers(self) -> Sequence[moderngl.Buffer]:
        """Return the bins and the list of pixels."""
        return self._bins, self._pixels


class DecodeSampledPass:
    """Pass of a path with the stochastic filter: draws the mean of up to SAMPLES samples of one texel a pixel."""

    def __init__(self, decode: DecodePass, accumulate: AccumulatePass) -> None:
        """Take `decode`, a pass with the stochastic filter; both passes belong to this one."""
        self.name = decode.name
        self._decode, self._accumulate = decode, accumulate
        self._samples: WeakKeyDictionary[ColorTarget, int] = WeakKeyDictionary()

    @property
    def bytes_on_gpu(self) -> int:
        """Number of bytes of the pass's buffers and the last sample."""
        return self._decode.bytes_on_gpu + self._accumulate.bytes_on_gpu

    def advance(self, inputs: VisibilityInputs, target: ColorTarget, step: Step) -> Progress:
        """Draw the next sample, or where the picture is to be whole all that are missing.

        BLEND surfaces are averaged elsewhere: for a further sample of theirs one sample is drawn.
        """
        if inputs.blend_sample:
            self._decode.run(inputs.of_sample(inputs.blend_sample), target)
            return Progress()
        before = self._samples.get(target, 0) if step.is_same_view and not step.is_stale else 0
        for number in range(before, SAMPLES if step.whole else before + 1):
            into = target if number == 0 else self._accumulate.sample(target.size)
            self._decode.run(inputs.of_sample(number), into)
            if number > 0:
                self._accumulate.run(number, target)
            self._samples[target] = number + 1
        left = SAMPLES - self._samples[target]
        return Progress(to_come=(ToCome("samples", left, SAMPLES),) if left else ())

    def release(self) -> None:
        """Free the pass and the last sample."""
        self._decode.release()
        self._accumulate.release()
