"""The materials of the courtyard: five textures in each of the paper's eleven categories. All values are sRGB-coded, in [0, 1]."""

from collections.abc import Callable, Sequence
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
    grain,
    per_cell,
    smooth,
    warped,
)

Image = NDArray[np.float64]
"""[SIZE, SIZE, 3]."""
Color = tuple[float, float, float]


@dataclass(frozen=True)
class TextureRecipe:
    """A texture to make."""

    name: str
    category: str
    make: Callable[[], Image]
    cutout: Callable[[], Plane] | None = None
    """Coverage in [0, 1], where the texture has holes."""


def _hex(color: str) -> Color:
    return int(color[0:2], 16) / 255, int(color[2:4], 16) / 255, int(color[4:6], 16) / 255


def _flat(color: str) -> Image:
    return np.broadcast_to(np.array(_hex(color)), (SIZE, SIZE, 3)).copy()


def _mix(a: Image, b: Image, share: Plane) -> Image:
    return a * (1 - share[..., None]) + b * share[..., None]


def _ramp(values: Plane, colors: Sequence[str]) -> Image:
    """Colours along `values` in [0, 1]."""
    table = np.array([_hex(color) for color in colors])
    at = np.clip(values, 0, 1) * (len(table) - 1)
    return np.stack([np.interp(at, np.arange(len(table)), table[:, channel]) for channel in range(3)], axis=-1)


def _shade(image: Image, amount: Plane) -> Image:
    return image * (1 + amount[..., None])


def _unit(values: Plane) -> Plane:
    return np.clip(0.5 + 0.25 * values, 0, 1)


def aerial(seed: int, colors: Sequence[str], fields: int, lines: str) -> Image:
    """Fields seen from above: parcels, furrows, hedges or roads between them."""
    warp_x, warp_y = 10 * fractal(seed, 4), 10 * fractal(seed + 1, 4)
    _, border, number = cells(seed, fields, jitter=0.95)
    border, number = warped(border, warp_x, warp_y), warped(number.astype(float), warp_x, warp_y).astype(int)
    image = _ramp(0.5 + 0.5 * per_cell(seed, number), colors)
    u, v = coordinates()
    angle = np.pi * per_cell(seed + 3, number)
    furrows = np.sin(2 * np.pi * 48 * (np.cos(angle) * u + np.sin(angle) * v))
    image = _shade(
        image,
        0.07 * furrows * (per_cell(seed + 4, number) > -0.3) + 0.09 * fractal(seed + 5, 8, 6) + 0.06 * grain(seed),
    )
    image = _mix(image, _flat(lines), 0.9 * (1 - smooth(0.02, 0.07, border + 0.01 * fractal(seed + 6, 32))))
    trees = smooth(1.1, 1.5, fractal(seed + 7, 24, 3)) * (per_cell(seed + 8, number) > 0)
    return _mix(image, _flat("2c3b20"), 0.8 * trees)


def brick(
    seed: int, columns: int, rows: int, colors: Sequence[str], mortar: str, joint_texels: float, shift: float = 0.5
) -> Image:
    """Bricks in courses, each of its own colour, chipped at the edges, with mortar between them."""
    joint, number, _, fy = courses(columns, rows, shift)
    rough = joint + 1.2 * fractal(seed, 48, 3) + 0.8 * fractal(seed + 1, 16)
    image = _ramp(0.5 + 0.5 * per_cell(seed, number), colors)
    image = _shade(image, 0.10 * fractal(seed + 2, 24, 5) + 0.07 * grain(seed) + 0.06 * (0.5 - fy))
    image = _mix(image, _flat("e8e2d8"), 0.35 * smooth(1.2, 2.2, fractal(seed + 3, 6, 6)))
    ground = _shade(_flat(mortar), 0.08 * fractal(seed + 4, 32, 4) + 0.08 * grain(seed + 5))
    return _mix(image, ground, 1 - smooth(joint_texels - 1, joint_texels + 1, rough))


def concrete(seed: int, color: str, stain: str, boards: int, pores: float) -> Image:
    """Concrete: clouds, run-off stains, air pores, traces of the formwork."""
    image = _shade(_flat(color), 0.07 * fractal(seed, 4, 7, 0.6) + 0.04 * grain(seed))
    image = _mix(image, _flat(stain), 0.45 * smooth(0.5, 2.0, fractal(seed + 1, 12, 4, rows=2)))
    nearest, _, number = cells(seed + 2, 40)
    size = 0.10 + 0.16 * (0.5 + 0.5 * per_cell(seed, number))
    image = _shade(image, -0.45 * (1 - smooth(0.5, 1, nearest / size)) * (per_cell(seed + 3, number) < pores))
    if boards:
        _, v = coordinates()
        edge = np.abs(v * boards - np.rint(v * boards)) * SIZE / boards
        image = _shade(image, -0.25 * (1 - smooth(0.6, 2.2, edge)))
        image = _shade(
            image, 0.05 * per_cell(seed + 4, np.floor(v * boards).astype(int)) + 0.03 * fractal(seed + 5, 2, 6, rows=64)
        )
    return image


def fabric(seed: int, warp_colors: Sequence[str], weft_colors: Sequence[str], threads: int, twill: int) -> Image:
    """Woven cloth: coloured threads over and under each other."""
    u, v = coordinates()
    column, row = np.floor(u * threads).astype(int), np.floor(v * threads).astype(int)
    fu, fv = u * threads - column, v * threads - row
    over = (column + row) % twill < max(1, twill // 2)
    band = max(1, threads // (2 * len(warp_colors) * 2))
    warp_table = np.array([_hex(color) for color in warp_colors])
    weft_table = np.array([_hex(color) for color in weft_colors])
    warp = warp_table[(column // band) % len(warp_table)]
    weft = weft_table[(row // band) % len(weft_table)]
    image = np.where(over[..., None], warp, weft)
    rounding = np.where(over, np.sin(np.pi * fu), np.sin(np.pi * fv))
    fibre = np.where(over, gradient_noise(seed, 256, 32), gradient_noise(seed + 1, 32, 256))
    return _shade(image, -0.30 + 0.42 * rounding + 0.10 * fibre + 0.05 * grain(seed) + 0.05 * fractal(seed + 2, 4))


def floor(seed: int, kind: str, colors: Sequence[str], joint: str, count: int) -> Image:
    """Tiles, slabs, hexagons, parquet or mosaic."""
    u, v = coordinates()
    distance, number = floor_pieces(seed, kind, count)
    tone = 0.5 + 0.5 * per_cell(seed, number)
    if kind == "checker":
        tone = ((number // count + number % count) % 2).astype(float)
    image = _ramp(tone, colors)
    if kind == "parquet":
        fibre = np.where(
            (np.floor(u * count) + np.floor(v * count)).astype(int) % 2 == 0,
            fractal(seed, 96, 3, rows=6),
            fractal(seed + 1, 6, 3, rows=96),
        )
        image = _shade(image, 0.12 * fibre)
    veins = 1 - smooth(0.0, 0.12, np.abs(fractal(seed + 2, 5, 5)))
    image = _shade(
        image,
        0.05 * fractal(seed + 3, 8, 6) + 0.035 * grain(seed) - (0.16 * veins if kind in ("tiles", "checker") else 0.0),
    )
    ground = _shade(_flat(joint), 0.10 * grain(seed + 4) + 0.08 * fractal(seed + 5, 24))
    return _mix(image, ground, 1 - smooth(1.2, 2.6, distance + 0.4 * fractal(seed + 6, 48, 3)))


def metal(seed: int, color: str, rust: float, kind: str, accent: str) -> Image:
    """Brushed, plated, corrugated or painted metal, more or less rusty."""
    u, v = coordinates()
    image = _shade(
        _flat(color),
        0.06 * fractal(seed, 3, 6) + 0.07 * gradient_noise(seed + 1, 4, 256) + 0.05 * gradient_noise(seed + 2, 8, 200),
    )
    if kind == "plates":
        joint, number, fx, fy = courses(4, 4, 0.0)
        image = _shade(image, 0.10 * per_cell(seed, number))
        rivets = np.minimum.reduce([np.hypot(fx - x, fy - y) for x in (0.1, 0.5, 0.9) for y in (0.1, 0.9)])
        image = _shade(
            image,
            -0.5 * (1 - smooth(1.0, 2.5, joint))
            + 0.25 * (1 - smooth(0.028, 0.04, rivets))
            - 0.2 * (1 - smooth(0.0, 0.03, np.abs(rivets - 0.045))),
        )
    if kind == "tread":
        x, y = (u * 16) % 1 - 0.5, (v * 16) % 1 - 0.5
        turned = (np.floor(u * 16) + np.floor(v * 16)) % 2 == 0
        a, b = np.where(turned, x + y, x - y), np.where(turned, x - y, x + y)
        image = _shade(image, 0.35 * (1 - smooth(0.8, 1.0, np.hypot(a / 0.55, b / 0.16))))
    if kind == "sign":
        field = _mix(image, _flat(accent), ((np.abs(v - 0.5) < 0.36) & (np.abs(u - 0.5) < 0.45)).astype(np.float64))
        image = _mix(field, _flat("f2eee0"), glyphs(seed, 9, 5) * (np.abs(v - 0.5) < 0.3) * (np.abs(u - 0.5) < 0.4))
    if kind == "painted":
        image = _mix(
            image,
            _shade(_flat(accent), 0.05 * fractal(seed + 9, 6) + 0.03 * grain(seed)),
            smooth(-0.9, -0.6, fractal(seed + 8, 5, 6)),
        )
    spots = smooth(1.6 - 2.2 * rust, 2.2 - 2.0 * rust, fractal(seed + 3, 6, 7, 0.65))
    corroded = _ramp(_unit(fractal(seed + 4, 24, 4) + 0.6 * grain(seed)), ("3a1d10", "7a3a18", "a8581f", "c98540"))
    return _mix(_shade(image, 0.03 * grain(seed + 5)), corroded, spots)


def lattice_coverage() -> Plane:
    """Coverage of a wrought lattice: diagonal bars in a frame."""
    u, v = coordinates()
    diagonals = np.minimum(np.abs(((u + v) * 4) % 1 - 0.5), np.abs(((u - v) * 4) % 1 - 0.5))
    rings = np.abs(np.hypot((u * 4) % 1 - 0.5, (v * 4) % 1 - 0.5) - 0.33)
    frame = np.minimum(np.minimum(u, 1 - u), np.minimum(v, 1 - v))
    return ((diagonals < 0.055) | (rings < 0.045) | (frame < 0.03)).astype(float)


def plaster(seed: int, color: str, under: str, loss: float, strokes: int) -> Image:
    """Painted plaster: trowel strokes, flaking down to what is under it, hair cracks."""
    image = _shade(
        _flat(color),
        0.045 * fractal(seed, 3, 7, 0.6)
        + 0.05 * fractal(seed + 1, strokes, 3, rows=max(2, strokes // 4))
        + 0.03 * grain(seed, 1),
    )
    beneath = _shade(_flat(under), 0.12 * fractal(seed + 2, 24, 5) + 0.07 * grain(seed + 3))
    field = fractal(seed + 4, 4, 7, 0.6)
    lost = smooth(2.0 - 1.6 * loss, 2.06 - 1.6 * loss, field)
    rim = smooth(1.9 - 1.6 * loss, 2.0 - 1.6 * loss, field) - lost
    image = _mix(_shade(image, 0.12 * rim), beneath, lost)
    _, border, _ = cells(seed + 5, 5)
    crack = 1 - smooth(0.004, 0.016, warped(border, 14 * fractal(seed + 6, 12), 14 * fractal(seed + 7, 12)))
    return _shade(image, -0.35 * crack * smooth(-0.2, 0.8, fractal(seed + 8, 3)))


def rock(seed: int, colors: Sequence[str], strata: float, cracks: int) -> Image:
    """Rock: layers bent by folds, cracks, lichen."""
    _, v = coordinates()
    bend = 0.10 * gradient_noise(seed, 2) + 0.05 * gradient_noise(seed + 1, 5)
    layers = (
        np.sin(2 * np.pi * (6 * (v + bend)))
        + 0.6 * np.sin(2 * np.pi * (17 * (v + bend)))
        + 0.4 * np.sin(2 * np.pi * 41 * (v + bend))
    )
    tone = strata * 0.35 * layers + 0.75 * fractal(seed + 2, 4, 8, 0.68)
    image = _shade(_ramp(_unit(tone), colors), 0.07 * grain(seed))
    _, border, number = cells(seed + 3, cracks)
    jag = 9 * fractal(seed + 4, 16)
    crack = 1 - smooth(0.01, 0.05, warped(border, jag, -jag))
    image = _shade(image, -0.55 * crack + 0.09 * warped(per_cell(seed, number), jag, -jag))
    return _mix(image, _flat("b9b86a"), 0.5 * smooth(1.5, 1.9, fractal(seed + 5, 14, 5, 0.7)))


def roofing(seed: int, kind: str, colors: Sequence[str], columns: int, rows: int) -> Image:
    """Tiles, shingles, slates, corrugated sheet or thatch."""
    u, v = coordinates()
    if kind == "thatch":
        straw = fractal(seed, 128, 2, rows=6) + 0.7 * fractal(seed + 1, 64, 3, rows=8)
        return _shade(
            _ramp(_unit(straw), colors),
            -0.35 * (1 - smooth(0.0, 0.25, (v * rows + 0.04 * fractal(seed + 2, 24)) % 1)) + 0.06 * grain(seed),
        )
    if kind == "corrugated":
        wave = np.sin(2 * np.pi * u * columns)
        return _shade(
            metal(seed, colors[0], 0.55, "plain", colors[1]),
            0.22 * wave - 0.3 * (1 - smooth(0.005, 0.02, np.abs(v - 0.5))),
        )
    joint, number, fx, fy = courses(columns, rows, 0.5)
    image = _ramp(0.5 + 0.5 * per_cell(seed, number), colors)
    if kind == "clay":
        image = _shade(image, -0.32 + 0.55 * np.sin(np.pi * fx) + 0.0 * joint)
    else:
        image = _shade(image, 0.10 * gradient_noise(seed, columns * 8, rows))
    lip = 1 - smooth(0.0, 0.16, 1 - fy + 0.02 * fractal(seed + 1, 32))
    shadow = 1 - smooth(0.0, 0.22, fy)
    image = _shade(image, 0.16 * lip - 0.45 * shadow + 0.08 * fractal(seed + 2, 20, 4) + 0.05 * grain(seed))
    gap = 1 - smooth(0.5, 2.0, np.minimum(fx, 1 - fx) * SIZE / columns)
    moss = smooth(1.0, 1.7, fractal(seed + 3, 7, 6))
    return _mix(_shade(image, -0.5 * gap), _flat("55632f"), 0.7 * moss)


def terrain(seed: int, kind: str, colors: Sequence[str]) -> Image:
    """Grass, sand, gravel, mud or fallen leaves."""
    if kind in ("gravel", "leaves"):
        image = _ramp(_unit(fractal(seed, 16)), (colors[0], colors[1]))
        for layer, count in enumerate((22, 34)):
            nearest, border, number = cells(seed + layer * 7, count, jitter=1.0)
            jag = 4 * fractal(seed + layer + 20, 24)
            border, nearest = warped(border, jag, jag), warped(nearest, jag, jag)
            number = warped(number.astype(float), jag, jag).astype(int)
            body = _ramp(0.5 + 0.5 * per_cell(seed + layer, number), colors)
            ribs = 0.10 * np.sin(60 * nearest) if kind == "leaves" else 0.0 * nearest
            body = _shade(body, 0.2 - 0.55 * nearest + ribs + 0.05 * grain(seed + layer))
            image = _mix(
                image, body, smooth(0.05, 0.14, border) * (per_cell(seed + layer + 3, number) > -0.25 + 0.4 * layer)
            )
        return image
    if kind == "grass":
        blades = np.zeros((SIZE, SIZE))
        for layer in range(6):
            lean = 6 * gradient_noise(seed + layer, 12)
            blades = np.maximum(
                blades, warped(gradient_noise(seed + 30 + layer, 128, 20 + 4 * layer), lean, lean) + 0.1 * layer
            )
        return _shade(_ramp(np.clip(0.15 + 0.5 * blades + 0.12 * fractal(seed, 5), 0, 1), colors), 0.06 * grain(seed))
    _, v = coordinates()
    ripples = np.sin(2 * np.pi * (22 * v + 0.9 * gradient_noise(seed, 3) + 0.35 * gradient_noise(seed + 1, 9)))
    image = _ramp(_unit((0.8 if kind == "sand" else 0.15) * ripples + 0.7 * fractal(seed + 2, 5, 7)), colors)
    if kind == "mud":
        _, border, _ = cells(seed + 3, 9)
        image = _shade(
            image, -0.5 * (1 - smooth(0.01, 0.06, warped(border, 5 * fractal(seed + 4, 20), 5 * fractal(seed + 5, 20))))
        )
    return _shade(image, 0.08 * grain(seed) + 0.05 * grain(seed + 6, 2))


def wood(seed: int, colors: Sequence[str], planks: int, paint: str | None, signs: bool = False) -> Image:
    """Planks with rings and knots, bare or painted, or one board with signs painted on it."""
    u, v = coordinates()
    plank = np.floor(u * planks).astype(int)
    x = (u * planks - plank - 0.5) * 2
    centre = 0.8 * per_cell(seed, plank)
    sway = 0.35 * gradient_noise(seed + 1, planks, 3) + 0.12 * gradient_noise(seed + 2, planks * 2, 6)
    knot = np.hypot(x - 0.5 * per_cell(seed + 3, plank), (((v + 0.5 * per_cell(seed + 4, plank)) % 1) - 0.5) * 7)
    rings = np.abs(x - centre + sway) * 9 + 2.2 * np.exp(-knot * 2.4)
    tone = (
        0.5
        + 0.33 * np.sin(2 * np.pi * rings)
        + 0.10 * fractal(seed + 5, 128, 2, rows=8)
        + 0.16 * per_cell(seed + 6, plank)
    )
    image = _shade(_ramp(tone, colors), 0.05 * grain(seed) + 0.10 * gradient_noise(seed + 7, 256, 12))
    image = _shade(image, -0.5 * np.exp(-((knot / 0.32) ** 2)))
    if paint is not None:
        worn = smooth(0.9, 1.3, fractal(seed + 8, 8, 6, rows=3) + 0.5 * gradient_noise(seed + 9, 256, 12))
        image = _mix(_shade(_flat(paint), 0.05 * gradient_noise(seed + 10, 200, 8) + 0.025 * grain(seed)), image, worn)
    if signs:
        image = _mix(image, _flat("1d1a18"), 0.85 * glyphs(seed, 7, 4))
    gap = np.minimum(u * planks - plank, 1 - (u * planks - plank)) * SIZE / planks
    return _shade(image, -0.75 * (1 - smooth(0.6, 2.0, gap))) if planks > 1 else image


def recipes() -> tuple[TextureRecipe, ...]:
    """All 55 textures, category by category."""
    table: dict[str, dict[str, Callable[[], Image]]] = {
        "aerial": {
            "aerial_fields": lambda: aerial(11, ("5d6b2f", "8a8b43", "b59d5a", "6f7f3a"), 7, "46502c"),
            "aerial_desert": lambda: aerial(12, ("c7a26b", "b88a55", "d9bd8c", "a97c4c"), 4, "8a6a44"),
            "aerial_forest": lambda: aerial(13, ("27361c", "3a4c24", "4d5c2b", "2f4323"), 9, "1c2614"),
            "aerial_suburb": lambda: aerial(14, ("8c4a36", "77797c", "66713f", "a9a08f"), 14, "4a4a4c"),
            "aerial_marsh": lambda: aerial(15, ("4f6a62", "6c7a4a", "3d5560", "8a8a5c"), 6, "2e3f46"),
        },
        "brick": {
            "brick_red": lambda: brick(21, 8, 16, ("7a2f22", "964033", "a9533f", "6a2a24"), "b7aea2", 2.2),
            "brick_yellow": lambda: brick(22, 6, 18, ("c9a35c", "b88c48", "d8b878", "a67c40"), "8b8378", 2.0),
            "brick_painted_white": lambda: brick(23, 8, 20, ("dcd8cf", "e9e6df", "cfcac0", "f0eee8"), "c4beb2", 1.6),
            "brick_dark_clinker": lambda: brick(
                24, 10, 20, ("2f2a2e", "453a3a", "573f38", "3a3440"), "77726c", 1.8, 0.25
            ),
            "brick_blocks": lambda: brick(25, 4, 8, ("8e8a84", "a29d94", "7c7974", "b0aa9e"), "6a655f", 3.0),
        },
        "concrete": {
            "concrete_boards": lambda: concrete(31, "8f8d88", "5f5b54", 8, 0.1),
            "concrete_smooth": lambda: concrete(32, "a7a6a2", "7d7a74", 0, 0.0),
            "concrete_porous": lambda: concrete(33, "b4aea2", "8a8070", 0, 0.7),
            "concrete_dark": lambda: concrete(34, "5b5c5e", "3a3a3c", 3, 0.3),
            "concrete_stained": lambda: concrete(35, "9c9486", "4b4335", 0, 0.3),
        },
        "fabric": {
            "fabric_red_plaid": lambda: fabric(
                41, ("a32020", "1f2a44", "a32020", "e4dfd0"), ("a32020", "1f2a44", "a32020", "d8b13a"), 128, 4
            ),
            "fabric_blue_stripes": lambda: fabric(42, ("24487a", "eceae2"), ("dfe3ea",), 96, 2),
            "fabric_burlap": lambda: fabric(43, ("a58a5c", "96794c", "b49a6c"), ("9c8050", "ab9164"), 64, 2),
            "fabric_green_twill": lambda: fabric(44, ("3c5a34", "44643a"), ("2e4729", "385430"), 128, 4),
            "fabric_carpet": lambda: fabric(
                45, ("7c1f2e", "c99a3c", "20305a", "7c1f2e", "e0d6bd"), ("5c1522", "a87f2e", "7c1f2e", "182448"), 80, 3
            ),
        },
        "floor": {
            "floor_terracotta": lambda: floor(51, "tiles", ("a4532f", "b8653a", "c77a4b"), "8d8478", 6),
            "floor_checker": lambda: floor(52, "checker", ("23211f", "e4dfd4"), "6d6a64", 8),
            "floor_hexagons": lambda: floor(53, "hexagons", ("39505e", "5f7f8c", "d6d2c6", "84664a"), "c8c2b5", 12),
            "floor_parquet": lambda: floor(54, "parquet", ("7a4f2a", "93632f", "a97a45", "6a4223"), "2f1f12", 6),
            "floor_mosaic": lambda: floor(
                55, "mosaic", ("1f4f6a", "c9a23f", "a33a2a", "e6dfcb", "2f6a4a"), "d2cabb", 36
            ),
        },
        "metal": {
            "metal_rust": lambda: metal(61, "7a7670", 0.85, "plain", "7a7670"),
            "metal_plates": lambda: metal(62, "8d9398", 0.35, "plates", "8d9398"),
            "metal_tread": lambda: metal(63, "74787a", 0.25, "tread", "74787a"),
            "metal_sign": lambda: metal(64, "9aa0a4", 0.3, "sign", "1d4a7c"),
            "metal_lattice": lambda: metal(65, "3a4a44", 0.45, "painted", "28463c"),
        },
        "plaster": {
            "plaster_ochre": lambda: plaster(71, "c9973f", "9c8d78", 0.45, 24),
            "plaster_rose": lambda: plaster(72, "c98a7c", "b3a797", 0.6, 12),
            "plaster_white": lambda: plaster(73, "e6e2d8", "a9a092", 0.3, 40),
            "plaster_blue": lambda: plaster(74, "6f92a8", "c2b8a4", 0.7, 16),
            "plaster_green": lambda: plaster(75, "8aa07a", "8c4f38", 0.5, 8),
        },
        "rock": {
            "rock_sandstone": lambda: rock(81, ("8a5a34", "b98552", "d8b07c", "a06c40"), 1.6, 3),
            "rock_granite": lambda: rock(82, ("3f3c3c", "7c7674", "b9b2ac", "8c6f68"), 0.0, 2),
            "rock_slate": lambda: rock(83, ("22272d", "3a424a", "56606a", "2c3238"), 2.2, 6),
            "rock_limestone": lambda: rock(84, ("a89f8c", "c7bfad", "ded8c8", "958a74"), 0.6, 5),
            "rock_basalt": lambda: rock(85, ("1c1b1d", "2f2e31", "48464a", "39363a"), 0.2, 8),
        },
        "roofing": {
            "roofing_clay": lambda: roofing(91, "clay", ("8f3f22", "b0552f", "c76f40", "7c3620"), 12, 10),
            "roofing_slate": lambda: roofing(92, "slate", ("353c46", "4a525e", "2a3038", "596270"), 10, 12),
            "roofing_shingles": lambda: roofing(93, "slate", ("6a5a48", "80705a", "544636", "94836a"), 14, 14),
            "roofing_corrugated": lambda: roofing(94, "corrugated", ("8a9298", "8a9298"), 20, 2),
            "roofing_thatch": lambda: roofing(95, "thatch", ("4a3a20", "8a7140", "b89c60", "6a5530"), 1, 4),
        },
        "terrain": {
            "terrain_grass": lambda: terrain(101, "grass", ("1c2a10", "3a5220", "5f7f30", "8fa850")),
            "terrain_sand": lambda: terrain(102, "sand", ("b08a54", "cfae74", "e2c894", "c29c64")),
            "terrain_gravel": lambda: terrain(103, "gravel", ("4a4540", "6f6a64", "928c84", "b3aca2", "7c6a58")),
            "terrain_mud": lambda: terrain(104, "mud", ("2e2218", "4a3828", "5f4a34", "3a2c20")),
            "terrain_leaves": lambda: terrain(105, "leaves", ("5a2f12", "8c4a16", "b8781f", "c9a23a", "6a5a2a")),
        },
        "wood": {
            "wood_oak": lambda: wood(111, ("5a3a1c", "8a5f30", "b08448", "6f4824"), 4, None),
            "wood_weathered": lambda: wood(112, ("56524c", "7c776e", "a09a8e", "68635a"), 6, None),
            "wood_painted_teal": lambda: wood(113, ("6a4a2c", "8c6a44", "a98558", "7a5834"), 5, "2f7c78"),
            "wood_dark": lambda: wood(114, ("24140c", "3c2414", "56351e", "2e1a10"), 3, None),
            "wood_sign": lambda: wood(115, ("94693a", "b88a52", "cda66c", "a67c48"), 1, None, signs=True),
        },
    }
    return tuple(
        TextureRecipe(name, category, make, lattice_coverage if name == "metal_lattice" else None)
        for category, members in table.items()
        for name, make in members.items()
    )


def pixels(recipe: TextureRecipe) -> NDArray[np.uint8]:
    """[SIZE, SIZE, 3] or, with a cutout, [SIZE, SIZE, 4] uint8 sRGB."""
    color = np.rint(np.clip(recipe.make(), 0, 1) * 255).astype(np.uint8)
    if recipe.cutout is None:
        return color
    coverage = np.rint(recipe.cutout() * 255).astype(np.uint8)
    return np.concatenate([color, coverage[..., None]], axis=-1)
