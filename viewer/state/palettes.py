"""Colours of the divergence map, and of other maps that run from little to much."""

from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

PaletteName = Literal["green-red", "viridis"]

PALETTES: Final[dict[PaletteName, tuple[tuple[float, float, float], ...]]] = {
    "green-red": ((0.0, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 0.0, 0.0)),
    "viridis": (
        (0.2670, 0.0049, 0.3294),
        (0.2759, 0.1669, 0.4689),
        (0.2298, 0.3224, 0.5457),
        (0.1727, 0.4488, 0.5579),
        (0.1276, 0.5669, 0.5506),
        (0.1579, 0.6838, 0.5017),
        (0.3692, 0.7889, 0.3829),
        (0.6783, 0.8637, 0.1895),
        (0.9932, 0.9062, 0.1439),
    ),
}
"""Colours in sRGB at equal distances from one decoder to the most. `green-red` has the colours of the paper's Fig. 1;
`viridis` (S. van der Walt and N. Smith, CC0) also tells them apart for the colour-blind, by brightness alone."""


def palette_colors(name: PaletteName, shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return [..., 3] sRGB in [0, 1] for `shares` of the way from one decoder (0) to the most (1)."""
    points = np.array(PALETTES[name])
    places = np.linspace(0.0, 1.0, len(points))
    return np.stack([np.interp(shares, places, points[:, channel]) for channel in range(3)], axis=-1)


def share_of_most(decoders: float, most: int) -> float:
    """Return the place of a number of decoders between one (0) and the most (1)."""
    return min(max((decoders - 1.0) / max(most - 1.0, 1.0), 0.0), 1.0)
