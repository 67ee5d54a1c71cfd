"""A clear sky and its sun, after Preetham, Shirley and Smits 1999, "A Practical Analytic Model for Daylight".

The model gives luminance (Y) and chromaticity (x, y) of the sky by direction. Each is its value at the zenith times F(theta, gamma) /
F(0, theta_sun), with Perez's F = (1 + a exp(b / cos theta)) (1 + c exp(d gamma) + e cos^2 gamma); theta is the angle from the zenith,
gamma that from the sun. The coefficients a to e and the zenith's values are polynomials in turbidity (appendix A.2). Radiance is
relative: 1 is about that of a white surface at noon, UNIT_LUMINANCE in the model's units.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from viewer.lighting.directions import Array, direction_towards, panorama_directions, panorama_solid_angles
from viewer.state.view_state import SKY, Lighting

UNIT_LUMINANCE: Final = 25.0
"""Luminance of radiance 1 in kcd/m2."""
TURBIDITY: Final = 4.0
"""Haze of the atmosphere: 2 is very clear, 6 is hazy."""
SUN_RADIUS: Final = math.radians(0.2666)
"""Radius of the sun's disk as an angle in radians."""
SUN_ILLUMINANCE: Final = 128.0
"""Illuminance of the sun above the atmosphere in klx."""
GROUND: Final = (0.20, 0.18, 0.155)
"""Linear albedo of the ground below the horizon."""
HORIZON_BLEND: Final = 0.02
"""Sine of the elevation, above and below the horizon, up to which ground and sky are blended."""
TWILIGHT_DEGREES: Final = 1.0
"""Angle in degrees below the horizon over which the sky's light halves."""

_LUMINANCE = ((0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703))
_CHROMA_X = ((-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452))
_CHROMA_Y = ((-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529))
# Rows: factors of turbidity squared, turbidity, 1; columns: of the sun's zenith angle to the powers 3 to 0.
_ZENITH_X = (
    (0.00166, -0.00375, 0.00209, 0.0),
    (-0.02903, 0.06377, -0.03202, 0.00394),
    (0.11693, -0.21196, 0.06052, 0.25886),
)
_ZENITH_Y = (
    (0.00275, -0.00610, 0.00317, 0.0),
    (-0.04214, 0.08970, -0.04153, 0.00516),
    (0.15346, -0.26756, 0.06670, 0.26688),
)
_XYZ_TO_SRGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
_WAVELENGTHS = np.array([0.615, 0.545, 0.465])
"""Wavelengths in micrometres at which the sun's red, green and blue are computed."""


def _perez(coefficients: tuple[tuple[float, float], ...], cosine: Array, gamma: Array) -> Array:
    a, b, c, d, e = (slope * TURBIDITY + offset for slope, offset in coefficients)
    result: Array = (1.0 + a * np.exp(b / cosine)) * (1.0 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2)
    return result


def _zenith_chroma(table: tuple[tuple[float, ...], ...], angle: float) -> float:
    powers = np.array([angle**3, angle**2, angle, 1.0])
    return float(np.array([TURBIDITY**2, TURBIDITY, 1.0]) @ np.array(table) @ powers)


def twilight(elevation: float) -> float:
    """Return the share of the sky's light, 1 by day, when the sun's elevation is `elevation` degrees."""
    return float(max(2.0 ** (min(elevation, 0.0) / TWILIGHT_DEGREES), 1e-4))


def _upper_half(directions: Array, elevation: float) -> Array:
    """Return the radiance [..., 3] of the sky in `directions` [..., 3], with the sun in the north.

    Directions below the horizon have the radiance at the horizon.
    """
    angle = math.radians(90.0 - max(elevation, 0.0))
    sun = np.array(direction_towards(0.0, max(elevation, 0.0)))
    # The model has a pole at the horizon.
    cosine = np.maximum(directions[..., 1], 0.01)
    gamma = np.arccos(np.clip(directions @ sun, -1.0, 1.0))
    chi = (4.0 / 9.0 - TURBIDITY / 120.0) * (np.pi - 2.0 * angle)
    zenith = (
        (4.0453 * TURBIDITY - 4.9710) * math.tan(chi) - 0.2155 * TURBIDITY + 2.4192,
        _zenith_chroma(_ZENITH_X, angle),
        _zenith_chroma(_ZENITH_Y, angle),
    )
    luminance, x, y = (
        value * _perez(coefficients, cosine, gamma) / _perez(coefficients, np.array(1.0), np.array(angle))
        for value, coefficients in zip(zenith, (_LUMINANCE, _CHROMA_X, _CHROMA_Y), strict=True)
    )
    xyz = np.stack([x / y, np.ones_like(x), (1.0 - x - y) / y], axis=-1) * luminance[..., None]
    radiance: Array = np.maximum(xyz @ _XYZ_TO_SRGB.T, 0.0) * (twilight(elevation) / UNIT_LUMINANCE)
    return radiance


def sun_irradiance(elevation: float) -> tuple[float, float, float]:
    """Return the linear RGB irradiance of a surface that faces the sun, whose centre is `elevation` degrees above the horizon.

    Rayleigh scattering and aerosols attenuate the light (Preetham et al., appendix A.1). The part of the disk below the horizon gives
    no light.
    """
    radius = math.degrees(SUN_RADIUS)
    visible = min(max((elevation + radius) / (2.0 * radius), 0.0), 1.0)
    if visible == 0.0:
        return 0.0, 0.0, 0.0
    above = max(elevation, 0.0)
    air_mass = 1.0 / (math.sin(math.radians(above)) + 0.15 * (above + 3.885) ** -1.253)
    rayleigh = 0.008735 * _WAVELENGTHS**-4.08
    aerosols = (0.04608 * TURBIDITY - 0.04586) * _WAVELENGTHS**-1.3
    light = visible * SUN_ILLUMINANCE / UNIT_LUMINANCE * np.exp(-(rayleigh + aerosols) * air_mass)
    red, green, blue = light.tolist()
    return red, green, blue


def sky_radiance(elevation: float, height: int = 128, azimuth: float = 0.0) -> NDArray[np.float32]:
    """Return [height, 2 * height, 3] float32 linear RGB radiance of sky and ground without the sun's disk, equirectangular.

    `elevation`, `azimuth`: the sun's place in degrees; azimuth 0 is north, the middle column.
    """
    directions = panorama_directions(height)
    if azimuth:
        # The sky of another azimuth is the same sky, turned.
        directions = np.roll(directions, round(azimuth / 180.0 * height), axis=1)
    sky = _upper_half(directions, elevation)
    up = directions[..., 1]
    weights = panorama_solid_angles(height)[:, None] * np.maximum(up, 0.0)
    irradiance = np.einsum("ij,ijk->k", weights, sky)
    irradiance += np.array(sun_irradiance(elevation)) * max(math.sin(math.radians(elevation)), 0.0)
    ground = np.array(GROUND) / np.pi * irradiance
    share = np.clip(up / HORIZON_BLEND * 0.5 + 0.5, 0.0, 1.0)[..., None]
    return np.ascontiguousarray(ground + (sky - ground) * share, np.float32)


Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Sun:
    """Sun as a directional light."""

    direction: Triple
    """Unit vector towards the sun, world space."""
    irradiance: Triple
    """Linear RGB irradiance of a surface that faces the sun; 0 below the horizon."""

    @property
    def shines(self) -> bool:
        """True where the sun's irradiance is above 0."""
        return max(self.irradiance) > 0.0


def sun_of(lighting: Lighting) -> Sun:
    """Return the sun of a view. It also lights scenes before a panorama: `sun_strength` 0 turns it off where the panorama has one."""
    red, green, blue = (value * lighting.sun_strength for value in sun_irradiance(lighting.sun_elevation))
    return Sun(direction_towards(lighting.sun_azimuth, lighting.sun_elevation), (red, green, blue))


def environment_turn(lighting: Lighting) -> float:
    """Return the turn of the environment in degrees from north towards east. Skies are computed with their sun in the north."""
    return lighting.sun_azimuth if lighting.environment == SKY else lighting.environment_turn
