"""What stands in the yard: the wall of samples, the well, planters, signs, the tree, the patchwork carpet."""

from assets.build.market import sphere_profile
from assets.build.shapes import Model, Placement

AERIALS = ("aerial_fields", "aerial_desert", "aerial_forest", "aerial_suburb", "aerial_marsh")


def sample_wall(textures: list[str]) -> Model:
    """A free-standing wall with a small tile of every texture on both sides: many decoders within one block."""
    model = Model("sample_wall", placements=[Placement("sample_wall", (-3.4, 0.0, -2.6), 0.35)])
    side, columns = 0.25, 11
    rows = len(textures) // columns
    edge = columns * side / 2
    for number, texture in enumerate(textures):
        x = -edge + (number % columns) * side
        y = 0.6 + (rows - 1 - number // columns) * side
        model[texture].quad((x, y, 0.1), (side, 0, 0), (0, side, 0), 0.5)
        back = textures[(number * 7 + 3) % len(textures)]
        model[back].quad((-x, y, -0.1), (-side, 0, 0), (0, side, 0), 0.25)
    top = 0.6 + rows * side
    # What shows through the holes of the lattice.
    model["concrete_dark"].box((-edge, 0.6, -0.07), (edge, top, 0.07), 1.0, skip="-x+x-y+y")
    for x in (-edge - 0.1, edge):
        model["wood_dark"].box((x, 0, -0.14), (x + 0.1, top + 0.1, 0.14), 0.8, skip="-y")
    for y in (0.5, top):
        model["wood_oak"].box((-edge, y, -0.13), (edge, y + 0.1, 0.13), 0.8, skip="-x+x", turned=True)
    return model


def well() -> Model:
    """The well in the middle, weathered by vertex colours."""
    model = Model("well", placements=[Placement("well", (1.2, 0, 0.6))])
    model["brick_blocks_weathered"].lathe((0, 0, 0), [(1.15, 0), (1.13, 0.3), (1.11, 0.6), (1.1, 0.8)], 1.2, 48)
    rim = [(1.1, 0.8), (1.2, 0.8), (1.2, 0.95), (0.85, 0.95), (0.85, 0.3), (0.0, 0.3)]
    model["rock_basalt"].lathe((0, 0, 0), rim, 1.0, 48)
    for x in (-1.0, 1.0):
        model["wood_weathered"].box((x - 0.08, 0.95, -0.08), (x + 0.08, 3.0, 0.08), 0.6, skip="-y")
    model["wood_dark"].box((-1.1, 2.3, -0.06), (1.1, 2.42, 0.06), 0.6, turned=True)
    for z in (-1, 1):
        left, right = (-1.3, 1.3) if z > 0 else (1.3, -1.3)
        model["roofing_shingles"].quad((left, 2.35, 0.95 * z), (right - left, 0, 0), (0, 0.75, -0.95 * z), 1.2)
        model["wood_oak_two_sided"].quad((right, 2.34, 0.94 * z), (left - right, 0, 0), (0, 0.75, -0.94 * z), 0.8)
    return model


def planter() -> Model:
    """A bed of soil with bushes in a stone trough."""
    model = Model("planter")
    trough = model["concrete_porous"]
    trough.box((-0.9, 0, 0.29), (0.9, 0.55, 0.35), 0.9, skip="-y")
    trough.box((-0.9, 0, -0.35), (0.9, 0.55, -0.29), 0.9, skip="-y")
    trough.box((-0.9, 0, -0.29), (-0.84, 0.55, 0.29), 0.9, skip="-y-z+z")
    trough.box((0.84, 0, -0.29), (0.9, 0.55, 0.29), 0.9, skip="-y-z+z")
    model["terrain_mud"].quad((-0.84, 0.5, 0.29), (1.68, 0, 0), (0, 0, -0.58), 0.6)
    for x in (-0.6, -0.2, 0.2, 0.6):
        bush = [(0.14, 0.0), (0.21, 0.12), (0.24, 0.22), (0.2, 0.42), (0.1, 0.49), (0.0, 0.5)]
        model["terrain_grass"].lathe((x, 0.5, 0), bush, 0.4, 16)
    return model


def signs() -> Model:
    """Enamel and wooden signs on poles, and aerial photographs on a wall; clamped, so their borders stay clean."""
    model = Model("signs", placements=[Placement("signs", (0, 0, 0))])
    for x, z in ((-6.6, 3.2), (5.6, -5.4)):
        model["metal_plates"].lathe((x, 0, z), [(0.05, 0), (0.05, 2.6), (0, 2.62)], 0.4, 12)
        for y, material in ((2.0, "metal_sign"), (1.3, "wood_sign_clamped")):
            model["metal_tread"].box((x - 0.5, y, z + 0.045), (x + 0.5, y + 0.55, z + 0.07), 0.5, skip="+z")
            model[material].quad((x - 0.5, y, z + 0.07), (1.0, 0, 0), (0, 0.55, 0), 1.0, stretch=True)
    model["wood_weathered"].box((-0.1, 0.8, -8.84), (6.1, 2.0, -8.78), 0.8, turned=True)
    for number, material in enumerate(AERIALS):
        model[material].quad((0.26 + 1.12 * number, 0.9, -8.765), (1.0, 0, 0), (0, 1.0, 0), 1.0, stretch=True)
    return model


def fences() -> Model:
    """Wrought lattices around the tree bed, and a tree of bark and leaves."""
    model = Model("fences", placements=[Placement("fences", (-5.6, 0, -6.0))])
    for x, z, dx, dz in ((-1.0, 1.0, 1, 0), (1.0, 1.0, 0, -1), (1.0, -1.0, -1, 0), (-1.0, -1.0, 0, 1)):
        for step in range(2):
            at = (x + dx * step, 0.0, z + dz * step)
            model["metal_lattice"].quad(at, (dx, 0, dz), (0, 1.0, 0), 1.0)
            model["metal_plates"].lathe(at, [(0.035, 0.0), (0.035, 1.05), (0.05, 1.08), (0.0, 1.14)], 0.4, 10)
    model["terrain_leaves"].box((-0.97, 0.0, -0.97), (0.97, 0.03, 0.97), 1.0, skip="-y")
    model["rock_slate"].lathe((0, 0, 0), [(0.3, 0), (0.2, 0.5), (0.17, 2.4), (0.0, 2.6)], 0.8, 16)
    for x, y, z, radius in ((0, 2.9, 0, 1.0), (0.7, 2.6, 0.3, 0.7), (-0.6, 2.5, -0.4, 0.75), (0.1, 3.6, -0.2, 0.7)):
        model["terrain_grass"].lathe((x, y, z), sphere_profile(radius, 0.8, 13), 0.7, 28)
    return model


def carpet(textures: list[str]) -> Model:
    """A patchwork carpet on the ground: patches of a sixth of a metre."""
    model = Model("carpet", placements=[Placement("carpet", (0.6, 0.0, 5.2), -0.2)])
    side, count = 0.16, 14
    for row in range(count):
        for column in range(count):
            texture = textures[(row * 17 + column * 5 + row * column) % len(textures)]
            corner = (side * (column - count / 2), 0.022, side * (count / 2 - row))
            model[texture].quad(corner, (side, 0, 0), (0, 0, -side), 0.4)
    edge = side * count / 2
    model["fabric_burlap"].box((-edge - 0.1, 0.0, -edge - 0.1), (edge + 0.1, 0.015, edge + 0.1), 0.5, skip="-y")
    return model
