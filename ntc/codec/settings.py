"""The settings of a codec: what outside of it may be asked of them."""

from abc import ABC, abstractmethod
from typing import ClassVar

from ntc.codec.maps import MapName


class CodecSettings(ABC):
    """Shape of latents and decoders, the same for every texture of a pack. Subclasses are frozen dataclasses."""

    kind: ClassVar[str]
    """Name of the codec in `ntc.codec.registry`."""
    levels: int | None
    """Encoded mips at most. None: as many as `smallest_top_cells` asks for. 1: mip 0 alone."""
    output_channels: int
    """Channels that decoders write, 1 to 12: those of `maps`; a texture with fewer uses the first ones."""
    maps: tuple[MapName, ...]
    """Maps that the channels stand for (`ntc.codec.maps`): all that any texture of the pack has."""

    @property
    @abstractmethod
    def downscale(self) -> int:
        """Texels per latent cell along one side."""

    @property
    @abstractmethod
    def smallest_top_cells(self) -> int:
        """The pyramid ends at the first level whose longer side is at most this many cells."""

    @property
    @abstractmethod
    def multiply_adds(self) -> int:
        """Multiply-adds of one decoded texel at most."""
