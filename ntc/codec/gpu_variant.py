"""How decoding shaders are laid out for a device: variants that differ in time alone."""

from dataclasses import dataclass, fields
from typing import Final, Literal, get_args

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
