"""A studio as an environment: soft boxes in a grey room, whose edges show in metal and gloss. It is computed, not read from a file."""

import hashlib
import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from viewer.lighting.directions import Array, direction_towards, panorama_directions, panorama_solid_angles
from viewer.lighting.panorama import Panorama


@dataclass(frozen=True)
class SoftBox:
    """Lamp with a flat rectangular front that faces the middle of the room. Angles in degrees."""

    azimuth: float
    elevation: float
    half_width: float
    half_height: float
    radiance: tuple[float, float, float]
    """Linear RGB, relative to the other boxes."""


# The first view looks from the south (azimuth 180), a little from above.
BOXES: Final = (
    SoftBox(138.0, 42.0, 24.0, 20.0, (10.0, 9.8, 9.4)),
    SoftBox(222.0, 18.0, 18.0, 30.0, (2.6, 2.8, 3.1)),
    SoftBox(268.0, 22.0, 7.0, 36.0, (7.0, 7.3, 8.0)),
    SoftBox(62.0, 20.0, 6.0, 34.0, (6.5, 6.1, 5.6)),
    SoftBox(180.0, 88.0, 30.0, 16.0, (4.0, 4.0, 4.0)),
)
"""Boxes: key light from the front right, fill from the left, a strip on each side, one box above; none behind the scene."""
ROOM: Final = ((-1.0, 0.16), (-0.15, 0.30), (0.1, 0.42), (1.0, 0.20))
"""Radiance of the room by height, interpolated linearly: (sine of the elevation, radiance)."""
EDGE: Final = 0.12
"""Width of a box's soft edge as a share of its half sides."""
METERED: Final = (165.0, 20.0)
"""Azimuth and elevation in degrees of the exposure meter: a white surface that faces there has radiance 1."""


def _share(directions: Array, box: SoftBox) -> Array:
    """Return [...] the coverage of `directions` [..., 3] by `box`, 0 to 1."""
    centre = np.array(direction_towards(box.azimuth, box.elevation))
    east = np.array(direction_towards(box.azimuth + 90.0, 0.0))
    up = np.cross(east, centre)
    ahead = directions @ centre
    inside = np.where(ahead > 0.0, 1.0, 0.0)
    for side, half in ((east, box.half_width), (up, box.half_height)):
        place = np.abs(directions @ side) / np.maximum(ahead, 1e-6) / math.tan(math.radians(half))
        edge = np.clip((1.0 + EDGE - place) / (2.0 * EDGE), 0.0, 1.0)
        inside = inside * edge * edge * (3.0 - 2.0 * edge)
    return inside


def studio_radiance(height: int = 256) -> NDArray[np.float32]:
    """Return [height, 2 * height, 3] float32 linear RGB radiance, equirectangular, scaled to METERED."""
    directions = panorama_directions(height)
    levels, values = zip(*ROOM, strict=True)
    radiance = np.repeat(np.interp(directions[..., 1], levels, values)[..., None], 3, axis=-1)
    for box in BOXES:
        share = _share(directions, box)[..., None]
        radiance = radiance + (np.array(box.radiance) - radiance) * share
    facing = np.maximum(directions @ np.array(direction_towards(*METERED)), 0.0)
    weights = panorama_solid_angles(height)[:, None] * facing / np.pi
    metered = float(np.einsum("ij,ijk->k", weights, radiance).mean())
    return np.ascontiguousarray(radiance / metered, np.float32)


def studio() -> Panorama:
    """Return the studio as a panorama."""
    radiance = studio_radiance()
    return Panorama(radiance, hashlib.sha256(radiance.tobytes()).hexdigest())
