"""The worst case for a wave, as the paper times it: all decoders meet in every block of 8x8 pixels (paper, Sec. 4)."""

import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.config import CodecConfig
from viewer.bench.random_pack import random_pack
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, ShaderLibrary
from viewer.gl.timer import PassTimer
from viewer.passes.albedo_target import AlbedoTarget
from viewer.passes.decode_binned import DecodeBinnedPass
from viewer.passes.decode_deferred import DecodeDeferredPass
from viewer.passes.decoder_ranges import DecoderRanges
from viewer.passes.layout import GROUP_SIDE, MATERIAL_RECORD, MATERIAL_SHIFT, StorageBinding, scene_layout_glsl
from viewer.passes.pack_buffers import PackBuffers, codec_programs
from viewer.passes.visibility import SurfaceContent, VisibilityTarget
from viewer.resources import shaders_folder
from viewer.view_state import Precision

TEXTURE_SIDE = 256
SHARED = 1


@dataclass(frozen=True)
class WorstCaseConfig:
    """What is timed."""

    size: tuple[int, int] = (512, 512)
    decoders: tuple[int, ...] = (1, 5, 10, 20)
    precisions: tuple[Precision, ...] = ("fp32", "fp16")
    repeats: int = 7
    codec: CodecConfig = field(default_factory=CodecConfig)


@dataclass(frozen=True)
class WorstCaseRow:
    """One way to decode."""

    decoders: int
    """In every block."""
    path: str
    """`deferred` with a decoder index for each pixel, `deferred, shared` where there is only one decoder, or `binned`."""
    precision: str
    median_ms: float
    least_ms: float
    most_ms: float
    to_shared: float
    """Median, as a multiple of the shared decoder's in the same precision."""
    gigaflops: float
    """Multiplications and additions of the decoders' layers, 10^9 a second."""
    largest_difference: float
    """Of the albedo, to the path `deferred` with a decoder index; linear, 0 to 1."""


class OneMaterial:
    """White, repeated, trilinear."""

    def __init__(self, gl: moderngl.Context) -> None:
        record = np.zeros(1, MATERIAL_RECORD)
        record["factor"] = 1.0
        self._buffer = gl.buffer(record.tobytes())

    def bind_materials(self) -> None:
        """Bind the materials to their storage binding."""
        self._buffer.bind_to_storage_buffer(int(StorageBinding.MATERIALS))

    def release(self) -> None:
        """Free the buffer."""
        self._buffer.release()


def interleaved_words(size: tuple[int, int], textures: int) -> NDArray[np.uint32]:
    """[H, W, 4] visibility words: pixels take the textures in turn, the same in every block, one texel a pixel."""
    width, height = size
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    texture = ((y % GROUP_SIDE) * GROUP_SIDE + x % GROUP_SIDE) % textures
    words = np.zeros((height, width, 4), np.uint32)
    words[..., 0] = (texture + 1) | (1 << MATERIAL_SHIFT)
    words[..., 1] = ((x + 0.5) / TEXTURE_SIDE).astype(np.float32).view(np.uint32)
    words[..., 2] = ((y + 0.5) / TEXTURE_SIDE).astype(np.float32).view(np.uint32)
    words[..., 3] = np.float32(1.0 / TEXTURE_SIDE).view(np.uint32)
    return words


@dataclass(eq=False)
class _Candidate:
    decoders: int
    path: str
    precision: Precision
    run: Callable[[], None]
    read: Callable[[], NDArray[np.float32]]


def worst_case(
    context: GraphicsContext, config: WorstCaseConfig, progress: Callable[[int, int], None] = lambda done, of: None
) -> tuple[WorstCaseRow, ...]:
    """Times of every path, number of decoders and precision; candidates take turns, so that drift hits all alike."""
    gl = context.gl
    material = OneMaterial(gl)
    target = AlbedoTarget(context, config.size)
    candidates: list[_Candidate] = []
    released: list[Callable[[], None]] = [material.release, target.release]
    library = ShaderLibrary(shaders_folder(), {"generated/layout.glsl": scene_layout_glsl()})
    programs: ProgramFactory | None = None
    for decoders in config.decoders:
        pack = random_pack(decoders, decoders, TEXTURE_SIDE, config.codec)
        visibility = VisibilityTarget(context, config.size, SurfaceContent(False, False))
        visibility.write(interleaved_words(config.size, decoders))
        programs = programs or codec_programs(ProgramFactory(gl, library), pack)
        for precision in config.precisions:
            buffers = PackBuffers(context, pack, range(decoders), precision)
            ranges = DecoderRanges(context, pack, precision)
            released += [buffers.release, ranges.release]
            indexed = DecodeDeferredPass(context, programs, buffers, ranges, False, None)

            def deferred(run: DecodeDeferredPass = indexed, seen: VisibilityTarget = visibility) -> None:
                run.run(seen, material, target)

            candidates.append(_Candidate(decoders, "deferred", precision, deferred, target.read))
            if decoders == SHARED:
                shared = DecodeDeferredPass(context, programs, buffers, ranges, False, 0)

                def alone(run: DecodeDeferredPass = shared, seen: VisibilityTarget = visibility) -> None:
                    run.run(seen, material, target)

                candidates.append(_Candidate(decoders, "deferred, shared", precision, alone, target.read))
            binned = DecodeBinnedPass(context, programs, buffers, ranges, pack, False)
            released.append(binned.release)

            def sorted_by_decoder(
                run: DecodeBinnedPass = binned, seen: VisibilityTarget = visibility, count: int = decoders
            ) -> None:
                run.run(seen, material, target, range(count))

            candidates.append(_Candidate(decoders, "binned", precision, sorted_by_decoder, target.read))
    rows = _timed(context, candidates, config, progress)
    for release in released:
        release()
    return rows


def _timed(
    context: GraphicsContext,
    candidates: Sequence[_Candidate],
    config: WorstCaseConfig,
    progress: Callable[[int, int], None],
) -> tuple[WorstCaseRow, ...]:
    timer = PassTimer(context)
    times: list[list[float]] = [[] for _ in candidates]
    differences: list[float] = []
    truth: NDArray[np.float32] = np.zeros(0, np.float32)
    for candidate in candidates:
        candidate.run()
        albedo = candidate.read()
        truth = albedo if candidate.path == "deferred" else truth
        differences.append(float(np.abs(albedo - truth).max()))
    for repeat in range(config.repeats):
        for number, candidate in enumerate(candidates):
            with timer.measure("decode"):
                candidate.run()
            times[number].append(timer.last_ms)
        progress(repeat + 1, config.repeats)
    medians = [statistics.median(values) for values in times]
    shared = {
        candidate.precision: median
        for candidate, median in zip(candidates, medians, strict=True)
        if candidate.path == "deferred, shared"
    }
    work = 2.0 * config.codec.multiply_adds * config.size[0] * config.size[1]
    return tuple(
        WorstCaseRow(
            decoders=candidate.decoders,
            path=candidate.path,
            precision=candidate.precision,
            median_ms=median,
            least_ms=min(values),
            most_ms=max(values),
            to_shared=median / shared.get(candidate.precision, median),
            gigaflops=work / median / 1e6,
            largest_difference=difference,
        )
        for candidate, median, values, difference in zip(candidates, medians, times, differences, strict=True)
    )
