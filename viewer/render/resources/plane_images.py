"""The original images of a texture as hardware samples them, plane by plane."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import PLANE_COMPONENTS, MapName, Plane, map_slices
from ntc.codec.mips import mip_chain
from viewer.scene.map_pictures import plane_of_maps
from viewer.scene.model import SceneTexture


def plane_mips(texture: SceneTexture, plane: Plane) -> tuple[NDArray[np.uint8], ...]:
    """All mips, down to 1x1 texel, of a plane that `texture` has maps of.

    [h, w, 3] uint8 sRGB of the base colour; of the others [h, w, 4] uint8, the plane's four components as they are stored. Filtered as
    each map is (`ntc.codec.mips`), so that normals stay unit vectors.
    """
    if plane == "base":
        return mip_chain(texture.pixels, "srgb")
    maps = tuple(name for name in texture.maps if name in PLANE_COMPONENTS[plane])
    pixels = np.concatenate([texture.further_maps[name] for name in maps], axis=2)
    mips = mip_chain(pixels, "srgb", maps)
    chains: dict[MapName, list[NDArray[np.uint8]]] = {
        name: [mip[..., place] for mip in mips] for name, place in map_slices(maps, pixels.shape[2]).items()
    }
    return plane_of_maps(plane, chains)
