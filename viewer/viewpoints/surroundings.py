"""The nearest opaque surfaces along the axes: whether a place is underground, in a wall or on a roof."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
HIGH_UP = 4.0
"""A place with another ground this many eye heights below it counts as a roof."""


def value_range(values: Array) -> tuple[Array, Array]:
    """[T] minimum and maximum over the corners of each triangle, of `values` [3, T]."""
    return np.minimum(np.minimum(*values[:2]), values[2]), np.maximum(np.maximum(*values[:2]), values[2])


def crossings(corners: Array, axis: int) -> tuple[Array, NDArray[np.bool_]]:
    """(positions, facing along the axis) of the crossings of triangles [T, 3, 3] with an axis."""
    p, q = corners[:, :, (axis + 1) % 3], corners[:, :, (axis + 2) % 3]
    # Twice the areas that the origin makes with each side, seen along the axis: all of one sign inside.
    areas = p * np.roll(q, -1, axis=1) - q * np.roll(p, -1, axis=1)
    whole = areas.sum(axis=1)
    inside = ((areas >= 0.0).all(axis=1) | (areas <= 0.0).all(axis=1)) & (whole != 0.0)
    # Side i is opposite to corner i + 2.
    shares = np.roll(areas[inside], -1, axis=1) / whole[inside, None]
    return (shares * corners[inside, :, axis]).sum(axis=1), whole[inside] > 0.0


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The nearest opaque surfaces of places [N] along each axis: [3, 2, N], first forwards, then backwards."""

    distance: Array
    """To the surface; infinite without one."""
    back: NDArray[np.bool_]
    """Whether its back faces the place."""
    double_sided: NDArray[np.bool_]
    """Whether its back is drawn."""
    high_up: NDArray[np.bool_]
    """[N] whether another ground lies more than HIGH_UP eye heights below."""

    @staticmethod
    def nothing(count: int) -> "Surroundings":
        """`count` places without surfaces."""
        flags = np.zeros((3, 2, count), bool)
        return Surroundings(np.full((3, 2, count), np.inf), flags, flags.copy(), np.zeros(count, bool))

    def add(
        self, axis: int, index: int, offsets: Array, along: NDArray[np.bool_], double_sided: bool, height: float
    ) -> None:
        """Add surfaces at `offsets` [M] along `axis` from place `index`; `along` [M] is whether each faces along the axis."""
        if axis == 1:
            self.high_up[index] |= bool((along & (offsets < -HIGH_UP * height)).any())
        for side, (distances, backs) in enumerate(((offsets, along), (-offsets, ~along))):
            ahead = np.where(distances > 0.0, distances, np.inf)
            if len(ahead) and ahead.min() < self.distance[axis, side, index]:
                nearest = int(np.argmin(ahead))
                self.distance[axis, side, index] = ahead[nearest]
                self.back[axis, side, index] = backs[nearest]
                self.double_sided[axis, side, index] = double_sided

    def buried(self) -> NDArray[np.bool_]:
        """[N] whether the place is under the ground or inside of something."""
        above, below = np.isfinite(self.distance[1])
        unseen = (self.back & ~self.double_sided)[1].any(axis=0)
        return np.asarray(unseen | self.back[1].all(axis=0) | (above & ~below))

    def behind_walls(self) -> NDArray[np.bool_]:
        """[N] whether it is behind a wall whose back is not drawn, so that the camera looks through it."""
        return np.asarray((self.back & ~self.double_sided)[[0, 2]].any(axis=(0, 1)))

    def on_top(self) -> NDArray[np.bool_]:
        """[N] whether it is on a roof: nothing above, and another ground far below."""
        return np.asarray(self.high_up & self.open_sky())

    def open_sky(self) -> NDArray[np.bool_]:
        """[N] whether nothing is above."""
        return np.asarray(~np.isfinite(self.distance[1, 0]))
