"""What the error of each decoded map does to a view: one map at a time is put into the original images."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ntc.codec.color import linear_to_srgb8
from ntc.codec.maps import MAPS, PLANE_OF_MAP, MapName
from ntc.codec.quality import finite_or_none
from viewer.render.renderer import Renderer
from viewer.state.view_state import DecodedMaps, Slot


@dataclass(frozen=True, eq=False)
class MapError:
    """Of the view's picture with these maps decoded and all others original, over 8-bit sRGB RGB of the covered pixels."""

    maps: DecodedMaps
    mean_squared_error: float
    """In squared steps of 1/255."""
    psnr_db: float | None
    """None where the pictures are equal."""
    by_texture: NDArray[np.float64]
    """[textures of the scene] sum of squared errors over the pixels of each texture, in squared steps."""
    squared_error: NDArray[np.float32]
    """[H, W] mean over RGB, in squared steps, row 0 on top."""


def shown_maps(renderer: Renderer, slot: Slot) -> tuple[MapName, ...]:
    """Maps that the last view shows of what `slot` decodes, in the order of MAPS."""
    drawn = renderer.decoded_planes(slot)
    held = {name for texture in renderer.scene.textures for name in texture.maps}
    return tuple(name for name in MAPS if PLANE_OF_MAP[name] in drawn and name in held)


def errors_by_map(
    renderer: Renderer, slot: Slot, progress: Callable[[DecodedMaps], object] = lambda _: None
) -> tuple[MapError, ...]:
    """The error of the last view for each decoded map alone, and last for all of them together.

    Errors of single maps do not add up to that of all: light multiplies some of them. Pictures are drawn whole, one after the other.
    """
    reference = linear_to_srgb8(renderer.picture(Slot())).astype(np.float64)
    covered, textures = renderer.covered(), renderer.texture_ids()
    chosen: Sequence[DecodedMaps] = (*shown_maps(renderer, slot), "all")
    found = []
    for maps in chosen:
        progress(maps)
        shown = linear_to_srgb8(renderer.picture(replace(slot, maps=maps))).astype(np.float64)
        squared = np.where(covered, np.square(shown - reference).mean(axis=2), 0.0)
        error = float(squared.sum() / max(1, covered.sum()))
        seen = textures >= 0
        sums = np.bincount(textures[seen], weights=squared[seen], minlength=len(renderer.scene.textures))
        psnr = finite_or_none(10.0 * np.log10(255.0**2 / error)) if error > 0.0 else None
        found.append(MapError(maps, error, psnr, sums.astype(np.float64), squared.astype(np.float32)))
    return tuple(found)
