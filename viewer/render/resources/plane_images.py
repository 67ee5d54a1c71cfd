"""The original images of a texture as hardware samples them, plane by plane."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import PLANE_COMPONENTS, Plane
from ntc.codec.mips import mip_chain
from viewer.scene.model import SceneTexture

NEUTRAL = 255
"""Of components that a texture lacks, which nothing reads."""


def plane_mips(texture: SceneTexture, plane: Plane) -> tuple[NDArray[np.uint8], ...]:
    """All mips, down to 1x1 texel, of a plane that `texture` has maps of.

    [h, w, 3] uint8 sRGB of the base colour; of the others [h, w, 4] uint8, the plane's four components as they are stored. Filtered as
    each map is (`ntc.codec.mips`), so that normals stay unit vectors.
    """
    if plane == "base":
        return mip_chain(texture.pixels, "srgb")
    places = PLANE_COMPONENTS[plane]
    maps = tuple(name for name in texture.maps if name in places)
    pixels = np.concatenate([texture.further_maps[name] for name in maps], axis=2)
    components = [places[name] + number for name in maps for number in range(texture.further_maps[name].shape[2])]
    chain = []
    for mip in mip_chain(pixels, "srgb", maps):
        whole = np.full((*mip.shape[:2], 4), NEUTRAL, np.uint8)
        whole[..., components] = mip
        chain.append(whole)
    return tuple(chain)
