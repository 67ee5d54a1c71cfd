"""A loggia before the east house: columns, arches, a balcony with a balustrade."""

import numpy as np

from assets.build.shapes import Model, Placement, Vector

FRONT, BACK, HOUSE = 7.15, 7.45, 9.0
"""Along x: the two faces of the arcade, and the wall of the house."""
COLUMNS = (-3.55, -5.45, -7.35)
PITCH, RADIUS = 1.9, 0.77
SPRING, TOP, FLOOR = 1.9, 2.9, 3.05


def loggia() -> Model:
    """Columns at three places; the last arch runs into the wall of the north house."""
    model = Model("loggia", placements=[Placement("loggia", (0, 0, 0))])
    for z in COLUMNS:
        column = [(0.22, 0), (0.22, 0.08), (0.18, 0.14), (0.15, 0.18), (0.14, 1.0), (0.13, 1.68), (0.16, 1.72)]
        capital = [(0.15, 1.76), (0.21, 1.84), (0.22, SPRING), (0.0, SPRING)]
        model["rock_limestone"].lathe(((FRONT + BACK) / 2, 0, z), [*column, *capital], 0.9, 24)
        _arch(model, z - PITCH / 2)
    model["plaster_white"].box((FRONT, SPRING, COLUMNS[0]), (BACK, TOP, -3.3), 1.5, skip="+y-z")
    model["rock_sandstone"].box((FRONT - 0.06, TOP, -9.0), (HOUSE, FLOOR, -3.2), 1.0, skip="+x-z")
    rail = FLOOR + 0.7
    model["wood_dark"].box((7.18, rail, -9.0), (7.34, rail + 0.08, -3.24), 0.6, skip="-z")
    model["wood_dark"].box((7.34, rail, -3.4), (HOUSE, rail + 0.08, -3.24), 0.6, skip="-x+x", turned=True)
    return model


def _arch(model: Model, centre: float) -> None:
    """The wall above one opening, with a half circle cut out of it."""
    angle = np.linspace(np.pi, 0.0, 17)
    z = centre + np.concatenate([[-PITCH / 2], RADIUS * np.cos(angle), [PITCH / 2]])
    y = SPRING + np.concatenate([[0.0], RADIUS * np.sin(angle), [0.0]])

    def line(x: float, heights: Vector) -> Vector:
        return np.stack([np.full(z.size, x), heights, z], axis=-1)

    top = np.full(z.size, TOP)
    uvs = np.stack([np.stack([z, TOP - y], axis=-1), np.stack([z, TOP - top], axis=-1)]) / 1.5
    wall = model["plaster_white"]
    wall.patch(np.stack([line(FRONT, y), line(FRONT, top)]), uvs)
    wall.patch(np.stack([line(BACK, y), line(BACK, top)])[:, ::-1], uvs[:, ::-1])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(y), np.diff(z)))])
    across = [np.stack([along, np.full(z.size, width)], axis=-1) for width in (0.0, BACK - FRONT)]
    model["brick_red"].patch(np.stack([line(BACK, y), line(FRONT, y)]), np.stack(across)[::-1] / 1.0)


def baluster() -> Model:
    """One baluster, shown many times along the two edges of the balcony."""
    model = Model("baluster")
    profile = [
        (0.05, 0),
        (0.05, 0.05),
        (0.03, 0.08),
        (0.058, 0.24),
        (0.045, 0.36),
        (0.026, 0.5),
        (0.05, 0.63),
        (0.05, 0.7),
    ]
    model["rock_limestone"].lathe((0, 0, 0), profile, 0.4, 12)
    front = [(7.26, FLOOR, -8.7 + 0.18 * step) for step in range(31)]
    side = [(7.44 + 0.18 * step, FLOOR, -3.32) for step in range(8)]
    model.placements = [Placement(f"baluster_{number + 1}", at) for number, at in enumerate([*front, *side])]
    return model
