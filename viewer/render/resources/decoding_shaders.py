"""Settings of the decoding shaders: precision, and the variant for a driver."""

from dataclasses import replace

from ntc.codec.gpu import VARIANTS, DecoderVariant, VariantName
from ntc.errors import InputError
from viewer.gl.context import GraphicsContext
from viewer.gl.program import EXTENSION
from viewer.state.view_state import Precision

LEVELS: dict[Precision, int] = {"fp32": 0, "fp16": 0, "fp16-arithmetic": 1, "fp16-accumulate": 2}
"""Values of HALF_ARITHMETIC in shaders/ntc/half.glsl."""

EVERYWHERE: tuple[Precision, ...] = ("fp32", "fp16")
"""Precisions that every driver supports."""


FASTEST_FIRST: tuple[Precision, ...] = ("fp16-accumulate", "fp16", "fp32", "fp16-arithmetic")
"""Assumed order of precisions by speed, from the number of vector instructions of GPU compilers (docs/explanation/decode-paths.md).
Summing up halves in single precision takes more instructions than single precision throughout."""


def fastest_first(context: GraphicsContext) -> tuple[Precision, ...]:
    """Return the precisions that this driver supports, in the order of FASTEST_FIRST."""
    supported = supported_precisions(context)
    return tuple(precision for precision in FASTEST_FIRST if precision in supported)


def supported_precisions(context: GraphicsContext) -> tuple[Precision, ...]:
    """Return the precisions that this driver supports."""
    return tuple(LEVELS) if context.features.half_arithmetic is not None else EVERYWHERE


def unsupported_precisions(context: GraphicsContext) -> dict[str, str]:
    """Return the precisions that this driver cannot compute in: {precision: reason}."""
    lacking = set(LEVELS) - set(supported_precisions(context))
    reason = f"{context.info.renderer} has no 16-bit arithmetic in shaders; use fp16, which stores decoders in 16 bits"
    return {precision: reason for precision in LEVELS if precision in lacking}


def precision_defines(
    context: GraphicsContext, precision: Precision, emulated: bool = False
) -> dict[str, int | float | str]:
    """Return the defines of the decoding shaders. `emulated`: emulate halves by rounding in single precision.

    Raises InputError if `precision` needs half arithmetic and the driver has none.
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


def variant_name(context: GraphicsContext) -> VariantName:
    """Return the variant for a driver: `software` for software renderers and OpenGL 4.1, else `gpu`."""
    return "software" if context.info.is_software or not context.features.compute else "gpu"


def decoder_variant(context: GraphicsContext, name: VariantName | None = None) -> DecoderVariant:
    """Return the variant of this name, adapted to the driver; None: the name of `variant_name`."""
    variant, features = VARIANTS[name or variant_name(context)], context.features
    # OpenGL 4.1 reads buffers as textures in any case.
    in_image = features.weights_in_image and (variant.weights == "image" or not features.compute)
    return replace(variant, weights="image" if in_image else "uniforms")
