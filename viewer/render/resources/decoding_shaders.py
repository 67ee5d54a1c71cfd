"""Settings of the decoding shaders: precision, and the variant that suits a device."""

from dataclasses import fields, replace
from typing import Final

from ntc.codec.gpu import GPU, SOFTWARE, DecoderVariant
from ntc.codec.model import CodecSettings
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from viewer.gl.context import GraphicsContext
from viewer.gl.program import EXTENSION
from viewer.state.view_state import Precision

LEVELS: dict[Precision, int] = {"fp32": 0, "fp16": 0, "fp16-arithmetic": 1, "fp16-accumulate": 2}
"""Values of HALF_ARITHMETIC in shaders/ntc/half.glsl."""

EVERYWHERE: tuple[Precision, ...] = ("fp32", "fp16")
"""Precisions that every driver supports."""


FASTEST_FIRST: tuple[Precision, ...] = ("fp16-accumulate", "fp16", "fp32", "fp16-arithmetic")
"""Order of precisions where nothing was measured, by vector instructions of GPU compilers (docs/explanation/decode-paths.md). Halves
that are summed up in single precision take more of them than single precision alone."""


def fastest_first(context: GraphicsContext) -> tuple[Precision, ...]:
    """Return the precisions that this driver supports, in the order of FASTEST_FIRST."""
    supported = supported_precisions(context)
    return tuple(precision for precision in FASTEST_FIRST if precision in supported)


def supported_precisions(context: GraphicsContext) -> tuple[Precision, ...]:
    """Return the precisions that this driver supports."""
    return tuple(LEVELS) if context.features.half_arithmetic is not None else EVERYWHERE


def unsupported_precisions(context: GraphicsContext) -> dict[str, str]:
    """Return the reasons why this driver cannot compute in a precision, by its name."""
    lacking = set(LEVELS) - set(supported_precisions(context))
    reason = f"{context.info.renderer} has no 16-bit arithmetic in shaders; use fp16, which stores decoders in 16 bits"
    return {precision: reason for precision in LEVELS if precision in lacking}


def precision_defines(
    context: GraphicsContext, precision: Precision, emulated: bool = False
) -> dict[str, int | float | str]:
    """Return the defines of the decoding shaders. `emulated` rounds in single precision what the driver cannot compute in halves.

    Raises InputError where the driver has no half arithmetic and `precision` needs it.
    """
    defines: dict[str, int | float | str] = {"PRECISION_FP16": int(precision != "fp32")}
    if LEVELS[precision] == 0:
        return defines
    defines |= {"HALF_ARITHMETIC": LEVELS[precision], "HALF_EMULATED": int(emulated)}
    if not emulated:
        extension = context.features.half_arithmetic
        if extension is None:
            raise InputError(
                f"precision {precision}: {context.info.renderer} has no half arithmetic in shaders; use --precision fp16"
            )
        defines[EXTENSION] = extension
    return defines


NVIDIA: Final = DecoderVariant(pixels=2)
"""Variant for NVIDIA: two pixels of 64 hidden values fit the 255 registers of an invocation."""
NVIDIA_HIDDEN: Final = 64
CANDIDATES: Final = (
    GPU,
    NVIDIA,
    replace(GPU, weights="shared"),
    replace(NVIDIA, weights="shared"),
    replace(GPU, unrolled=1),
    replace(GPU, weights="storage"),
)
"""Variants that are measured on a GPU, the most promising first."""


def default_variant(context: GraphicsContext, config: CodecSettings) -> DecoderVariant:
    """Return the variant of the device's class for a codec: the choice where nothing has been measured."""
    if context.info.is_software or not context.features.compute:
        return SOFTWARE if context.features.weights_in_image else replace(SOFTWARE, weights="uniforms")
    tables = codec_of(config).gpu_tables(config)
    if "nvidia" in context.info.vendor.lower() and tables.shares_decoders:
        return NVIDIA if 4 * tables.loop_length <= NVIDIA_HIDDEN else GPU
    return GPU


def parsed_variant(text: str) -> DecoderVariant:
    """Parse the text of a variant; settings that are not named are those of GPU. Raises InputError."""
    kinds = {field.name: str if field.name == "weights" else int for field in fields(DecoderVariant)}
    given: dict[str, int | str] = {}
    for part in text.split(","):
        name, _, value = part.partition("=")
        if name.strip() not in kinds:
            raise InputError(
                f"decoder variant {text!r}: {part!r} is none of {', '.join(f'{kind}=...' for kind in kinds)}"
            )
        try:
            given[name.strip()] = kinds[name.strip()](value.strip())
        except ValueError:
            raise InputError(f"decoder variant {text!r}: {part!r} is not a number") from None
    try:
        return DecoderVariant(**given)  # type: ignore[arg-type]
    except ValueError as error:
        raise InputError(f"decoder variant {text!r}: {error}") from error
