"""The triangles of a scene in world space: points sampled on them, and the nearest surfaces around a place."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from viewer.scene.model import Scene

Array = NDArray[np.float64]
HIGH_UP = 4.0
"""Smallest height of a roof above other ground, in eye heights."""


def value_range(values: Array) -> tuple[Array, Array]:
    """Return [T] minimum and maximum over the corners of each triangle, of `values` [3, T]."""
    return np.minimum(np.minimum(*values[:2]), values[2]), np.maximum(np.maximum(*values[:2]), values[2])


def crossings(corners: Array, axis: int) -> tuple[Array, NDArray[np.bool_]]:
    """Return (positions [M], whether the triangle faces along the axis [M]) of the crossings of triangles [T, 3, 3] with an axis.

    The axis crosses a triangle whose projection along it contains the origin. The cross products of successive corners are twice the
    areas that the origin makes with each side. The origin is inside where all three have one sign. Divided by their sum, they are the
    barycentric coordinates of the crossing. The sign of the sum is the side that the triangle faces.
    """
    p, q = corners[:, :, (axis + 1) % 3], corners[:, :, (axis + 2) % 3]
    areas = p * np.roll(q, -1, axis=1) - q * np.roll(p, -1, axis=1)
    whole = areas.sum(axis=1)
    inside = ((areas >= 0.0).all(axis=1) | (areas <= 0.0).all(axis=1)) & (whole != 0.0)
    # Side i is opposite to corner i + 2.
    shares = np.roll(areas[inside], -1, axis=1) / whole[inside, None]
    return (shares * corners[inside, :, axis]).sum(axis=1), whole[inside] > 0.0


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Nearest opaque surfaces of places [N] along each axis: arrays [3, 2, N], forwards first, then backwards."""

    distance: Array
    """Distance to the surface; infinite without one."""
    back: NDArray[np.bool_]
    """True where the surface's back faces the place."""
    double_sided: NDArray[np.bool_]
    """True where the surface's back is drawn."""
    high_up: NDArray[np.bool_]
    """[N] true where other ground lies more than HIGH_UP eye heights below."""

    @staticmethod
    def nothing(count: int) -> "Surroundings":
        """Return `count` places without surfaces."""
        flags = np.zeros((3, 2, count), bool)
        return Surroundings(np.full((3, 2, count), np.inf), flags, flags.copy(), np.zeros(count, bool))

    def add(
        self, axis: int, index: int, offsets: Array, along: NDArray[np.bool_], double_sided: bool, height: float
    ) -> None:
        """Add surfaces at `offsets` [M] along `axis` from place `index`; `along` [M] is true for those that face along the axis."""
        if axis == 1:
            self.high_up[index] |= bool((along & (offsets < -HIGH_UP * height)).any())
        for side, (distances, backs) in enumerate(((offsets, along), (-offsets, ~along))):
            ahead = np.where(distances > 0.0, distances, np.inf)
            if len(ahead) and ahead.min() < self.distance[axis, side, index]:
                nearest = int(np.argmin(ahead))
                self.distance[axis, side, index] = ahead[nearest]
                self.back[axis, side, index] = backs[nearest]
                self.double_sided[axis, side, index] = double_sided

    def buried(self) -> NDArray[np.bool_]:
        """Return [N] whether the place is under the ground or inside a solid."""
        above, below = np.isfinite(self.distance[1])
        unseen = (self.back & ~self.double_sided)[1].any(axis=0)
        return np.asarray(unseen | self.back[1].all(axis=0) | (above & ~below))

    def behind_walls(self) -> NDArray[np.bool_]:
        """Return [N] whether the place is behind a wall whose back is not drawn: the camera would look through it."""
        return np.asarray((self.back & ~self.double_sided)[[0, 2]].any(axis=(0, 1)))

    def on_top(self) -> NDArray[np.bool_]:
        """Return [N] whether the place is on a roof: nothing above it, and other ground far below."""
        return np.asarray(self.high_up & self.open_sky())

    def open_sky(self) -> NDArray[np.bool_]:
        """Return [N] whether nothing is above the place."""
        return np.asarray(~np.isfinite(self.distance[1, 0]))


LEAST_UP = 0.7
"""Smallest cosine between the vertical and the normal of walkable ground."""
CHUNK = 1 << 20
"""Number of triangles that are transformed at once."""


DIRECTIONS = 16
"""Number of level directions that `Surfaces.free_distances` measures."""


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points on surfaces."""

    points: Array
    """[N, 3] places in world space."""
    normals: Array
    """[N, 3] unit length, towards the visible side."""
    textures: NDArray[np.int64]
    """[N] texture ids, -1 for none."""


class Surfaces:
    """Triangles of a scene, sampled by area. At most CHUNK of them are transformed at once."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        transforms = scene.instances.transform.astype(np.float64)
        linear = transforms[:, :3, :3]
        # The cofactor matrix transforms area vectors. Its columns are cross products of the transform's columns.
        self._area_matrix = np.stack(
            [np.cross(linear[:, :, (i + 1) % 3], linear[:, :, (i + 2) % 3]) for i in range(3)], axis=2
        )
        self._mirrored = np.linalg.det(linear) < 0.0 if len(linear) else np.zeros(0, bool)
        self._transforms = transforms
        self._local = [self._local_areas(index) for index in range(len(scene.primitives))]
        materials = [scene.materials[primitive.material] for primitive in scene.primitives]
        of_instance = scene.instances.primitive
        self.texture = np.array([material.texture_id for material in materials], np.int64)[of_instance]
        self._double_sided = np.array([material.double_sided for material in materials], bool)[of_instance]
        self._opaque = np.array([material.alpha_mode == "opaque" for material in materials], bool)[of_instance]
        area, self.up_area = self._sums()
        self.textured_area = area * (self.texture >= 0)
        # Ground with alpha (leaves, glass) is used only where there is no opaque ground.
        if (self.up_area * self._opaque).any():
            self.up_area = self.up_area * self._opaque

    def _corners(self, primitive: int) -> Array:
        """Return [T, 3, 3] corners in local space."""
        row, geometry = self._scene.primitives[primitive], self._scene.geometry
        indices = geometry.indices[row.first_index : row.first_index + row.index_count].astype(np.int64)
        return (
            geometry.positions[row.base_vertex + indices[: len(indices) // 3 * 3]].reshape(-1, 3, 3).astype(np.float64)
        )

    def _local_areas(self, primitive: int) -> Array:
        """Return [T, 3] normals whose lengths are twice the areas of the triangles."""
        corners = self._corners(primitive)
        return np.nan_to_num(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))

    def _areas(self, instances: NDArray[np.int64], primitive: int) -> tuple[Array, Array]:
        """Return (areas, walkable areas), both [K, T], of the triangles of K instances of one primitive."""
        vectors = np.einsum("kij,tj->kti", self._area_matrix[instances], self._local[primitive])
        areas = np.linalg.norm(vectors, axis=2)
        up = np.where(self._mirrored[instances][:, None], -vectors[:, :, 1], vectors[:, :, 1])
        # Back faces are culled: a camera above one would look at the ground from below.
        up = np.where(self._double_sided[instances][:, None], np.abs(up), up)
        return areas, np.where(up > LEAST_UP * areas, areas, 0.0)

    def _sums(self) -> tuple[Array, Array]:
        area, up_area = np.zeros(len(self._transforms)), np.zeros(len(self._transforms))
        order = np.argsort(self._scene.instances.primitive, kind="stable")
        ends = np.searchsorted(self._scene.instances.primitive[order], np.arange(len(self._local)), side="right")
        first = 0
        for primitive, end in enumerate(ends.tolist()):
            step = max(CHUNK // max(len(self._local[primitive]), 1), 1)
            for start in range(first, end, step):
                rows = order[start : min(start + step, end)]
                areas, ups = self._areas(rows, primitive)
                area[rows], up_area[rows] = areas.sum(axis=1), ups.sum(axis=1)
            first = end
        return area, up_area

    def points(self, random: np.random.Generator, weights: Array, count: int, up_only: bool) -> SurfacePoints:
        """Sample `count` points, instances drawn by `weights` and triangles by area."""
        points, normals = np.zeros((count, 3)), np.zeros((count, 3))
        chosen = random.choice(len(weights), size=count, p=weights / weights.sum())
        for instance in np.unique(chosen):
            places = np.nonzero(chosen == instance)[0]
            primitive = int(self._scene.instances.primitive[instance])
            areas = self._areas(np.array([instance]), primitive)[1 if up_only else 0][0]
            triangles = random.choice(len(areas), size=len(places), p=areas / areas.sum())
            u, v = random.random((2, len(places), 1))
            u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
            corners = self._corners(primitive)[triangles]
            local = corners[:, 0] * (1.0 - u - v) + corners[:, 1] * u + corners[:, 2] * v
            points[places] = local @ self._transforms[instance, :3, :3].T + self._transforms[instance, :3, 3]
            vectors = self._local[primitive][triangles] @ self._area_matrix[instance].T
            vectors *= -1.0 if self._mirrored[instance] else 1.0
            if self._double_sided[instance]:
                vectors *= random.choice([-1.0, 1.0], size=(len(places), 1))
            normals[places] = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
        return SurfacePoints(points, normals, self.texture[chosen])

    def _box(self, primitive: int) -> Array:
        """Return [8, 3] corners of the box around a primitive in local space."""
        row = self._scene.primitives[primitive]
        positions = self._scene.geometry.positions[row.base_vertex : row.base_vertex + row.vertex_count]
        if not len(positions):
            return np.full((8, 3), np.nan)
        ends = np.array([positions.min(axis=0), positions.max(axis=0)], np.float64)
        return np.stack(np.meshgrid(*ends.T, indexing="ij"), axis=-1).reshape(8, 3)

    def around(self, eyes: Array, heights: Array, turn: float = 0.0) -> Surroundings:
        """Find the nearest opaque surfaces along the axes around `eyes` [N, 3].

        `turn`: angle in radians by which the axes are turned about the vertical, from +z towards +x.
        """
        surroundings = Surroundings.nothing(len(eyes))
        boxes = [self._box(index) for index in range(len(self._local))]
        sine, cosine = math.sin(turn), math.cos(turn)
        turned = np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])
        eyes, transforms = eyes @ turned.T, turned @ self._transforms[:, :3]
        for instance in np.nonzero(self._opaque)[0].tolist():
            primitive, matrix = int(self._scene.instances.primitive[instance]), transforms[instance]
            box = boxes[primitive] @ matrix[:, :3].T + matrix[:, 3]
            within = (eyes >= box.min(axis=0)) & (eyes <= box.max(axis=0))
            over = [np.nonzero(within[:, (axis + 1) % 3] & within[:, (axis + 2) % 3])[0] for axis in range(3)]
            if not any(len(indices) for indices in over):
                continue
            corners = self._corners(primitive) @ matrix[:, :3].T + matrix[:, 3]
            ranges = [value_range(np.ascontiguousarray(corners[:, :, axis].T)) for axis in range(3)]
            for axis in range(3):
                (low_p, high_p), (low_q, high_q) = ranges[(axis + 1) % 3], ranges[(axis + 2) % 3]
                for index in over[axis].tolist():
                    eye = eyes[index]
                    p, q = float(eye[(axis + 1) % 3]), float(eye[(axis + 2) % 3])
                    met = np.nonzero((low_p <= p) & (high_p >= p) & (low_q <= q) & (high_q >= q))[0]
                    if len(met):
                        offsets, along = crossings(corners[met] - eye, axis)
                        along ^= bool(self._mirrored[instance])
                        sided = bool(self._double_sided[instance])
                        surroundings.add(axis, index, offsets, along, sided, float(heights[index]))
        return surroundings

    def free_distances(self, eyes: Array, heights: Array) -> Array:
        """Return [N, DIRECTIONS] distances from `eyes` [N, 3] to the nearest opaque surface in each level direction.

        Direction i is i / DIRECTIONS of a turn from +z towards +x. A distance is infinite where there is no surface, and 0 where the
        nearest one shows its culled back.
        """
        quarter = DIRECTIONS // 4
        distances = np.zeros((len(eyes), DIRECTIONS))
        for index in range(quarter):
            around = self.around(eyes, heights, 2.0 * math.pi * index / DIRECTIONS)
            distance = np.where(around.back & ~around.double_sided, 0.0, around.distance)
            for number, (axis, side) in enumerate(((2, 0), (0, 0), (2, 1), (0, 1))):
                distances[:, index + number * quarter] = distance[axis, side]
        return distances
