"""The courtyard: 18 m square, four facades, a market, a well, and a wall of samples where many textures meet."""

from collections import defaultdict
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from assets.build.shapes import Point, Shape

HALF = 9.0
"""Half the side of the yard in metres."""
STOREY = 3.0
BAY = 3.0


@dataclass
class Placement:
    """A node that shows a shared object."""

    name: str
    translation: Point
    rotation_y: float = 0.0
    scale: Point = (1.0, 1.0, 1.0)


@dataclass
class Model:
    """An object: shapes by material, and where it stands."""

    name: str
    shapes: defaultdict[str, Shape] = field(default_factory=lambda: defaultdict(Shape))
    placements: list[Placement] = field(default_factory=list)

    def __getitem__(self, material: str) -> Shape:
        return self.shapes[material]


GROUND = (
    ("floor_terracotta", "terrain_grass", "floor_hexagons", "brick_blocks", "terrain_gravel", "concrete_smooth"),
    ("terrain_sand", "floor_mosaic", "concrete_boards", "floor_checker", "terrain_leaves", "rock_limestone"),
    ("rock_slate", "floor_parquet", "terrain_gravel", "floor_terracotta", "brick_dark_clinker", "terrain_mud"),
    ("concrete_dark", "terrain_leaves", "floor_hexagons", "rock_granite", "floor_mosaic", "terrain_grass"),
    ("terrain_mud", "concrete_porous", "floor_checker", "terrain_sand", "metal_tread", "rock_sandstone"),
    ("floor_parquet", "rock_basalt", "terrain_grass", "concrete_stained", "floor_terracotta", "floor_mosaic"),
)
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


def ground() -> Model:
    """The floor of the yard: 36 patches, and a kerb between the middle and the border."""
    model = Model("ground", placements=[Placement("ground", (0, 0, 0))])
    for row, materials in enumerate(GROUND):
        for column, material in enumerate(materials):
            model[material].quad((-HALF + BAY * column, 0, -HALF + BAY * (row + 1)), (BAY, 0, 0), (0, 0, -BAY), 1.5)
    for step in range(6):
        x = -HALF + BAY * step
        model["rock_granite"].box((x + 0.02, 0, -HALF), (x + BAY - 0.02, 0.12, -HALF + 0.35), 1.0, skip="-y-z")
        model["rock_granite"].box((x + 0.02, 0, HALF - 0.35), (x + BAY - 0.02, 0.12, HALF), 1.0, skip="-y+z")
    return model


def facade(name: str, angle: float) -> Model:
    """One side of the yard, built facing +z at z = 0 and x from -9 to 9, then turned and moved into place."""
    model = Model(f"facade_{name}")
    for bay, (lower, upper) in enumerate(FACADES[name]):
        x = -HALF + BAY * bay
        model[lower].quad((x, 0, 0), (BAY, 0, 0), (0, STOREY, 0), 1.5)
        model[upper].quad((x, STOREY, 0), (BAY, 0, 0), (0, STOREY, 0), 1.5)
        model["rock_limestone"].box((x - 0.14, 0, 0), (x + 0.14, 2 * STOREY, 0.16), 1.0, skip="-y-z+y")
        door = bay in (1, 4)
        _opening(
            model,
            x + BAY / 2,
            0.0 if door else 0.9,
            2.2 if door else 1.35,
            "wood_dark" if door else "wood_oak",
            SHUTTERS[bay],
            door,
        )
        _opening(model, x + BAY / 2, STOREY + 0.9, 1.35, "wood_weathered", SHUTTERS[(bay + 2) % 6], False)
    model["rock_limestone"].box((HALF - 0.14, 0, 0), (HALF + 0.14, 2 * STOREY, 0.16), 1.0, skip="-y-z+y")
    model["concrete_smooth"].box((-HALF - 0.2, STOREY - 0.12, 0), (HALF + 0.2, STOREY + 0.12, 0.22), 1.0, skip="-z")
    model["rock_sandstone"].box((-HALF - 0.3, 2 * STOREY, -0.1), (HALF + 0.3, 2 * STOREY + 0.25, 0.45), 1.0)
    model[ROOFS[name]].quad((-HALF - 0.3, 2 * STOREY + 0.25, 0.45), (2 * HALF + 0.6, 0, 0), (0, 1.9, -3.2), 2.0)
    model["roofing_corrugated"].quad(
        (-HALF - 0.3, 2 * STOREY + 2.15, -2.75), (2 * HALF + 0.6, 0, 0), (0, 0.55, -1.1), 1.6
    )
    turn = np.array([np.sin(angle), 0.0, np.cos(angle)])
    at = -HALF * turn
    model.placements = [Placement(f"facade_{name}", (float(at[0]), 0.0, float(at[2])), angle)]
    return model


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
        model[frame].box((edge - 0.05, y, 0.0), (edge + 0.05, y + height, 0.12), 0.6, skip="-z-y")
    model[frame].box(
        (x - half - 0.05, y + height, 0.0), (x + half + 0.05, y + height + 0.1, 0.13), 0.6, skip="-z", turned=True
    )


def sample_wall(textures: list[str]) -> Model:
    """A free-standing wall with a small tile of every texture on both sides: many decoders within one block."""
    model = Model("sample_wall", placements=[Placement("sample_wall", (-3.4, 0.0, -2.6), 0.35)])
    side, gap, columns = 0.25, 0.0, 11
    rows = len(textures) // columns
    width = columns * (side + gap)
    for number, texture in enumerate(textures):
        x = -width / 2 + (number % columns) * side
        y = 0.6 + (rows - 1 - number // columns) * side
        model[texture].quad((x, y, 0.1), (side, 0, 0), (0, side, 0), 0.5)
        back = textures[(number * 7 + 3) % len(textures)]
        model[back].quad((-x, y, -0.1), (-side, 0, 0), (0, side, 0), 0.25)
    top = 0.6 + rows * side
    model["wood_dark"].box((-width / 2 - 0.1, 0, -0.14), (-width / 2, top + 0.1, 0.14), 0.8, skip="-y")
    model["wood_dark"].box((width / 2, 0, -0.14), (width / 2 + 0.1, top + 0.1, 0.14), 0.8, skip="-y")
    model["wood_oak"].box((-width / 2, top, -0.14), (width / 2, top + 0.1, 0.14), 0.8, turned=True)
    model["wood_oak"].box((-width / 2, 0.5, -0.14), (width / 2, 0.6, 0.14), 0.8, turned=True)
    return model


def stall() -> Model:
    """A market stall: posts, table, goods in compartments, an awning of strips. It faces +z."""
    model = Model("stall")
    for x in (-1.4, 1.4):
        for z in (-0.9, 0.9):
            model["wood_oak"].lathe((x, 0, z), [(0.06, 0.0), (0.06, 2.6), (0.0, 2.62)], 0.5, 10)
    model["wood_weathered"].box((-1.5, 0.75, -0.5), (1.5, 0.85, 0.8), 0.9)
    model["fabric_burlap"].quad((-1.5, 0.2, 0.82), (3.0, 0, 0), (0, 0.64, 0), 0.6)
    goods = (
        "terrain_leaves",
        "terrain_gravel",
        "fabric_carpet",
        "terrain_sand",
        "floor_mosaic",
        "fabric_green_twill",
        "terrain_grass",
        "fabric_red_plaid",
    )
    for number, material in enumerate(goods):
        x = -1.45 + 0.3625 * number
        model[material].box((x + 0.01, 0.85, -0.4), (x + 0.35, 0.97 + 0.03 * (number % 3), 0.7), 0.4, skip="-y")
    fabrics = ("fabric_blue_stripes", "fabric_red_plaid", "fabric_burlap", "fabric_green_twill", "fabric_carpet")
    rows = 9
    for number in range(12):
        x = -1.8 + 0.3 * number
        t = np.linspace(0.0, 1.0, rows)
        y, z = 2.35 + 0.75 * t - 0.25 * np.sin(np.pi * t), 1.35 - 2.5 * t
        points = np.stack(
            [np.stack([np.full(rows, x), y, z], -1), np.stack([np.full(rows, x + 0.3), y, z], -1)], axis=1
        )
        uvs = np.stack(
            [np.stack([np.zeros(rows), 3.2 * (1 - t)], -1), np.stack([np.full(rows, 0.375), 3.2 * (1 - t)], -1)], axis=1
        )
        model[f"{fabrics[number % 5]}_awning"].patch(points, uvs)
    return model


def crate() -> Model:
    """A crate of planks."""
    model = Model("crate")
    model["wood_oak"].box((-0.4, 0, -0.4), (0.4, 0.8, 0.4), 0.8, skip="-y")
    for x in (-0.4, 0.34):
        model["wood_dark"].box((x - 0.01, 0, 0.4), (x + 0.07, 0.8, 0.43), 0.6, skip="-y-z")
        model["wood_dark"].box((x - 0.01, 0, -0.43), (x + 0.07, 0.8, -0.4), 0.6, skip="-y+z")
    model["wood_sign"].quad((-0.25, 0.2, 0.402), (0.5, 0, 0), (0, 0.4, 0), 1.0, stretch=True)
    return model


def barrel() -> Model:
    """A barrel with hoops."""
    model = Model("barrel")
    model["wood_dark"].lathe(
        (0, 0, 0), [(0.28, 0), (0.36, 0.25), (0.38, 0.45), (0.36, 0.65), (0.28, 0.9), (0.0, 0.9)], 0.6, 20
    )
    for height, radius in ((0.12, 0.335), (0.7, 0.365)):
        model["metal_rust"].lathe((0, height, 0), [(radius, 0), (radius + 0.01, 0.04), (radius, 0.08)], 0.5, 20)
    return model


def well() -> Model:
    """The well in the middle, weathered by vertex colours."""
    model = Model("well", placements=[Placement("well", (1.2, 0, 0.6))])
    model["brick_blocks_weathered"].lathe((0, 0, 0), [(1.15, 0), (1.1, 0.8)], 1.2, 36)
    model["rock_basalt"].lathe((0, 0, 0), [(1.2, 0.8), (1.2, 0.95), (0.85, 0.95), (0.85, 0.3), (0.0, 0.3)], 1.0, 36)
    for x in (-1.0, 1.0):
        model["wood_weathered"].box((x - 0.08, 0.95, -0.08), (x + 0.08, 2.5, 0.08), 0.6, skip="-y")
    model["wood_dark"].box((-1.1, 2.3, -0.06), (1.1, 2.42, 0.06), 0.6, turned=True)
    for z in (-1, 1):
        left, right = (-1.3, 1.3) if z > 0 else (1.3, -1.3)
        model["roofing_shingles"].quad((left, 2.35, 0.95 * z), (right - left, 0, 0), (0, 0.75, -0.95 * z), 1.2)
        model["wood_oak_two_sided"].quad((right, 2.34, 0.94 * z), (left - right, 0, 0), (0, 0.75, -0.94 * z), 0.8)
    return model


def planter() -> Model:
    """A bed of soil in a stone trough."""
    model = Model("planter")
    model["concrete_porous"].box((-0.9, 0, -0.35), (0.9, 0.55, 0.35), 0.9, skip="-y+y")
    model["terrain_mud"].quad((-0.9, 0.5, 0.35), (1.8, 0, 0), (0, 0, -0.7), 0.6)
    for x in (-0.6, -0.2, 0.2, 0.6):
        model["terrain_grass"].lathe((x, 0.5, 0), [(0.16, 0), (0.24, 0.2), (0.2, 0.42), (0.0, 0.5)], 0.4, 12)
    return model


def signs() -> Model:
    """Enamel and wooden signs on poles, and aerial photographs on a board; clamped, so their borders stay clean."""
    model = Model("signs", placements=[Placement("signs", (0, 0, 0))])
    for number, (x, z) in enumerate(((-6.6, 3.2), (5.6, -5.4))):
        model["metal_plates"].lathe((x, 0, z), [(0.05, 0), (0.05, 2.6), (0, 2.62)], 0.4, 10)
        for y, material in ((2.0, "metal_sign"), (1.3, "wood_sign_clamped")):
            model[material].quad((x - 0.5, y, z + 0.07), (1.0, 0, 0), (0, 0.55, 0), 1.0, stretch=True)
            model["metal_tread"].quad((x + 0.5, y, z + 0.05), (-1.0, 0, 0), (0, 0.55, 0), 0.5)
        del number
    aerials = ("aerial_fields", "aerial_desert", "aerial_forest", "aerial_suburb", "aerial_marsh")
    for number, material in enumerate(aerials):
        model[material].quad((3.0 + 1.05 * number - 0.9, 0.9, -8.3), (1.0, 0, 0), (0, 1.0, 0), 1.0, stretch=True)
    model["wood_weathered"].box((2.0, 0.8, -8.42), (7.45, 2.0, -8.32), 0.8)
    for x in (2.2, 7.2):
        model["wood_dark"].box((x - 0.06, 0, -8.44), (x + 0.06, 0.8, -8.3), 0.6, skip="-y+y")
    return model


def fences() -> Model:
    """Wrought lattices around the tree bed, and a tree of bark and leaves."""
    model = Model("fences", placements=[Placement("fences", (-5.6, 0, -6.0))])
    for x, z, dx, dz in ((-1.0, 1.0, 1, 0), (1.0, 1.0, 0, -1), (1.0, -1.0, -1, 0), (-1.0, -1.0, 0, 1)):
        for step in range(2):
            model["metal_lattice"].quad((x + dx * step, 0.05, z + dz * step), (dx, 0, dz), (0, 1.0, 0), 1.0)
    model["terrain_leaves"].quad((-1.0, 0.02, 1.0), (2, 0, 0), (0, 0, -2), 1.0)
    model["rock_slate"].lathe((0, 0, 0), [(0.3, 0), (0.2, 0.5), (0.17, 2.4), (0.0, 2.6)], 0.8, 14)
    for x, y, z, r in ((0, 2.9, 0, 1.0), (0.7, 2.6, 0.3, 0.7), (-0.6, 2.5, -0.4, 0.75), (0.1, 3.6, -0.2, 0.7)):
        t = np.linspace(-np.pi / 2, np.pi / 2, 10)
        model["terrain_grass"].lathe(
            (x, y, z), [(max(0.0, r * float(np.cos(a))), r * 0.8 * float(np.sin(a))) for a in t], 0.7, 20
        )
    return model


def carpet(textures: list[str]) -> Model:
    """A patchwork carpet on the ground: patches of an eighth of a metre."""
    model = Model("carpet", placements=[Placement("carpet", (0.6, 0.015, 5.2), -0.2)])
    side, count = 0.16, 14
    for row in range(count):
        for column in range(count):
            texture = textures[(row * 17 + column * 5 + row * column) % len(textures)]
            model[texture].quad(
                (side * (column - count / 2), 0, side * (count / 2 - row)), (side, 0, 0), (0, 0, -side), 0.4
            )
    model["fabric_burlap"].quad(
        (-side * count / 2 - 0.1, -0.005, side * count / 2 + 0.1),
        (side * count + 0.2, 0, 0),
        (0, 0, -side * count - 0.2),
        0.5,
    )
    return model


def models(textures: list[str]) -> list[Model]:
    """Everything in the yard. `textures` are the names of the 55 textures."""
    stalls, crates, barrels, planters = stall(), crate(), barrel(), planter()
    stalls.placements = [
        Placement("stall_east", (5.2, 0, 2.2), -np.pi / 2),
        # Mirrored, so that the two stalls are not copies of one another.
        Placement("stall_south", (-3.0, 0, 6.2), np.pi, (-1.0, 1.0, 1.0)),
    ]
    crates.placements = [
        Placement("crate_1", (3.0, 0, 4.6), 0.3),
        Placement("crate_2", (3.9, 0, 5.0), -0.2),
        Placement("crate_3", (3.4, 0.8, 4.8), 0.7, (0.8, 0.8, 0.8)),
        Placement("crate_4", (-6.9, 0, 0.6), 1.2),
    ]
    barrels.placements = [
        Placement(f"barrel_{i + 1}", at)
        for i, at in enumerate(((6.9, 0, -1.2), (7.3, 0, -0.4), (6.5, 0, -0.45), (-1.0, 0, -5.6)))
    ]
    planters.placements = [
        Placement(f"planter_{i + 1}", at, turn)
        for i, (at, turn) in enumerate((((-7.9, 0, 3.5), np.pi / 2), ((7.9, 0, 5.6), np.pi / 2), ((0.4, 0, -7.9), 0.0)))
    ]
    sides = (("north", 0.0), ("west", np.pi / 2), ("south", np.pi), ("east", -np.pi / 2))
    fixed = [
        ground(),
        *(facade(name, angle) for name, angle in sides),
        sample_wall(textures),
        well(),
        signs(),
        fences(),
        carpet(textures),
    ]
    return [*fixed, stalls, crates, barrels, planters]


def cameras() -> list[dict[str, Any]]:
    """Named viewpoints: the first is the one that is shown first."""
    return [
        {"name": "entrance", "eye": [-7.2, 1.9, 7.6], "target": [1.2, 1.5, -2.2], "fov": 60.0},
        {"name": "market", "eye": [0.8, 1.7, 2.6], "target": [6.4, 1.3, 2.2], "fov": 65.0},
        {"name": "samples", "eye": [-2.4, 1.45, 1.0], "target": [-3.4, 1.2, -2.6], "fov": 50.0},
        {"name": "grazing", "eye": [-8.2, 0.7, -0.4], "target": [4.0, 0.4, -0.9], "fov": 55.0},
        {"name": "carpet", "eye": [0.4, 2.2, 7.6], "target": [0.7, 0.0, 4.6], "fov": 60.0},
        {"name": "signs", "eye": [3.6, 1.7, -4.4], "target": [4.9, 1.5, -8.3], "fov": 60.0},
        {"name": "roofs", "eye": [8.0, 7.5, 8.0], "target": [-2.0, 3.4, -5.0], "fov": 60.0},
        {"name": "overview", "eye": [-7.0, 12.5, 13.0], "target": [0.0, 0.5, -0.5], "fov": 60.0},
    ]
