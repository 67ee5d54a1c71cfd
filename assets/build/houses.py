"""The four houses around the yard: facades, openings, hipped roofs, outer walls."""

import numpy as np

from assets.build.shapes import Model, Placement

HALF = 9.0
"""Half the side of the yard in metres."""
STOREY = 3.0
BAY = 3.0
EAVES = 2 * STOREY + 0.25
RIDGE = EAVES + 1.9
EAVES_OUT, RIDGE_BACK, WALL_BACK = 0.45, 2.75, 5.95
"""How far the eaves reach into the yard, the ridge lies behind the facade, and the outer wall."""
FACADES = {
    "north": (
        ("brick_red", "plaster_ochre"),
        ("rock_sandstone", "plaster_rose"),
        ("brick_yellow", "plaster_white"),
        ("concrete_boards", "brick_red"),
        ("rock_limestone", "plaster_blue"),
        ("brick_painted_white", "plaster_green"),
    ),
    "east": (
        ("brick_dark_clinker", "plaster_white"),
        ("concrete_porous", "brick_yellow"),
        ("rock_granite", "plaster_ochre"),
        ("brick_blocks", "concrete_smooth"),
        ("plaster_green", "wood_weathered"),
        ("rock_slate", "plaster_rose"),
    ),
    "south": (
        ("concrete_stained", "plaster_blue"),
        ("brick_red", "wood_oak"),
        ("rock_basalt", "plaster_white"),
        ("plaster_ochre", "brick_painted_white"),
        ("metal_plates", "concrete_dark"),
        ("brick_yellow", "plaster_rose"),
    ),
    "west": (
        ("rock_limestone", "brick_dark_clinker"),
        ("plaster_blue", "plaster_ochre"),
        ("wood_painted_teal", "concrete_boards"),
        ("rock_sandstone", "plaster_green"),
        ("brick_blocks", "metal_rust"),
        ("plaster_rose", "brick_red"),
    ),
}
ROOFS = {"north": "roofing_clay", "east": "roofing_slate", "south": "roofing_shingles", "west": "roofing_thatch"}
SHUTTERS = ("wood_painted_teal", "wood_dark", "wood_weathered", "metal_rust", "wood_oak", "metal_lattice_solid")
DOORS = {"north": (1,), "east": (1, 4), "south": (1, 4), "west": (1, 4)}
BLIND = {"north": (3, 4), "east": (), "south": (), "west": ()}
"""Bays of the ground floor without door or window: the gallery of aerial photographs hangs there."""
OUTER_WALLS = {"north": "concrete_stained", "east": "brick_yellow", "south": "plaster_white", "west": "brick_blocks"}


def facade(name: str, angle: float) -> Model:
    """One house, built with its facade facing +z at z = 0 and x from -9 to 9, then turned and moved into place."""
    model = Model(f"facade_{name}")
    for bay, (lower, upper) in enumerate(FACADES[name]):
        x = -HALF + BAY * bay
        model[lower].quad((x, 0, 0), (BAY, 0, 0), (0, STOREY, 0), 1.5)
        model[upper].quad((x, STOREY, 0), (BAY, 0, 0), (0, STOREY, 0), 1.5)
        model["rock_limestone"].box((x - 0.14, 0, 0), (x + 0.14, 2 * STOREY, 0.16), 1.0, skip="-y-z+y")
        if bay in DOORS[name]:
            _opening(model, x + BAY / 2, 0.0, 2.2, "wood_dark", SHUTTERS[bay], True)
        elif bay not in BLIND[name]:
            _opening(model, x + BAY / 2, 0.9, 1.35, "wood_oak", SHUTTERS[bay], False)
        _opening(model, x + BAY / 2, STOREY + 0.9, 1.35, "wood_weathered", SHUTTERS[(bay + 2) % 6], False)
    model["rock_limestone"].box((HALF - 0.14, 0, 0), (HALF + 0.14, 2 * STOREY, 0.16), 1.0, skip="-y-z+y")
    # In the corners the mouldings of two sides butt, so that no two faces share a plane.
    whole = name in ("north", "south")
    ends = "" if whole else "-x+x"
    x = HALF if whole else HALF - 0.22
    model["concrete_smooth"].box((-x, STOREY - 0.12, 0), (x, STOREY + 0.12, 0.22), 1.0, skip="-z" + ends)
    x = HALF + 0.1 if whole else HALF - EAVES_OUT
    model["rock_sandstone"].box((-x, 2 * STOREY, -0.1), (x, EAVES, EAVES_OUT), 1.0, skip=ends)
    _roof(model, name, whole)
    turn = np.array([np.sin(angle), 0.0, np.cos(angle)])
    at = -HALF * turn
    model.placements = [Placement(f"facade_{name}", (float(at[0]), 0.0, float(at[2])), angle)]
    return model


def _roof(model: Model, name: str, whole: bool) -> None:
    """Two slopes, mitred at 45 degrees towards the neighbours, a ridge and the outer wall."""
    slopes = ((ROOFS[name], 1.0, -EAVES_OUT, 2.0), ("roofing_corrugated", -1.0, WALL_BACK, 1.6))
    length = float(np.hypot(RIDGE - EAVES, WALL_BACK - RIDGE_BACK))
    for material, side, foot, metres in slopes:
        low, high = side * (HALF + foot), side * (HALF + RIDGE_BACK)
        points = [
            [(-low, EAVES, -foot), (low, EAVES, -foot)],
            [(-high, RIDGE, -RIDGE_BACK), (high, RIDGE, -RIDGE_BACK)],
        ]
        uvs = [[(-abs(low), length), (abs(low), length)], [(-abs(high), 0.0), (abs(high), 0.0)]]
        model[material].patch(np.array(points), np.array(uvs) / metres)
    x = HALF + RIDGE_BACK + (0.08 if whole else -0.08)
    model["floor_terracotta"].box(
        (-x, RIDGE - 0.06, -RIDGE_BACK - 0.08),
        (x, RIDGE + 0.07, -RIDGE_BACK + 0.08),
        1.0,
        skip="-y" + ("" if whole else "-x+x"),
    )
    x = HALF + WALL_BACK
    model[OUTER_WALLS[name]].quad((x, 0, -WALL_BACK), (-2 * x, 0, 0), (0, EAVES, 0), 2.0)


def _opening(model: Model, x: float, y: float, height: float, frame: str, shutter: str, door: bool) -> None:
    """A window with shutters and sill, or a door with a lintel."""
    half = 0.55 if door else 0.45
    if door:
        model[frame].box((x - half, y, 0), (x + half, y + height, 0.06), 0.9, skip="-y-z")
        model["metal_plates"].box((x - half, y, 0.06), (x + half, y + 0.28, 0.075), 0.5, skip="-y-z")
    else:
        model["glass"].quad((x - half, y, 0.03), (2 * half, 0, 0), (0, height, 0), 1.0)
        model["rock_limestone"].box((x - half - 0.12, y - 0.12, 0), (x + half + 0.12, y, 0.2), 0.8, skip="-z")
        for side in (-1, 1):
            inner, outer = x + side * half, x + side * (half + 0.42)
            model[shutter].box((min(inner, outer), y, 0.02), (max(inner, outer), y + height, 0.09), 0.7, skip="-z")
        model[frame].box((x - 0.03, y, 0.03), (x + 0.03, y + height, 0.07), 0.6, skip="-z-y+y")
        model[frame].box(
            (x - half, y + height / 2 - 0.03, 0.03),
            (x + half, y + height / 2 + 0.03, 0.068),
            0.6,
            skip="-z",
            turned=True,
        )
    for side in (-1, 1):
        edge = x + side * half
        model[frame].box((edge - 0.05, y, 0.0), (edge + 0.05, y + height, 0.12), 0.6, skip="-z-y+y")
    model[frame].box(
        (x - half - 0.05, y + height, 0.0), (x + half + 0.05, y + height + 0.1, 0.13), 0.6, skip="-z", turned=True
    )
