"""Where the pixels of a texture come from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import MapName


class TexturePixels(Protocol):
    """Pixels of one texture, that may have to be read from a file: any thread may ask. All raise InputError where that fails."""

    def picture(self) -> NDArray[np.uint8]:
        """[H, W, 3] uint8 sRGB: base colour; of a set without one a picture of its first map."""
        ...

    def alpha(self) -> NDArray[np.uint8] | None:
        """[H, W] uint8 coverage; None where there is none."""
        ...

    def further(self) -> Mapping[MapName, NDArray[np.uint8]]:
        """[H, W, channels of the map] uint8 of each map besides the base colour."""
        ...


@dataclass(frozen=True, eq=False)
class PixelsInMemory:
    """Pixels that are there as long as the texture."""

    color: NDArray[np.uint8]
    """[H, W, 3]."""
    coverage: NDArray[np.uint8] | None = None
    """[H, W]."""
    maps: Mapping[MapName, NDArray[np.uint8]] = field(default_factory=dict)

    def picture(self) -> NDArray[np.uint8]:
        """[H, W, 3] uint8."""
        return self.color

    def alpha(self) -> NDArray[np.uint8] | None:
        """[H, W] uint8."""
        return self.coverage

    def further(self) -> Mapping[MapName, NDArray[np.uint8]]:
        """By map [H, W, C] uint8."""
        return self.maps
