"""Where the sun of a view stands, what it gives, and how far its environment is turned."""

from dataclasses import dataclass

from viewer.lighting.directions import direction_towards
from viewer.lighting.sky import sun_irradiance
from viewer.state.view_state import SKY, Lighting

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Sun:
    """A light so far away that it shines along one direction."""

    direction: Triple
    """Unit vector towards it, world space."""
    irradiance: Triple
    """Linear RGB irradiance of a surface that faces it; 0 below the horizon."""

    @property
    def shines(self) -> bool:
        """Whether it gives any light."""
        return max(self.irradiance) > 0.0


def sun_of(lighting: Lighting) -> Sun:
    """The sun of a view. It stands before a panorama, too: `sun_strength` 0 leaves it out there, for panoramas with their own."""
    red, green, blue = (value * lighting.sun_strength for value in sun_irradiance(lighting.sun_elevation))
    return Sun(direction_towards(lighting.sun_azimuth, lighting.sun_elevation), (red, green, blue))


def environment_turn(lighting: Lighting) -> float:
    """Degrees that the environment is turned by, from north towards east: skies are made with their sun in the north."""
    return lighting.sun_azimuth if lighting.environment == SKY else lighting.environment_turn
