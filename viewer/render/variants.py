"""The variant of the decoding shaders of a pack: named, the default of the device's class, or the fastest, measured once and kept."""

import hashlib
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Final

import moderngl
import msgspec

from ntc.codec.gpu import DecoderVariant
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from ntc.io import write_text
from viewer.gl.context import ContextInformation, GraphicsContext
from viewer.gl.program import ShaderError, set_uniforms
from viewer.locations import variants_cache
from viewer.render.resources.decoding_shaders import (
    CANDIDATES,
    default_variant,
    fastest_first,
    parsed_variant,
    supported_precisions,
)
from viewer.render.resources.layout import BIN_GROUP, StorageBinding
from viewer.render.resources.pack_buffers import DecoderRanges, PackBuffers, codec_programs, scene_programs
from viewer.state.view_state import Precision

SECONDS: Final = 1.5
"""Time in seconds after which nothing is begun: with the compilation under way, 2 s on most drivers."""
LEAST_TEXELS: Final = 1 << 12
MOST_TEXELS: Final = 1 << 20
ENOUGH_SECONDS: Final = 4e-3
"""Shortest time in seconds that counts: texels are doubled until they take as long, for shorter times are those of the call."""
RUNS: Final = 3


@dataclass(frozen=True)
class VariantTimes:
    """Times of the variants for one codec shape on one device: ns per texel, by precision and variant."""

    nanoseconds: Mapping[Precision, Mapping[DecoderVariant, float]]

    def fastest(self, precision: Precision) -> DecoderVariant | None:
        """Return the variant with the least time; None where none was measured in this precision."""
        own = self.nanoseconds.get(precision, {})
        return min(own, key=lambda variant: own[variant], default=None)

    @property
    def precisions(self) -> tuple[Precision, ...]:
        """Precisions that were measured, the fastest first."""
        least = {precision: min(own.values()) for precision, own in self.nanoseconds.items() if own}
        return tuple(sorted(least, key=lambda precision: least[precision]))


def _in_order(first: DecoderVariant, precisions: Sequence[Precision]) -> Iterator[tuple[Precision, DecoderVariant]]:
    """Yield all to measure: each precision by the device's default, then single precision by the others, then the rest."""
    others = [variant for variant in CANDIDATES if variant != first]
    yield from ((precision, first) for precision in precisions)
    yield from (("fp32", variant) for variant in others)
    yield from ((precision, variant) for variant in others for precision in precisions if precision != "fp32")


def _codes_alone_or_together(first: DecoderVariant) -> tuple[DecoderVariant, ...]:
    """Return the variants of a codec whose pixels share no weights, the device's default first."""
    return first, replace(first, together=1 - first.together)


class VariantMeasurement:
    """Measurement of the decoders of one pack, on its texture with the fewest texels."""

    def __init__(self, context: GraphicsContext, pack: Pack) -> None:
        self._context, self._pack = context, pack
        self._programs = scene_programs(context)
        areas = [texture.width * texture.height for texture in pack.textures]
        self._texture = areas.index(min(areas))
        self._shares = codec_of(pack.config).gpu_tables(pack.config).shares_decoders
        """True where pixels of one decoder share weights; else codes are decoded by each pixel or by work groups, in any precision."""

    def times(self, seconds: float = SECONDS) -> VariantTimes:
        """Measure as many precisions and variants as `seconds` allow, one at least. What the driver cannot compile is left out."""
        found: dict[Precision, dict[DecoderVariant, float]] = {}
        end = time.perf_counter() + seconds
        first = default_variant(self._context, self._pack.config)
        precisions = supported_precisions(self._context)
        order = (
            _in_order(first, precisions) if self._shares else (("fp32", own) for own in _codes_alone_or_together(first))
        )
        try:
            for precision, variant in order:
                if found and time.perf_counter() > end:
                    break
                with suppress(ShaderError, InputError, moderngl.Error):
                    found.setdefault(precision, {})[variant] = self._nanoseconds(precision, variant)
        finally:
            self._programs.release()
        return VariantTimes(found if self._shares else dict.fromkeys(precisions, found.get("fp32", {})))

    def _nanoseconds(self, precision: Precision, variant: DecoderVariant) -> float:
        """Return the least time of a texel in ns."""
        context, pack = self._context, self._pack
        program = codec_programs(self._programs, pack, variant)
        name, pixels = ("decode", variant.pixels) if self._shares else ("lookups", 1)
        with context.memory.transaction():
            buffers = PackBuffers(context, pack, [self._texture], precision, variant=variant)
            ranges = DecoderRanges(context, pack, precision, variant)
            results = context.memory.buffer(
                "timing of decoders", reserve=16 * (MOST_TEXELS + BIN_GROUP * variant.pixels)
            )
        try:
            shader = program.compute(f"passes/time_decoder/{name}.comp", {**buffers.defines, **ranges.defines})
            set_uniforms(shader, {"network_blocks": buffers.network_blocks})
            buffers.bind()
            ranges.bind(pack.textures[self._texture].group)
            results.bind_to_storage_buffer(int(StorageBinding.RESULTS))

            def taken(texels: int) -> float:
                context.gl.finish()
                start = time.perf_counter()
                shader.run(-(-texels // (BIN_GROUP * pixels)))
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


LARGEST_FILE: Final = 1 << 16
FORMAT: Final = 1
"""Version of the files; it rises when older times say nothing of the shaders any more."""


def _path(folder: Path, device: ContextInformation, shape: str) -> Path:
    key = "\n".join((str(FORMAT), device.vendor, device.renderer, device.version, shape))
    return folder / f"{hashlib.sha256(key.encode()).hexdigest()[:24]}.json"


class _KeptTimes(msgspec.Struct, frozen=True):
    """Content of a file of times."""

    renderer: str
    version: str
    shape: str
    nanoseconds: dict[Precision, dict[str, Annotated[float, msgspec.Meta(gt=0.0)]]]
    """Time of a texel by precision and by the text of a variant."""


def _read(path: Path) -> tuple[str, VariantTimes] | None:
    """Return shape and times in a file; None where there is none, or where `keep_times` did not write it."""
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
        if len(content) > LARGEST_FILE:
            return None
        kept = msgspec.json.decode(content, type=_KeptTimes)
        times = {
            precision: {parsed_variant(text): time for text, time in own.items()}
            for precision, own in kept.nanoseconds.items()
        }
        return kept.shape, VariantTimes(times)
    except (OSError, ValueError, RecursionError, InputError):
        return None


def read_times(folder: Path, device: ContextInformation, shape: str) -> VariantTimes | None:
    """Read what `keep_times` wrote for this device and shape; None where there is nothing, or a file that it did not write."""
    found = _read(_path(folder, device, shape))
    return None if found is None else found[1]


def keep_times(folder: Path, device: ContextInformation, shape: str, times: VariantTimes) -> None:
    """Write `times`. A folder that cannot be written to is no error: they are measured again."""
    nanoseconds = {
        precision: {str(variant): time for variant, time in own.items()} for precision, own in times.nanoseconds.items()
    }
    content = msgspec.json.encode(_KeptTimes(device.renderer, device.version, shape, nanoseconds))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_text(_path(folder, device, shape), msgspec.json.format(content, indent=2).decode() + "\n")
    except (OSError, InputError):
        return


def kept_times(folder: Path, device: ContextInformation) -> dict[str, VariantTimes]:
    """Return all times that are kept for a device, by codec shape."""
    read = [(path, _read(path)) for path in sorted(folder.glob("*.json"))]
    return {found[0]: found[1] for path, found in read if found and path == _path(folder, device, found[0])}


VARIANT_VARIABLE: Final = "NTC_VIEWER_DECODER_VARIANT"
"""Environment variable: `default`, `measured`, or settings such as `pixels=2,weights=shared`. Else GPUs measure, software does not."""


@dataclass
class VariantChoice:
    """Choice of each pack's variant; where nothing else is asked for, that of the device's class."""

    wanted: str = "default"
    """Choice by the user: `default`, `measured`, settings of a variant, or empty: `measured` on a GPU, else `default`."""
    folder: Path | None = None
    """Folder where times are kept; None: `variants_cache()`."""
    tell: Callable[[str], None] = lambda _: None
    """Function that is called with a line when something has been measured."""
    _times: dict[str, VariantTimes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._named = None if self.wanted in ("", "default", "measured") else parsed_variant(self.wanted)

    @classmethod
    def of_environment(cls, wanted: str, tell: Callable[[str], None]) -> "VariantChoice":
        """Choose what an option asks for, else VARIANT_VARIABLE. Raises InputError for unknown settings."""
        return cls(wanted or os.environ.get(VARIANT_VARIABLE, ""), tell=tell)

    def variant(self, context: GraphicsContext, pack: Pack, precision: Precision) -> DecoderVariant:
        """Return the variant in which `pack` is decoded. May measure, which takes a second or two, once for each shape and driver."""
        if self._named is not None:
            return self._named if context.features.compute else replace(self._named, weights="image")
        times = self._measured(context, pack)
        own = times.fastest(precision) if times is not None else None
        return own or default_variant(context, pack.config)

    def precisions(self, context: GraphicsContext, pack: Pack) -> tuple[Precision, ...]:
        """Return the precisions of this driver, the fastest first: as measured, else as on most GPUs."""
        times = self._measured(context, pack) if self._named is None else None
        return times.precisions if times is not None else fastest_first(context)

    def _measured(self, context: GraphicsContext, pack: Pack) -> VariantTimes | None:
        tables = codec_of(pack.config).gpu_tables(pack.config)
        measures = self.wanted == "measured" or (not self.wanted and not context.info.is_software)
        has_variants = tables.shares_decoders or tables.together_shader
        if not measures or not context.features.compute or not has_variants or not pack.textures:
            return None
        shape, folder = tables.shape_text(), self.folder or variants_cache()
        if shape not in self._times:
            times = read_times(folder, context.info, shape)
            if times is None:
                times = VariantMeasurement(context, pack).times()
                keep_times(folder, context.info, shape, times)
                self.tell(f"decoder {shape}: {times.fastest('fp32')} is the fastest variant on {context.info.renderer}")
            self._times[shape] = times
        return self._times[shape]
