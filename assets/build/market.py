"""The market: stalls with awnings and goods, crates, barrels, benches."""

import numpy as np

from assets.build.shapes import Model

GOODS = (
    ("terrain_leaves", "floor_terracotta"),
    ("terrain_gravel", "rock_basalt"),
    ("fabric_carpet", "plaster_ochre"),
    ("terrain_sand", "rock_limestone"),
    ("floor_mosaic", "plaster_blue"),
    ("fabric_green_twill", "fabric_burlap"),
    ("terrain_grass", "plaster_rose"),
    ("fabric_red_plaid", "wood_dark"),
)
"""For each compartment of a table what lies there, and the round things on it."""
AWNING = ("fabric_blue_stripes", "fabric_red_plaid", "fabric_burlap", "fabric_green_twill", "fabric_carpet")


def sphere_profile(radius: float, flatten: float = 1.0, steps: int = 9) -> list[tuple[float, float]]:
    """A sphere or spheroid around the origin, for a lathe."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, steps)
    return [(max(0.0, radius * float(np.cos(a))), radius * flatten * float(np.sin(a))) for a in angles]


def _awning_height(z: float) -> float:
    t = (1.35 - z) / 2.5
    return 2.35 + 0.75 * t - 0.25 * float(np.sin(np.pi * t))


def stall() -> Model:
    """A market stall: posts, table, goods in compartments, an awning of strips. It faces +z."""
    model = Model("stall")
    for x in (-1.4, 1.4):
        for z in (-0.9, 0.9):
            top = _awning_height(z)
            model["wood_oak"].lathe((x, 0, z), [(0.06, 0.0), (0.06, top - 0.02), (0.0, top - 0.01)], 0.5, 12)
    model["wood_weathered"].box((-1.5, 0.75, -1.0), (1.5, 0.85, 1.0), 0.9)
    model["fabric_burlap_awning"].quad((-1.46, 0.2, 0.975), (2.92, 0, 0), (0, 0.6, 0), 0.6)
    for number, (heap, piece) in enumerate(GOODS):
        x, height = -1.29 + 0.325 * number, 0.97 + 0.03 * (number % 3)
        model[heap].box((x, 0.85, -0.8), (x + 0.305, height, 0.82), 0.4, skip="-y")
        for row in range(5):
            for column in range(2):
                at = (x + 0.08 + 0.145 * column, height + 0.05, -0.62 + 0.31 * row + 0.05 * column)
                model[piece].lathe(at, sphere_profile(0.068, 0.9), 0.3, 14)
    t = np.linspace(0.0, 1.0, 17)
    y = 2.35 + 0.75 * t - 0.25 * np.sin(np.pi * t)
    depths = 1.35 - 2.5 * t
    for number in range(12):
        x = -1.8 + 0.3 * number
        edges = [np.stack([np.full(t.size, side), y, depths], axis=-1) for side in (x, x + 0.3)]
        uvs = [np.stack([np.full(t.size, u), 3.2 * (1 - t)], axis=-1) for u in (0.0, 0.375)]
        model[f"{AWNING[number % 5]}_awning"].patch(np.stack(edges, axis=1), np.stack(uvs, axis=1))
    return model


def crate() -> Model:
    """A crate of planks with battens in front and behind, and a sign."""
    model = Model("crate")
    model["wood_oak"].box((-0.4, 0, -0.4), (0.4, 0.8, 0.4), 0.8, skip="-y")
    for x in (-0.4, 0.32):
        model["wood_dark"].box((x, 0, 0.4), (x + 0.08, 0.8, 0.43), 0.6, skip="-y-z")
        model["wood_dark"].box((x, 0, -0.43), (x + 0.08, 0.8, -0.4), 0.6, skip="-y+z")
    model["wood_sign"].quad((-0.25, 0.2, 0.406), (0.5, 0, 0), (0, 0.4, 0), 1.0, stretch=True)
    return model


def barrel() -> Model:
    """A barrel with hoops."""
    model = Model("barrel")
    staves = [(0.28, 0.0), (0.34, 0.15), (0.37, 0.32), (0.38, 0.45), (0.37, 0.58), (0.34, 0.75), (0.28, 0.9)]
    model["wood_dark"].lathe((0, 0, 0), [*staves, (0.27, 0.9), (0.26, 0.87), (0.0, 0.87)], 0.6, 24)
    radii, heights = zip(*staves, strict=True)
    for low, high in ((0.07, 0.14), (0.26, 0.33), (0.57, 0.64), (0.76, 0.83)):
        below, above = np.interp([low, high], heights, radii)
        hoop = [(below - 0.01, low), (below + 0.012, low), (above + 0.012, high), (above - 0.01, high)]
        model["metal_rust"].lathe((0, 0, 0), hoop, 0.5, 24)
    return model


def bench() -> Model:
    """A bench of three planks on two stones; its back is at -z."""
    model = Model("bench")
    for z in (-0.21, -0.065, 0.08):
        model["wood_weathered"].box((-0.7, 0.42, z), (0.7, 0.46, z + 0.125), 0.7, turned=True)
    for x in (-0.55, 0.4):
        model["rock_granite"].box((x, 0, -0.17), (x + 0.15, 0.42, 0.17), 0.7, skip="-y")
    return model
