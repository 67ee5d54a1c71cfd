"""Timing the variants of a decoder on the device at hand."""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import moderngl

from ntc.codec.gpu import DecoderVariant
from ntc.codec.model import Pack
from ntc.errors import InputError
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ShaderError, set_uniforms
from viewer.render.resources.decoder_ranges import DecoderRanges
from viewer.render.resources.layout import BIN_GROUP, StorageBinding
from viewer.render.resources.pack_buffers import PackBuffers, codec_programs, scene_programs
from viewer.render.resources.precision import supported_precisions
from viewer.render.resources.variant import CANDIDATES, default_variant
from viewer.state.view_state import Precision

SECONDS: Final = 1.5
"""Nothing is begun after so long: with the compilation under way, 2 s on most drivers."""
LEAST_TEXELS: Final = 1 << 12
MOST_TEXELS: Final = 1 << 20
ENOUGH_SECONDS: Final = 4e-3
"""Texels are doubled until they take so long, for times of less are those of the call."""
RUNS: Final = 3


@dataclass(frozen=True)
class VariantTimes:
    """What was measured for one codec shape on one device: ns a texel, by precision and variant."""

    nanoseconds: Mapping[Precision, Mapping[DecoderVariant, float]]

    def fastest(self, precision: Precision) -> DecoderVariant | None:
        """The variant with the least time; None where none was measured in this precision."""
        own = self.nanoseconds.get(precision, {})
        return min(own, key=lambda variant: own[variant], default=None)

    @property
    def precisions(self) -> tuple[Precision, ...]:
        """Those that were measured, the fastest first."""
        least = {precision: min(own.values()) for precision, own in self.nanoseconds.items() if own}
        return tuple(sorted(least, key=lambda precision: least[precision]))


def _in_order(first: DecoderVariant, precisions: Sequence[Precision]) -> Iterator[tuple[Precision, DecoderVariant]]:
    """All to measure: each precision by the device's default, then single precision by the others, then the rest."""
    others = [variant for variant in CANDIDATES if variant != first]
    yield from ((precision, first) for precision in precisions)
    yield from (("fp32", variant) for variant in others)
    yield from ((precision, variant) for variant in others for precision in precisions if precision != "fp32")


class VariantMeasurement:
    """Times decoders of one pack: those of its texture with the fewest texels."""

    def __init__(self, context: GraphicsContext, pack: Pack) -> None:
        self._context, self._pack = context, pack
        self._programs = scene_programs(context)
        areas = [texture.width * texture.height for texture in pack.textures]
        self._texture = areas.index(min(areas))

    def times(self, seconds: float = SECONDS) -> VariantTimes:
        """Times of as many precisions and variants as `seconds` allow, one at least. What the driver cannot compile is left out."""
        found: dict[Precision, dict[DecoderVariant, float]] = {}
        end = time.perf_counter() + seconds
        first = default_variant(self._context, self._pack.config)
        try:
            for precision, variant in _in_order(first, supported_precisions(self._context)):
                if found and time.perf_counter() > end:
                    break
                with suppress(ShaderError, InputError, moderngl.Error):
                    found.setdefault(precision, {})[variant] = self._nanoseconds(precision, variant)
        finally:
            self._programs.release()
        return VariantTimes(found)

    def _nanoseconds(self, precision: Precision, variant: DecoderVariant) -> float:
        """Least time of a texel."""
        context, pack = self._context, self._pack
        program = codec_programs(self._programs, pack, variant)
        with context.memory.transaction():
            buffers = PackBuffers(context, pack, [self._texture], precision, variant=variant)
            ranges = DecoderRanges(context, pack, precision, variant)
            results = context.memory.buffer(
                "timing of decoders", reserve=16 * (MOST_TEXELS + BIN_GROUP * variant.pixels)
            )
        try:
            shader = program.compute("passes/time_decoder/decode.comp", {**buffers.defines, **ranges.defines})
            set_uniforms(shader, {"network_blocks": buffers.network_blocks})
            buffers.bind()
            ranges.bind(pack.textures[self._texture].group)
            results.bind_to_storage_buffer(int(StorageBinding.RESULTS))

            def taken(texels: int) -> float:
                context.gl.finish()
                start = time.perf_counter()
                shader.run(-(-texels // (BIN_GROUP * variant.pixels)))
                context.gl.finish()
                return time.perf_counter() - start

            texels = LEAST_TEXELS
            taken(texels)
            while texels < MOST_TEXELS and taken(texels) < ENOUGH_SECONDS:
                texels *= 2
            return min(taken(texels) for _ in range(RUNS)) / texels * 1e9
        finally:
            for made in (buffers, ranges, results):
                made.release()
