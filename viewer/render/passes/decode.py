"""Decode paths `forward`, `deferred` and `binned`, which decode every visible pixel, and their stochastic filter."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from weakref import WeakKeyDictionary

import moderngl
import numpy as np

from ntc.codec.maps import PLANES, Plane
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.pass_scheduler import Pending, Progress, RenderPass, Step
from viewer.render.resources.accumulator import SAMPLES, Accumulator
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.layout import BIN_GROUP, BIN_RECORD, GROUP_SIDE, BinBinding, ImageUnit
from viewer.render.resources.pack_buffers import DecoderRanges, PackBuffers
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.render.resources.visibility_buffer import PlaneReading, VisibilityInputs
from viewer.state.view_state import TexelFilter

BIN_PIXEL_BYTES = 4
"""Size of a pixel in the list that path `binned` sorts."""


class DecodePass(RenderPass[VisibilityInputs, ColorTarget], ABC):
    """Pass that decodes one pack. Inputs: visibility buffer, materials, the pack's buffers. Output: one plane of the picture."""

    name: str
    """Name of the pass: `decode_` and the path."""

    def __init__(
        self, context: GraphicsContext, buffers: PackBuffers, reading: PlaneReading, texel_filter: TexelFilter
    ) -> None:
        """Take the pack in `buffers`, and the settings of its shaders."""
        self._gl, self._buffers = context.gl, buffers
        self._defines = {**reading.defines(), **buffers.defines, "FILTER_STOCHASTIC": int(texel_filter == "stochastic")}

    def _bind(self, program: moderngl.Program | moderngl.ComputeShader, inputs: VisibilityInputs) -> None:
        """Bind the view and the pack, and set the uniforms of the decoding `program`."""
        inputs.bind()
        self._buffers.bind()
        set_uniforms(program, {"network_blocks": self._buffers.network_blocks, "sample_number": inputs.sample})

    @abstractmethod
    def run(self, inputs: VisibilityInputs, target: ColorTarget) -> None:
        """Decode every visible pixel once."""

    def run_all(self, parts: Sequence[tuple[VisibilityInputs, ColorTarget]]) -> None:
        """Decode every visible pixel once for each of these planes of one view."""
        for inputs, target in parts:
            self.run(inputs, target)

    def advance_all(self, parts: Sequence[tuple[VisibilityInputs, ColorTarget, Step]]) -> list[Progress]:
        """Do `run_all`; all planes are complete afterwards."""
        self.run_all([(inputs, target) for inputs, target, _ in parts])
        return [Progress()] * len(parts)

    def private_buffers(self) -> Sequence[moderngl.Buffer]:
        """Return the GPU buffers that only this pass uses."""
        return ()

    @property
    def bytes_on_gpu(self) -> int:
        """Number of bytes of `private_buffers`."""
        return sum(buffer.size for buffer in self.private_buffers())

    def release(self) -> None:
        """Free `private_buffers`."""
        for buffer in self.private_buffers():
            buffer.release()


class DecodeForwardPass(DecodePass):
    """Pass of path `forward`. It draws the visibility buffer's draw list again, with the same matrix."""

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
        """Decode in those fragments whose depth equals the visibility buffer's."""
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
    """Pass of path `deferred`. If all textures share one decoder (`shared_decoder`), an invocation decodes several pixels.

    `ranges` may be None if they do not.
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
        # Work groups that decode codes together gain nothing from a single decoder.
        self._ranges = ranges if shared_decoder is not None and not buffers.decodes_together else None
        name, defines = "decode", self._defines
        if self._ranges is not None:
            name, defines = "decode_shared", {**defines, **self._ranges.defines}
        self._program = programs.compute(f"passes/decode_deferred/{name}.comp", defines)

    def run(self, inputs: VisibilityInputs, target: ColorTarget) -> None:
        """Decode the whole picture."""
        self._bind(self._program, inputs)
        target.texture.bind_to_image(int(ImageUnit.TARGET), read=False, write=True)
        if self._ranges is not None and self._shared_decoder is not None:
            self._ranges.bind(self._shared_decoder)
        rows = GROUP_SIDE * (1 if self._buffers.decodes_together else self._buffers.variant.pixels)
        self._program.run(-(-target.size[0] // GROUP_SIDE), -(-target.size[1] // rows))
        self._gl.memory_barrier()


class DecodePlanesPass(DecodePass):
    """Pass of path `deferred` for work groups that decode codes together. Planes that share codes decode them once."""

    name = "decode_deferred"

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        buffers: PackBuffers,
        reading: PlaneReading,
        plane_pass: Callable[[Plane], DecodePass],
        texel_filter: TexelFilter = "exact",
    ) -> None:
        """Take `reading` for several planes; `plane_pass` makes the pass of a single plane."""
        super().__init__(context, buffers, reading, texel_filter)
        self._programs, self._plane_pass = programs, plane_pass
        self._passes: dict[Plane, DecodePass] = {}

    def run(self, inputs: VisibilityInputs, target: ColorTarget) -> None:
        """Decode one plane of the whole picture."""
        if inputs.plane not in self._passes:
            self._passes[inputs.plane] = self._plane_pass(inputs.plane)
        self._passes[inputs.plane].run(inputs, target)

    def run_all(self, parts: Sequence[tuple[VisibilityInputs, ColorTarget]]) -> None:
        """Decode planes of the whole picture."""
        if len(parts) == 1:
            self.run(*parts[0])
            return
        program = self._programs.compute("passes/decode_deferred/decode_planes.comp", self._defines)
        inputs, size = parts[0][0], parts[0][1].size
        self._bind(program, inputs)
        numbers = [PLANES.index(inputs.plane) for inputs, _ in parts]
        for number, (_, target) in zip(numbers, parts, strict=True):
            target.texture.bind_to_image(int(ImageUnit.PLANES) + number, read=False, write=True)
        set_uniforms(program, {"planes": sum(1 << number for number in numbers)})
        program.run(*(-(-side // GROUP_SIDE) for side in size))
        self._gl.memory_barrier()

    def release(self) -> None:
        """Free the passes of single planes."""
        for plane_pass in self._passes.values():
            plane_pass.release()


class DecodeBinnedPass(DecodePass):
    """Pass of path `binned`. Three shaders sort the pixels by decoder (a counting sort), one dispatch decodes each bin.

    `count` counts the pixels of each decoder, `scan` adds up the counts to the first place of each bin, `scatter` writes the pixels
    there. All pixels of a dispatch share a decoder, so its weights are bound as a uniform buffer and no work group diverges. The GPU
    reads the size of a dispatch from the bin, so the CPU never waits (docs/explanation/decode-paths.md#binned).
    """

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

    def private_buffers(self) -> Sequence[moderngl.Buffer]:
        """Return the buffers of bins and of sorted pixels."""
        return self._bins, self._pixels


class DecodeSampledPass(RenderPass[VisibilityInputs, ColorTarget]):
    """Pass of a path with the stochastic filter: draws the mean of up to SAMPLES samples, each of one texel a pixel."""

    def __init__(self, decode: DecodePass, accumulate: Callable[[], Accumulator]) -> None:
        """Take `decode`, which draws one sample and is freed with this pass. `accumulate` makes an Accumulator for a plane."""
        self.name = decode.name
        self._decode, self._accumulate = decode, accumulate
        self._means: dict[Plane, Accumulator] = {}
        self._samples: WeakKeyDictionary[ColorTarget, int] = WeakKeyDictionary()

    @property
    def bytes_on_gpu(self) -> int:
        """Number of bytes of the pass's buffers and the last samples."""
        return self._decode.bytes_on_gpu + sum(mean.bytes_on_gpu for mean in self._means.values())

    def advance_all(self, parts: Sequence[tuple[VisibilityInputs, ColorTarget, Step]]) -> list[Progress]:
        """Draw the next sample of each of these planes of one view, or all missing ones for a whole picture.

        `BlendSamplesPass` averages BLEND surfaces; for each of its further samples, one sample is drawn here.
        """
        blend_sample = parts[0][0].blend_sample
        if blend_sample:
            self._decode.run_all([(inputs.of_sample(blend_sample), target) for inputs, target, _ in parts])
            return [Progress()] * len(parts)
        numbers = []
        for _, target, step in parts:
            before = self._samples.get(target, 0) if step.is_same_view and not step.is_stale else 0
            numbers.append(range(before, SAMPLES if step.budget.is_whole else before + 1))
        for number in range(min(samples.start for samples in numbers), max(samples.stop for samples in numbers)):
            drawn = [
                (inputs.of_sample(number), target)
                for (inputs, target, _), samples in zip(parts, numbers, strict=True)
                if number in samples
            ]
            self._add(number, drawn)
        left = [SAMPLES - self._samples[target] for _, target, _ in parts]
        return [Progress(pending=(Pending("samples", samples, SAMPLES),) if samples else ()) for samples in left]

    def _add(self, number: int, drawn: Sequence[tuple[VisibilityInputs, ColorTarget]]) -> None:
        """Draw sample `number` of these planes, and add it to their means."""
        if number == 0:
            self._decode.run_all(drawn)
        else:
            means = [self._mean(inputs.plane) for inputs, _ in drawn]
            into = [mean.sample(target.size) for mean, (_, target) in zip(means, drawn, strict=True)]
            self._decode.run_all([(inputs, sample) for (inputs, _), sample in zip(drawn, into, strict=True)])
            for mean, (_, target) in zip(means, drawn, strict=True):
                mean.run(number, target)
        for _, target in drawn:
            self._samples[target] = number + 1

    def _mean(self, plane: Plane) -> Accumulator:
        if plane not in self._means:
            self._means[plane] = self._accumulate()
        return self._means[plane]

    def release(self) -> None:
        """Free the decode pass and the last samples."""
        self._decode.release()
        for mean in self._means.values():
            mean.release()
