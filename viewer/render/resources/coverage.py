"""Coverage of textures, from packs with the map `alpha`."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.latents import texture_levels
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from ntc.pack.match import PackMatch


@dataclass(frozen=True)
class PackedCoverage:
    """Texture of a pack with the map `alpha`."""

    pack: Pack
    index: int
    """Number of the texture in the pack."""

    def mips(self) -> tuple[NDArray[np.uint8], ...]:
        """Return the mips of the coverage, [h, w] uint8 each; empty if the codec decodes them too slowly."""
        texture = self.pack.textures[self.index]
        levels = range(len(texture_levels(texture, self.pack.config)))
        mips = [codec_of(self.pack.config).coverage_image(self.pack, self.index, level) for level in levels]
        return tuple(mip for mip in mips if mip is not None)


def packed_coverage(pack: Pack, match: PackMatch) -> dict[int, PackedCoverage]:
    """Return the textures of `pack` with the map `alpha`, by texture id of the scene."""
    return {
        number: PackedCoverage(pack, index)
        for number, index in enumerate(match.texture_index)
        if index >= 0 and "alpha" in pack.textures[index].maps
    }
