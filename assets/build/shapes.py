"""Objects of the built-in scene: shapes as lists of quads, with texture coordinates in world units: metres divided by the texture's size in metres."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Point = tuple[float, float, float]
Vector = NDArray[np.float64]


CREASE = np.cos(np.radians(40.0))
"""Faces of a patch that turn by more against each other meet in an edge, others in a rounded surface."""


def _unit(vectors: Vector) -> Vector:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 1e-12)


def _face_normals(points: Vector) -> Vector:
    """[rows - 1, columns - 1, 3] of a grid of points: unit, zero where a face is empty."""
    across = points[:-1, 1:] - points[1:, :-1]
    return _unit(np.cross(across, points[1:, 1:] - points[:-1, :-1]))


def _creases(faces: Vector, axis: int) -> NDArray[np.int64]:
    """Numbers of the inner lines of the grid, along `axis`, at which faces meet in an edge."""
    first, second = np.moveaxis(faces, axis, 0)[:-1], np.moveaxis(faces, axis, 0)[1:]
    dots = np.einsum("abk,abk->ab", first, second)
    filled = (np.abs(first).sum(axis=-1) > 0) & (np.abs(second).sum(axis=-1) > 0)
    return np.flatnonzero((filled & (dots < CREASE)).any(axis=1)) + 1


def _vertex_normals(points: Vector, closed: bool) -> Vector:
    """[rows, columns, 3] unit means of the faces about each point; a `closed` grid's last column is its first."""
    faces = np.pad(_face_normals(points), ((1, 1), (1, 1), (0, 0)))
    if closed:
        faces[:, 0], faces[:, -1] = faces[:, -2], faces[:, 1]
    return _unit(faces[:-1, :-1] + faces[1:, :-1] + faces[:-1, 1:] + faces[1:, 1:])


def _runs(numbers: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Ascending `numbers` cut where one is repeated."""
    return np.split(numbers, np.flatnonzero(np.diff(numbers) == 0) + 1)


@dataclass
class Shape:
    """Triangles of one material."""

    positions: list[Vector] = field(default_factory=list)
    normals: list[Vector] = field(default_factory=list)
    uvs: list[Vector] = field(default_factory=list)
    indices: list[NDArray[np.int64]] = field(default_factory=list)
    count: int = 0

    def patch(self, points: Vector, uvs: Vector, closed: bool = False) -> None:
        """A grid of [rows, columns] points; seen from the front its columns run right and its rows run up.

        Vertices are repeated along edges, where two faces have normals of their own; the faces between them are empty.
        """
        faces = _face_normals(points)
        rows, columns = (
            np.sort(np.concatenate([np.arange(points.shape[axis]), _creases(faces, axis)])) for axis in (0, 1)
        )
        normals = np.concatenate(
            [
                np.concatenate([_vertex_normals(part, closed and len(across) == 1) for part in across], axis=1)
                for across in ([points[np.ix_(r, c)] for c in _runs(columns)] for r in _runs(rows))
            ]
        )
        points, uvs = points[np.ix_(rows, columns)], uvs[np.ix_(rows, columns)]
        high, wide = points.shape[:2]
        numbers = self.count + np.arange(high * wide).reshape(high, wide)
        a, b, c, d = numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, 1:], numbers[1:, :-1]
        self.indices.append(np.stack([a, b, c, a, c, d], axis=-1).reshape(-1))
        self.positions.append(points.reshape(-1, 3))
        self.normals.append(normals.reshape(-1, 3))
        self.uvs.append(uvs.reshape(-1, 2))
        self.count += high * wide

    def quad(
        self, origin: Point, right: Point, up: Point, metres: float, stretch: bool = False, turned: bool = False
    ) -> None:
        """A rectangle from its lower left corner; `stretch` shows the texture once, `turned` lays its grain along `right`."""
        o, r, u = (np.array(vector, np.float64) for vector in (origin, right, up))
        width, height = float(np.linalg.norm(r)), float(np.linalg.norm(u))
        w, h = (1.0, 1.0) if stretch else (width / metres, height / metres)
        corners = np.array([[[0, h], [w, h]], [[0, 0], [w, 0]]])
        self.patch(np.array([[o, o + r], [o + u, o + r + u]]), corners[..., ::-1] if turned else corners)

    def box(self, low: Point, high: Point, metres: float, skip: str = "", turned: bool = False) -> None:
        """An axis-aligned box; `skip` names faces that nobody can see: any of -x +x -y +y -z +z."""
        (x0, y0, z0), (x1, y1, z1) = low, high
        w, h, d = x1 - x0, y1 - y0, z1 - z0
        faces: dict[str, tuple[Point, Point, Point]] = {
            "+z": ((x0, y0, z1), (w, 0, 0), (0, h, 0)),
            "-z": ((x1, y0, z0), (-w, 0, 0), (0, h, 0)),
            "+x": ((x1, y0, z1), (0, 0, -d), (0, h, 0)),
            "-x": ((x0, y0, z0), (0, 0, d), (0, h, 0)),
            "+y": ((x0, y1, z1), (w, 0, 0), (0, 0, -d)),
            "-y": ((x0, y0, z0), (w, 0, 0), (0, 0, d)),
        }
        for name, (origin, right, up) in faces.items():
            if name not in skip:
                self.quad(origin, right, up, metres, turned=turned)

    def lathe(self, centre: Point, profile: Iterable[tuple[float, float]], metres: float, sides: int = 24) -> None:
        """A surface of revolution about a vertical axis; `profile` holds (radius, height) from bottom to top, seen from outside."""
        rings = np.array(list(profile), np.float64)
        angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
        # Seen from outside with up upwards, growing angle in (sin, cos) order runs to the right.
        x = centre[0] + rings[:, :1] * np.sin(angle)
        z = centre[2] + rings[:, :1] * np.cos(angle)
        y = np.broadcast_to(centre[1] + rings[:, 1:], x.shape)
        around = 2.0 * np.pi * max(float(rings[:, 0].max()), 1e-6) / metres
        lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(rings, axis=0).T))]) / metres
        # Whole turns of the texture meet at the seam.
        u = np.broadcast_to(angle / (2.0 * np.pi) * max(1.0, round(around)), x.shape)
        v = np.broadcast_to((lengths[-1] - lengths)[:, None], x.shape)
        self.patch(np.stack([x, y, z], axis=-1), np.stack([u, v], axis=-1), closed=True)

    def arrays(self) -> tuple[Vector, Vector, Vector, NDArray[np.int64]]:
        """(positions [V, 3], unit normals [V, 3], uvs [V, 2], indices [3 T]), without empty triangles."""
        positions = np.concatenate(self.positions)
        triangles = np.concatenate(self.indices).reshape(-1, 3)
        a, b, c = (positions[triangles[:, corner]] for corner in range(3))
        filled = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-10
        return positions, np.concatenate(self.normals), np.concatenate(self.uvs), triangles[filled].reshape(-1)


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
