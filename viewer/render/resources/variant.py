"""The variant of the decoding shaders that suits a device."""

from dataclasses import fields, replace
from typing import Final

from ntc.codec.gpu import GPU, SOFTWARE, DecoderVariant
from ntc.codec.model import CodecSettings
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from viewer.gl.context import GraphicsContext

NVIDIA: Final = DecoderVariant(pixels=2)
"""Two pixels of 64 hidden values fit the 255 registers of an invocation there."""
NVIDIA_HIDDEN: Final = 64
CANDIDATES: Final = (
    GPU,
    NVIDIA,
    replace(GPU, weights="shared"),
    replace(NVIDIA, weights="shared"),
    replace(GPU, unrolled=1),
    replace(GPU, weights="storage"),
)
"""What is measured on a GPU, the most promising first."""


def default_variant(context: GraphicsContext, config: CodecSettings) -> DecoderVariant:
    """The variant of the device's class, for a codec: what is taken where nothing has been measured."""
    if context.info.is_software or not context.features.compute:
        return SOFTWARE if context.features.weights_in_image else replace(SOFTWARE, weights="uniforms")
    tables = codec_of(config).gpu_tables(config)
    if "nvidia" in context.info.vendor.lower() and tables.shares_decoders:
        return NVIDIA if 4 * tables.loop_length <= NVIDIA_HIDDEN else GPU
    return GPU


def parsed_variant(text: str) -> DecoderVariant:
    """The variant that `str` writes; settings that are not named are those of GPU. Raises InputError."""
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
