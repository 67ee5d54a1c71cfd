"""How the decoder network is laid out in GLSL: settings of the generator, apart from the codec's shape."""

from dataclasses import dataclass


@dataclass(frozen=True)
class NetworkConfig:
    """Settings of `run_decoders`, which decodes several pixels with one decoder. None of them changes a result."""

    pixels: int = 4
    """Pixels that one invocation decodes: each weight is fetched once for all of them. More pixels take more registers."""
    chunk: int = 4
    """Weights that are fetched before they are multiplied, so that a pixel's sums stay in registers meanwhile."""
    unrolled: int = 1
    """Blocks of the first layer that are written out one after the other."""

    def __post_init__(self) -> None:
        if not 1 <= self.pixels <= 32:
            raise ValueError(f"network.pixels = {self.pixels} is out of range")
        if not 1 <= self.unrolled <= 16:
            raise ValueError(f"network.unrolled = {self.unrolled} is out of range")
        if not 1 <= self.chunk <= 64:
            raise ValueError(f"network.chunk = {self.chunk} is out of range")


DEFAULT_NETWORK = NetworkConfig()
"""Chosen by measuring on llvmpipe (docs/decode-paths.md)."""
