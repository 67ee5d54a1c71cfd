"""How the decoding shaders are laid out for a device: variants that differ in time alone."""

from dataclasses import dataclass, fields, replace
from typing import Final, Literal, get_args

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.config import CodecConfig
from ntc.errors import InputError
from viewer.gl.context import GraphicsContext

WeightPlace = Literal["uniforms", "storage", "shared", "image"]
"""Where `run_decoders` reads the weights of its decoder: a uniform buffer, the storage buffer of all weights, a copy of the decoder in
shared memory, or an image. What is too large for uniform buffers or shared memory is read from storage."""
LARGEST: Final = {"pixels": 32, "unrolled": 16, "chunk": 64}


@dataclass(frozen=True)
class DecoderVariant:
    """Settings of `run_decoders`, which decodes several pixels with one decoder. None of them changes a result."""

    pixels: int = 1
    """Pixels that one invocation decodes: each weight is fetched once for all of them. More pixels take more registers."""
    unrolled: int = 16
    """Blocks of the first layer that are written out one after the other: where all are, hidden values are stored without a choice."""
    weights: WeightPlace = "uniforms"
    chunk: int = 4
    """Weights that are fetched before they are multiplied, so that a pixel's sums stay in registers meanwhile."""

    def __post_init__(self) -> None:
        for name, largest in LARGEST.items():
            if not 1 <= getattr(self, name) <= largest:
                raise ValueError(f"{name} = {getattr(self, name)} is not within 1 to {largest}")
        if self.weights not in get_args(WeightPlace):
            raise ValueError(f"weights = {self.weights} is none of {', '.join(get_args(WeightPlace))}")

    def __str__(self) -> str:
        return ",".join(f"{field.name}={getattr(self, field.name)}" for field in fields(self))


SOFTWARE: Final = DecoderVariant(4, 1, "image")
"""Best on llvmpipe, which gathers a vector from a buffer number by number."""
GPU: Final = DecoderVariant()
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


def default_variant(context: GraphicsContext, config: CodecConfig | BlockCodecConfig) -> DecoderVariant:
    """The variant of the device's class, for a codec: what is taken where nothing has been measured."""
    if context.info.is_software or not context.features.compute:
        return SOFTWARE if context.features.weights_in_image else replace(SOFTWARE, weights="uniforms")
    if "nvidia" in context.info.vendor.lower() and isinstance(config, CodecConfig):
        return NVIDIA if config.hidden_width <= NVIDIA_HIDDEN else GPU
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
