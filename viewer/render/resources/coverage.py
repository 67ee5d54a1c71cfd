"""What textures cover, as packs with the map `alpha` hold it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.latents import texture_levels
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from ntc.pack.match import PackMatch, changed_groups, same_shape


@dataclass(frozen=True)
class PackedCoverage:
    """A texture of a pack, which has the map `alpha`."""

    pack: Pack
    index: int
    """Number of the texture in the pack."""

    def mips(self) -> tuple[NDArray[np.uint8], ...]:
        """Return the mips that the pack has, [h, w] uint8 each; none where the codec takes long to decode them."""
        texture = self.pack.textures[self.index]
        levels = range(len(texture_levels(texture, self.pack.config)))
        found = [codec_of(self.pack.config).coverage_image(self.pack, self.index, level) for level in levels]
        return tuple(mip for mip in found if mip is not None)

    def in_pack(self, pack: Pack, index: int) -> "PackedCoverage":
        """Return the texture `index` of `pack`: this one where it decodes to the same."""
        if pack is self.pack and index == self.index:
            return self
        is_same = index == self.index and same_shape(self.pack, pack)
        if is_same and pack.textures[index].group not in changed_groups(self.pack, pack):
            return self
        return PackedCoverage(pack, index)


def packed_coverage(
    packs: Mapping[str, tuple[Pack, PackMatch]], before: Mapping[int, PackedCoverage]
) -> dict[int, PackedCoverage]:
    """Return, by texture of the scene, the first of `packs` that has its map `alpha`. What decodes as in `before` stays that."""
    found: dict[int, PackedCoverage] = {}
    for pack, match in packs.values():
        for number, index in enumerate(match.texture_index):
            if number not in found and index >= 0 and "alpha" in pack.textures[index].maps:
                known = before.get(number)
                found[number] = PackedCoverage(pack, index) if known is None else known.in_pack(pack, index)
    return found
