"""The courtyard: 18 m square, four houses, a loggia, a market, a well, and a wall of samples where many textures meet."""

from typing import Any

import numpy as np

from assets.build.furniture import carpet, fences, planter, sample_wall, signs, well
from assets.build.houses import BAY, HALF, facade
from assets.build.loggia import baluster, loggia
from assets.build.market import barrel, bench, crate, stall
from assets.build.shapes import Model, Placement

GROUND = (
    ("floor_terracotta", "terrain_grass", "floor_hexagons", "brick_blocks", "terrain_gravel", "concrete_smooth"),
    ("terrain_sand", "floor_mosaic", "concrete_boards", "floor_checker", "terrain_leaves", "rock_limestone"),
    ("rock_slate", "floor_parquet", "terrain_gravel", "floor_terracotta", "brick_dark_clinker", "terrain_mud"),
    ("concrete_dark", "terrain_leaves", "floor_hexagons", "rock_granite", "floor_mosaic", "terrain_grass"),
    ("terrain_mud", "concrete_porous", "floor_checker", "terrain_sand", "metal_tread", "rock_sandstone"),
    ("floor_parquet", "rock_basalt", "terrain_grass", "concrete_stained", "floor_terracotta", "floor_mosaic"),
)


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


def models(textures: list[str]) -> list[Model]:
    """Everything in the yard. `textures` are the names of the 55 textures."""
    stalls, crates, barrels, planters, benches = stall(), crate(), barrel(), planter(), bench()
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
        for i, (at, turn) in enumerate(
            (((-7.9, 0, 3.5), np.pi / 2), ((7.9, 0, 5.6), np.pi / 2), ((-1.5, 0, -8.1), 0.0))
        )
    ]
    benches.placements = [
        Placement(f"bench_{i + 1}", at, turn)
        for i, (at, turn) in enumerate(
            (((-8.4, 0, -1.75), np.pi / 2), ((0.0, 0, 8.3), np.pi), ((8.5, 0, -7.5), -np.pi / 2))
        )
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
    return [*fixed, stalls, crates, barrels, planters, benches, loggia(), baluster()]


def cameras() -> list[dict[str, Any]]:
    """Named viewpoints: the first is the one that is shown first."""
    return [
        {"name": "entrance", "eye": [-7.2, 1.9, 7.6], "target": [1.2, 1.5, -2.2], "fov": 60.0},
        {"name": "market", "eye": [0.8, 1.7, 2.6], "target": [6.4, 1.3, 2.2], "fov": 65.0},
        {"name": "samples", "eye": [-2.4, 1.45, 1.0], "target": [-3.4, 1.2, -2.6], "fov": 50.0},
        {"name": "grazing", "eye": [-8.2, 0.7, -0.4], "target": [4.0, 0.4, -0.9], "fov": 55.0},
        {"name": "carpet", "eye": [0.4, 2.2, 7.6], "target": [0.7, 0.0, 4.6], "fov": 60.0},
        {"name": "signs", "eye": [1.6, 1.7, -5.0], "target": [4.4, 1.6, -8.6], "fov": 60.0},
        {"name": "roofs", "eye": [8.0, 7.5, 8.0], "target": [-2.0, 3.4, -5.0], "fov": 60.0},
        {"name": "overview", "eye": [-7.0, 12.5, 13.0], "target": [0.0, 0.5, -0.5], "fov": 60.0},
    ]
