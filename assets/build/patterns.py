"""Periodic patterns on the unit square, as [SIZE, SIZE] float64 arrays; row 0 is at v = 0."""

import numpy as np
from numpy.typing import NDArray

SIZE = 512
Plane = NDArray[np.float64]


def coordinates() -> tuple[Plane, Plane]:
    """(u, v) of all texel centres in [0, 1)."""
    centres = (np.arange(SIZE) + 0.5) / SIZE
    return np.broadcast_to(centres, (SIZE, SIZE)).copy(), np.broadcast_to(centres[:, None], (SIZE, SIZE)).copy()


def gradient_noise(seed: int, columns: int, rows: int | None = None) -> Plane:
    """Gradient noise of about [-1, 1] with `columns` x `rows` lattice cells, periodic."""
    rows = columns if rows is None else rows
    angles = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, (rows, columns))
    u, v = coordinates()
    x, y = u * columns, v * rows
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = x - column, y - row

    def corner(step_x: int, step_y: int) -> Plane:
        angle = angles[(row + step_y) % rows, (column + step_x) % columns]
        return np.asarray(np.cos(angle) * (fx - step_x) + np.sin(angle) * (fy - step_y))

    sx, sy = fx * fx * fx * (fx * (fx * 6 - 15) + 10), fy * fy * fy * (fy * (fy * 6 - 15) + 10)
    upper = corner(0, 0) * (1 - sx) + corner(1, 0) * sx
    lower = corner(0, 1) * (1 - sx) + corner(1, 1) * sx
    return np.asarray(1.5 * (upper * (1 - sy) + lower * sy))


def fractal(seed: int, columns: int, octaves: int = 5, gain: float = 0.55, rows: int | None = None) -> Plane:
    """Sum of gradient noises of doubling frequency, scaled to a deviation of about 1."""
    total = np.zeros((SIZE, SIZE))
    for octave in range(octaves):
        scale = 2**octave
        if columns * scale > SIZE // 2:
            break
        total += gain**octave * gradient_noise(seed * 131 + octave, columns * scale, (rows or columns) * scale)
    return total / max(float(total.std()), 1e-9)


def grain(seed: int, softness: int = 0) -> Plane:
    """White noise of deviation 1, softened by `softness` neighbouring averages."""
    noise = np.random.default_rng(seed + 9001).normal(size=(SIZE, SIZE))
    for _ in range(softness):
        noise = (noise + np.roll(noise, 1, 0) + np.roll(noise, 1, 1) + np.roll(noise, (1, 1), (0, 1))) / 4.0
    return np.asarray(noise / noise.std())


def cells(
    seed: int, columns: int, rows: int | None = None, jitter: float = 0.9
) -> tuple[Plane, Plane, NDArray[np.int64]]:
    """Voronoi cells: distance to the nearest point, distance to the border (both in cells), number of the cell."""
    rows = columns if rows is None else rows
    random = np.random.default_rng(seed + 77)
    offsets = 0.5 + jitter * (random.uniform(size=(rows, columns, 2)) - 0.5)
    u, v = coordinates()
    x, y = u * columns, v * rows
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    first = np.full((SIZE, SIZE), np.inf)
    second = np.full((SIZE, SIZE), np.inf)
    number = np.zeros((SIZE, SIZE), np.int64)
    for step_y in (-1, 0, 1):
        for step_x in (-1, 0, 1):
            r, c = (row + step_y) % rows, (column + step_x) % columns
            point = offsets[r, c]
            away = np.hypot(column + step_x + point[..., 0] - x, row + step_y + point[..., 1] - y)
            nearer = away < first
            second = np.where(nearer, first, np.minimum(second, away))
            number = np.where(nearer, r * columns + c, number)
            first = np.where(nearer, away, first)
    return first, second - first, number


def courses(columns: int, rows: int, shift: float = 0.5) -> tuple[Plane, NDArray[np.int64], Plane, Plane]:
    """Rows of blocks, each shifted against the one above: distance to the joint (in texels), number, and (u, v) in the block."""
    u, v = coordinates()
    y = v * rows
    row = np.floor(y).astype(int)
    x = u * columns + shift * (row % max(1, round(1.0 / shift) if shift else 1))
    column = np.floor(x).astype(int)
    fx, fy = x - column, y - row
    joint = np.minimum(np.minimum(fx, 1 - fx) * SIZE / columns, np.minimum(fy, 1 - fy) * SIZE / rows)
    return joint, row * columns + column % columns, fx, fy


def per_cell(seed: int, number: NDArray[np.int64]) -> Plane:
    """A random value in [-1, 1] for each cell number."""
    return np.random.default_rng(seed + 555).uniform(-1.0, 1.0, int(number.max()) + 1)[number]


def smooth(low: float, high: float, values: Plane) -> Plane:
    """Smooth step from 0 at `low` to 1 at `high`."""
    t = np.clip((values - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def warped(plane: Plane, dx: Plane, dy: Plane) -> Plane:
    """`plane` read at texels moved by (dx, dy) texels, nearest, periodic."""
    rows, columns = np.indices((SIZE, SIZE))
    moved: Plane = plane[np.rint(rows + dy).astype(int) % SIZE, np.rint(columns + dx).astype(int) % SIZE]
    return moved


def glyphs(seed: int, columns: int, rows: int, thickness: float = 0.13) -> Plane:
    """Text-like signs: in each cell of a grid a few strokes on a 3 x 5 raster. 1 on ink, 0 elsewhere."""
    random = np.random.default_rng(seed + 4242)
    u, v = coordinates()
    x, y = u * columns, v * rows
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - column - 0.18) / 0.64, (y - row - 0.16) / 0.68
    ink = np.zeros((SIZE, SIZE))
    horizontal = random.random((rows, columns, 3, 2)) < 0.62
    vertical = random.random((rows, columns, 3, 2)) < 0.62
    blank = random.random((rows, columns)) < 0.12
    for level in range(3):
        for side in range(2):
            on = (
                horizontal[row, column, level, side]
                & (np.abs(fy - level / 2) < thickness)
                & (fx > side / 2 - 0.02)
                & (fx < side / 2 + 0.52)
            )
            ink = np.maximum(ink, on)
            on = (
                vertical[row, column, level, side]
                & (np.abs(fx - level / 2) < thickness)
                & (fy > side / 2 - 0.02)
                & (fy < side / 2 + 0.52)
            )
            ink = np.maximum(ink, on)
    return np.where(blank[row, column], 0.0, ink)


def floor_pieces(seed: int, kind: str, count: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Distance to the nearest joint in texels, and number of the piece, of tiles, slabs, hexagons, parquet or mosaic."""
    u, v = coordinates()
    if kind == "mosaic":
        _, border, number = cells(seed, count, jitter=0.55)
        distance = border * SIZE / count * 0.6
    elif kind == "hexagons":
        x, y = u * count, v * count
        row = np.floor(y).astype(int)
        column = np.floor(x + 0.5 * (row % 2)).astype(int)
        fx, fy = x + 0.5 * (row % 2) - column - 0.5, y - row - 0.5
        distance = (0.5 - np.maximum(np.abs(fx), np.abs(fx) * 0.5 + np.abs(fy) * 0.95)) * SIZE / count
        number = row * count + column % count
    elif kind == "parquet":
        block = (np.floor(u * count) + np.floor(v * count)).astype(int) % 2
        along = np.where(block == 0, u, v) * count * 4
        across = np.where(block == 0, v, u) * count
        number = (np.floor(along) + 997 * np.floor(across) + 31 * np.floor(np.where(block == 0, v, u) * count)).astype(
            int
        ) % 4096
        distance = np.minimum(
            np.minimum(along % 1, 1 - along % 1) * SIZE / count / 4,
            np.minimum(across % 1, 1 - across % 1) * SIZE / count,
        )
    else:
        distance, number, _, _ = courses(count, count, 0.5 if kind == "slabs" else 0.0)
    return distance, number
