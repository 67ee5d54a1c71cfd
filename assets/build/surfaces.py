"""The surfaces of the courtyard's materials: heights, roughness, metalness and emission of the same patterns as their colours.

Each function takes the seed and the layout of its namesake in `materials`, so that bumps lie where the colours show them.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assets.build.patterns import (
    SIZE,
    Plane,
    cells,
    coordinates,
    courses,
    floor_pieces,
    fractal,
    glyphs,
    gradient_noise,
    per_cell,
    smooth,
    warped,
)


@dataclass(frozen=True, eq=False)
class Surface:
    """A material besides its colour: arrays [SIZE, SIZE]."""

    height: Plane
    """In texels."""
    roughness: Plane
    """0 to 1, as all others."""
    metalness: Plane | None = None
    emission: Plane | None = None
    """Share of `EMISSION` that the surface glows with."""


EMISSION = (1.0, 0.86, 0.55)
"""sRGB: warm white."""
Maker = Callable[[], Surface]


def blurred(plane: Plane, times: int) -> Plane:
    """`plane` averaged with its neighbours again and again, periodic."""
    for _ in range(times):
        for axis in (0, 1):
            plane = (np.roll(plane, 1, axis) + 2 * plane + np.roll(plane, -1, axis)) / 4
    return plane


def aerial(seed: int, fields: int, gloss: float) -> Surface:
    """A relief map: parcels at their own heights, hedges and trees stand out, printed on coated paper."""
    warp_x, warp_y = 10 * fractal(seed, 4), 10 * fractal(seed + 1, 4)
    _, border, number = cells(seed, fields, jitter=0.95)
    border, number = warped(border, warp_x, warp_y), warped(number.astype(float), warp_x, warp_y).astype(int)
    hedge = 1 - smooth(0.02, 0.09, border + 0.01 * fractal(seed + 6, 32))
    trees = smooth(1.1, 1.5, fractal(seed + 7, 24, 3)) * (per_cell(seed + 8, number) > 0)
    height = 2.0 * hedge + 3.0 * trees + 1.2 * fractal(seed + 5, 8, 3)
    return Surface(blurred(height, 1), gloss + 0.1 * per_cell(seed, number) + 0.25 * np.maximum(hedge, trees))


def brick(seed: int, columns: int, rows: int, joint_texels: float, roughness: float, shift: float = 0.5) -> Surface:
    """Bricks with rounded edges, each a little tilted, before mortar."""
    joint, number, fx, fy = courses(columns, rows, shift)
    chipped = joint + 1.2 * fractal(seed, 48, 2) + 0.8 * fractal(seed + 1, 16)
    body = smooth(joint_texels - 1.5, joint_texels + 2.5, chipped)
    tilt = 2.0 * per_cell(seed + 7, number) * (fx - 0.5) + 1.5 * per_cell(seed + 8, number) * (fy - 0.5)
    height = body * (3.5 + tilt + 0.5 * fractal(seed + 2, 24, 2)) + 0.3 * (1 - body) * fractal(seed + 4, 32, 2)
    own = roughness + 0.06 * fractal(seed + 2, 24, 2) + 0.06 * per_cell(seed + 9, number)
    return Surface(height, 0.95 + (own - 0.95) * body)


def concrete(seed: int, boards: int, pores: float, roughness: float) -> Surface:
    """Concrete: gentle waves, air pores, the steps of the formwork; stains are smoother."""
    height = 1.5 * fractal(seed, 4, 4, 0.6)
    nearest, _, number = cells(seed + 2, 40)
    size = 0.10 + 0.16 * (0.5 + 0.5 * per_cell(seed, number))
    height = height - 3.0 * (1 - smooth(0.3, 1, nearest / size)) * (per_cell(seed + 3, number) < pores)
    if boards:
        _, v = coordinates()
        edge = np.abs(v * boards - np.rint(v * boards)) * SIZE / boards
        height = height - 1.6 * (1 - smooth(0.6, 2.6, edge)) + 0.4 * fractal(seed + 5, 2, 5, rows=64)
    return Surface(height, roughness - 0.15 * smooth(0.5, 2.0, fractal(seed + 1, 12, 4, rows=2)))


def fabric(seed: int, threads: int, twill: int, roughness: float) -> Surface:
    """Woven cloth: threads over and under each other."""
    u, v = coordinates()
    column, row = np.floor(u * threads).astype(int), np.floor(v * threads).astype(int)
    over = (column + row) % twill < max(1, twill // 2)
    rounding = np.where(over, np.sin(np.pi * (u * threads - column)), np.sin(np.pi * (v * threads - row)))
    height = 0.25 * SIZE / threads * rounding + 0.6 * fractal(seed + 2, 4, 3)
    return Surface(height, roughness + 0.03 * fractal(seed + 2, 4, 3) - 0.06 * rounding)


def floor(seed: int, kind: str, count: int, roughness: float) -> Surface:
    """Tiles, slabs, hexagons, parquet or mosaic with lower joints, trodden smoother in places."""
    u, v = coordinates()
    distance, number = floor_pieces(seed, kind, count)
    joined = distance + 0.4 * fractal(seed + 6, 48, 3)
    body = smooth(0.8, 3.6, joined)
    tilt = per_cell(seed + 11, number) * (u * count % 1 - 0.5) + per_cell(seed + 12, number) * (v * count % 1 - 0.5)
    worn = fractal(seed + 9, 3, 4)
    height = body * (2.2 + 0.8 * tilt) + 0.35 * fractal(seed + 3, 8, 3)
    own = roughness + 0.05 * worn + 0.05 * per_cell(seed + 13, number)
    return Surface(height, 0.92 + (own - 0.92) * body)


def metal(seed: int, rust: float, kind: str) -> Surface:
    """Brushed, plated or painted metal: rust is rough, stands off, and is no metal; neither is paint."""
    u, v = coordinates()
    brushed = gradient_noise(seed + 1, 4, 128)
    height = 0.5 * fractal(seed, 3, 4)
    roughness = 0.32 + 0.06 * brushed + 0.05 * fractal(seed, 3, 4)
    metalness = np.ones((SIZE, SIZE))
    emission = None
    if kind == "plates":
        joint, number, fx, fy = courses(4, 4, 0.0)
        rivets = np.minimum.reduce([np.hypot(fx - x, fy - y) for x in (0.1, 0.5, 0.9) for y in (0.1, 0.9)])
        dome = np.sqrt(np.clip(1 - (rivets / 0.04) ** 2, 0, 1))
        height = height - 2.0 * (1 - smooth(0.5, 3.0, joint)) + 4.0 * dome
        roughness = roughness + 0.08 * per_cell(seed, number)
    if kind == "tread":
        x, y = (u * 16) % 1 - 0.5, (v * 16) % 1 - 0.5
        turned = (np.floor(u * 16) + np.floor(v * 16)) % 2 == 0
        a, b = np.where(turned, x + y, x - y), np.where(turned, x - y, x + y)
        raised = 1 - smooth(0.7, 1.1, np.hypot(a / 0.55, b / 0.16))
        height, roughness = height + 3.0 * raised, roughness - 0.1 * raised
    if kind == "sign":
        enamel = ((np.abs(v - 0.5) < 0.36) & (np.abs(u - 0.5) < 0.45)).astype(float)
        ink = glyphs(seed, 9, 5) * (np.abs(v - 0.5) < 0.3) * (np.abs(u - 0.5) < 0.4)
        height = height + 1.2 * blurred(enamel, 2) + 1.0 * blurred(ink, 1)
        roughness, metalness = np.where(enamel > 0, 0.2, roughness), 1 - enamel
        emission = ink
    if kind == "painted":
        paint = smooth(-0.9, -0.6, fractal(seed + 8, 5, 6))
        height = height + 0.8 * blurred(paint, 1)
        roughness, metalness = roughness + (0.45 - roughness) * paint, 1 - paint
    spots = smooth(1.6 - 2.2 * rust, 2.2 - 2.0 * rust, fractal(seed + 3, 6, 7, 0.65))
    height = height + spots * (0.8 + 0.5 * fractal(seed + 4, 24, 3))
    roughness = roughness + (0.88 + 0.04 * fractal(seed + 4, 24, 2) - roughness) * spots
    if emission is not None:
        emission = emission * (1 - spots)
    return Surface(height, roughness, metalness * (1 - spots), emission)


def plaster(seed: int, loss: float, strokes: int, roughness: float) -> Surface:
    """Painted plaster: trowel strokes, lower where it flaked off, hair cracks."""
    field = fractal(seed + 4, 4, 7, 0.6)
    lost = smooth(1.98 - 1.6 * loss, 2.08 - 1.6 * loss, field)
    height = 0.8 * fractal(seed, 3, 4, 0.6) + 0.9 * fractal(seed + 1, strokes, 2, rows=max(2, strokes // 4))
    _, border, _ = cells(seed + 5, 5)
    crack = 1 - smooth(0.004, 0.02, warped(border, 14 * fractal(seed + 6, 12), 14 * fractal(seed + 7, 12)))
    height = height - 1.5 * crack * smooth(-0.2, 0.8, fractal(seed + 8, 3))
    height = height * (1 - lost) + lost * (-3.5 + 0.8 * fractal(seed + 2, 24, 3))
    return Surface(blurred(height, 1), roughness + (0.95 - roughness) * lost + 0.03 * fractal(seed + 1, strokes, 2))


def rock(seed: int, strata: float, cracks: int, roughness: float) -> Surface:
    """Rock: layers bent by folds, deep cracks; lichen is rough."""
    _, v = coordinates()
    bend = 0.10 * gradient_noise(seed, 2) + 0.05 * gradient_noise(seed + 1, 5)
    layers = np.sin(2 * np.pi * (6 * (v + bend))) + 0.6 * np.sin(2 * np.pi * (17 * (v + bend)))
    _, border, number = cells(seed + 3, cracks)
    jag = 9 * fractal(seed + 4, 16)
    crack = 1 - smooth(0.005, 0.07, warped(border, jag, -jag))
    height = 1.6 * strata * layers + 2.6 * fractal(seed + 2, 4, 5, 0.6) - 5.0 * crack
    lichen = smooth(1.5, 1.9, fractal(seed + 5, 14, 5, 0.7))
    own = roughness + 0.05 * fractal(seed + 2, 4, 4) + 0.06 * warped(per_cell(seed, number), jag, -jag)
    return Surface(blurred(height + 0.8 * lichen, 1), own + (0.95 - own) * np.maximum(lichen, crack))


def roofing(seed: int, kind: str, columns: int, rows: int, roughness: float) -> Surface:
    """Tiles, shingles, slates, corrugated sheet or thatch, each row over the one below."""
    u, v = coordinates()
    if kind == "thatch":
        straw = fractal(seed, 128, 1, rows=6) + 0.7 * fractal(seed + 1, 64, 2, rows=8)
        step = (v * rows + 0.04 * fractal(seed + 2, 24)) % 1
        return Surface(1.2 * straw + 6.0 * step, roughness + 0.04 * straw)
    if kind == "corrugated":
        sheet = metal(seed, 0.55, "plain")
        return Surface(sheet.height + 4.5 * np.sin(2 * np.pi * u * columns), sheet.roughness, sheet.metalness)
    _, number, fx, fy = courses(columns, rows, 0.5)
    height = 0.14 * SIZE / rows * fy + 0.4 * fractal(seed + 2, 20, 3)
    if kind == "clay":
        height = height + 0.2 * SIZE / columns * np.sin(np.pi * fx)
    else:
        height = height + 1.2 * per_cell(seed + 5, number) * (fx - 0.5) + 0.5 * gradient_noise(seed, columns * 8, rows)
    gap = 1 - smooth(0.5, 2.5, np.minimum(fx, 1 - fx) * SIZE / columns)
    moss = smooth(1.0, 1.7, fractal(seed + 3, 7, 6))
    own = roughness + 0.05 * per_cell(seed + 6, number) + 0.04 * fractal(seed + 2, 20, 2)
    return Surface(blurred(height - 3.0 * gap + 0.8 * moss, 1), own + (0.95 - own) * moss)


def terrain(seed: int, kind: str, roughness: float) -> Surface:
    """Grass, sand, gravel, mud or fallen leaves."""
    if kind in ("gravel", "leaves"):
        height = np.zeros((SIZE, SIZE))
        for layer, count in enumerate((22, 34)):
            nearest, border, number = cells(seed + layer * 7, count, jitter=1.0)
            jag = 4 * fractal(seed + layer + 20, 24)
            border, nearest = warped(border, jag, jag), warped(nearest, jag, jag)
            number = warped(number.astype(float), jag, jag).astype(int)
            body = smooth(0.05, 0.25, border) * (per_cell(seed + layer + 3, number) > -0.25 + 0.4 * layer)
            ribs = 0.4 * np.sin(60 * nearest) if kind == "leaves" else 0.0 * nearest
            lift = 2.5 + (4.0 if kind == "gravel" else 1.0) * (0.7 - nearest) + ribs
            height = np.where(body > 0, height * (1 - body) + body * (lift + 1.5 * layer), height)
        return Surface(blurred(height, 1), roughness + 0.05 * fractal(seed, 16, 2))
    if kind == "grass":
        blades = np.zeros((SIZE, SIZE))
        for layer in range(6):
            lean = 6 * gradient_noise(seed + layer, 12)
            noise = gradient_noise(seed + 30 + layer, 128, 20 + 4 * layer)
            blades = np.maximum(blades, warped(noise, lean, lean) + 0.1 * layer)
        return Surface(blurred(4.0 * blades, 1), roughness - 0.1 * blades)
    _, v = coordinates()
    ripples = np.sin(2 * np.pi * (22 * v + 0.9 * gradient_noise(seed, 3) + 0.35 * gradient_noise(seed + 1, 9)))
    if kind == "sand":
        return Surface(2.4 * ripples + 0.6 * fractal(seed + 2, 5, 5), roughness + 0.03 * fractal(seed + 2, 5, 4))
    _, border, _ = cells(seed + 3, 9)
    clod = smooth(0.005, 0.1, warped(border, 5 * fractal(seed + 4, 20), 5 * fractal(seed + 5, 20)))
    wet = smooth(0.2, 1.2, fractal(seed + 2, 5, 5))
    return Surface(blurred(3.0 * clod + 0.8 * fractal(seed + 2, 5, 5), 1), roughness - 0.55 * wet * clod)


def wood(seed: int, planks: int, roughness: float, painted: bool = False, signs: bool = False) -> Surface:
    """Planks with raised rings and gaps between them; paint is smooth where it is left."""
    u, v = coordinates()
    plank = np.floor(u * planks).astype(int)
    x = (u * planks - plank - 0.5) * 2
    centre = 0.8 * per_cell(seed, plank)
    sway = 0.35 * gradient_noise(seed + 1, planks, 3) + 0.12 * gradient_noise(seed + 2, planks * 2, 6)
    knot = np.hypot(x - 0.5 * per_cell(seed + 3, plank), (((v + 0.5 * per_cell(seed + 4, plank)) % 1) - 0.5) * 7)
    rings = np.abs(x - centre + sway) * 9 + 2.2 * np.exp(-knot * 2.4)
    grooves = np.sin(2 * np.pi * rings)
    height = 0.55 * grooves + 0.5 * fractal(seed + 5, 64, 2, rows=6) + 1.5 * per_cell(seed + 6, plank) * (planks > 1)
    height = height + 1.2 * np.exp(-((knot / 0.32) ** 2))
    own = roughness + 0.06 * grooves + 0.04 * fractal(seed + 5, 64, 2, rows=6)
    if painted:
        worn = smooth(0.9, 1.3, fractal(seed + 8, 8, 6, rows=3) + 0.5 * gradient_noise(seed + 9, 128, 12))
        height, own = 0.4 * height * (1 - worn) + 0.8 * (1 - worn) + height * worn, 0.4 + (own - 0.4) * worn
    if signs:
        ink = blurred(glyphs(seed, 7, 4), 1)
        height, own = height - 1.5 * ink, own + 0.15 * ink
    gap = np.minimum(u * planks - plank, 1 - (u * planks - plank)) * SIZE / planks
    if planks > 1:
        height = height - 4.0 * (1 - smooth(0.4, 2.6, gap))
    return Surface(height, own)


def surfaces() -> dict[str, Maker]:
    """By name of a texture: its surface."""
    return {
        "aerial_fields": lambda: aerial(11, 7, 0.45),
        "aerial_desert": lambda: aerial(12, 4, 0.5),
        "aerial_forest": lambda: aerial(13, 9, 0.5),
        "aerial_suburb": lambda: aerial(14, 14, 0.4),
        "aerial_marsh": lambda: aerial(15, 6, 0.3),
        "brick_red": lambda: brick(21, 8, 16, 2.2, 0.82),
        "brick_yellow": lambda: brick(22, 6, 18, 2.0, 0.8),
        "brick_painted_white": lambda: brick(23, 8, 20, 1.6, 0.55),
        "brick_dark_clinker": lambda: brick(24, 10, 20, 1.8, 0.42, 0.25),
        "brick_blocks": lambda: brick(25, 4, 8, 3.0, 0.85),
        "concrete_boards": lambda: concrete(31, 8, 0.1, 0.82),
        "concrete_smooth": lambda: concrete(32, 0, 0.0, 0.6),
        "concrete_porous": lambda: concrete(33, 0, 0.7, 0.9),
        "concrete_dark": lambda: concrete(34, 3, 0.3, 0.75),
        "concrete_stained": lambda: concrete(35, 0, 0.3, 0.85),
        "fabric_red_plaid": lambda: fabric(41, 128, 4, 0.9),
        "fabric_blue_stripes": lambda: fabric(42, 96, 2, 0.85),
        "fabric_burlap": lambda: fabric(43, 64, 2, 0.92),
        "fabric_green_twill": lambda: fabric(44, 128, 4, 0.88),
        "fabric_carpet": lambda: fabric(45, 80, 3, 0.92),
        "floor_terracotta": lambda: floor(51, "tiles", 6, 0.6),
        "floor_checker": lambda: floor(52, "checker", 8, 0.18),
        "floor_hexagons": lambda: floor(53, "hexagons", 12, 0.3),
        "floor_parquet": lambda: floor(54, "parquet", 6, 0.4),
        "floor_mosaic": lambda: floor(55, "mosaic", 36, 0.25),
        "metal_rust": lambda: metal(61, 0.85, "plain"),
        "metal_plates": lambda: metal(62, 0.35, "plates"),
        "metal_tread": lambda: metal(63, 0.25, "tread"),
        "metal_sign": lambda: metal(64, 0.3, "sign"),
        "metal_lattice": lambda: metal(65, 0.45, "painted"),
        "plaster_ochre": lambda: plaster(71, 0.45, 24, 0.8),
        "plaster_rose": lambda: plaster(72, 0.6, 12, 0.75),
        "plaster_white": lambda: plaster(73, 0.3, 40, 0.7),
        "plaster_blue": lambda: plaster(74, 0.7, 16, 0.78),
        "plaster_green": lambda: plaster(75, 0.5, 8, 0.72),
        "rock_sandstone": lambda: rock(81, 1.6, 3, 0.85),
        "rock_granite": lambda: rock(82, 0.0, 2, 0.5),
        "rock_slate": lambda: rock(83, 2.2, 6, 0.55),
        "rock_limestone": lambda: rock(84, 0.6, 5, 0.8),
        "rock_basalt": lambda: rock(85, 0.2, 8, 0.6),
        "roofing_clay": lambda: roofing(91, "clay", 12, 10, 0.75),
        "roofing_slate": lambda: roofing(92, "slate", 10, 12, 0.45),
        "roofing_shingles": lambda: roofing(93, "slate", 14, 14, 0.8),
        "roofing_corrugated": lambda: roofing(94, "corrugated", 20, 2, 0.4),
        "roofing_thatch": lambda: roofing(95, "thatch", 1, 4, 0.9),
        "terrain_grass": lambda: terrain(101, "grass", 0.85),
        "terrain_sand": lambda: terrain(102, "sand", 0.9),
        "terrain_gravel": lambda: terrain(103, "gravel", 0.8),
        "terrain_mud": lambda: terrain(104, "mud", 0.75),
        "terrain_leaves": lambda: terrain(105, "leaves", 0.7),
        "wood_oak": lambda: wood(111, 4, 0.6),
        "wood_weathered": lambda: wood(112, 6, 0.85),
        "wood_painted_teal": lambda: wood(113, 5, 0.75, painted=True),
        "wood_dark": lambda: wood(114, 3, 0.45),
        "wood_sign": lambda: wood(115, 1, 0.5, signs=True),
    }


def normal_image(height: Plane) -> NDArray[np.uint8]:
    """[SIZE, SIZE, 3] normals of `height` in texels: red to the right, green up the picture (glTF 2.0, Sec. 3.9.3)."""
    height = blurred(height, 2)
    right = (np.roll(height, -1, 1) - np.roll(height, 1, 1)) / 2
    down = (np.roll(height, -1, 0) - np.roll(height, 1, 0)) / 2
    normals = np.stack([-right, down, np.ones_like(height)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.rint(normals * 127.5 + 127.5).astype(np.uint8)


def occlusion(height: Plane) -> Plane:
    """How much of the sky a point of `height` sees, by how far it lies below its surroundings, near and far."""
    near, far = blurred(height, 3), blurred(height, 24)
    return np.clip(1.08 - 0.28 * np.maximum(near - height, 0) - 0.14 * np.maximum(far - height, 0), 0.15, 1)


def _steps(values: Plane, step: int) -> NDArray[np.uint8]:
    """8-bit values in multiples of `step`, the last of which is 255: files stay small."""
    levels = 255 // step
    return np.rint(np.rint(np.clip(values, 0, 1) * levels) * (255 / levels)).astype(np.uint8)


def packed_image(surface: Surface) -> NDArray[np.uint8]:
    """[SIZE, SIZE, 3]: occlusion, roughness, metalness."""
    metalness = np.zeros((SIZE, SIZE)) if surface.metalness is None else surface.metalness
    shadow = _steps(occlusion(surface.height), 15)
    return np.stack([shadow, _steps(np.clip(surface.roughness, 0.08, 1), 15), _steps(metalness, 51)], axis=-1)


def emission_image(surface: Surface) -> NDArray[np.uint8] | None:
    """[SIZE, SIZE, 3] sRGB, None where nothing glows."""
    if surface.emission is None:
        return None
    return np.rint(np.clip(surface.emission, 0, 1)[..., None] * np.array(EMISSION) * 255).astype(np.uint8)
