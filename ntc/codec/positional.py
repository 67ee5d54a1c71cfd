"""Positional encoding: triangle waves of the texel coordinate (docs/codec.md, step 3)."""

import numpy as np
from numpy.typing import NDArray

PHASES = (0.0, 0.25)


def triangle_wave(turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Triangle wave of period 1 in [-1, 1]: 1 at 0, -1 at 0.5."""
    return 4.0 * np.abs(turns - np.floor(turns) - 0.5) - 1.0


def positional_encoding(texel_coordinates: NDArray[np.float64], octaves: int) -> NDArray[np.float64]:
    """[N, octaves * 4] of `texel_coordinates` [N, 2]: for each axis, each octave, each phase one wave."""
    waves = [
        triangle_wave(texel_coordinates[:, axis] / 2.0 ** (octave + 1) + phase)
        for axis in range(2)
        for octave in range(octaves)
        for phase in PHASES
    ]
    return np.stack(waves, axis=-1)
