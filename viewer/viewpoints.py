"""Viewpoints sampled in a scene without cameras: where a person would stand, and where an object is shown from."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ntc.divergence import BLOCK
from ntc.errors import InputError
from ntc.grouping.seen_blocks import seen_blocks
from viewer.camera import clip_distances
from viewer.scene.model import Camera, Scene

Array = NDArray[np.float64]
See = Callable[[Camera, tuple[int, int]], NDArray[np.int32]]
"""Draws the texture ids [H, W] int32 (-1 for none, row 0 on top) that a camera sees at a size (width, height)."""

EYE_HEIGHT = 1.7
"""Metres above the ground."""
METRES = (5.0, 250.0)
"""A scene whose longest side lies between these is taken to be measured in metres."""
PERHAPS_METRES = 2000.0
"""One that is longer, up to this, may be a city or a small place in other units: views of both are drawn."""
EYE_HEIGHT_SHARES = (0.01, 0.1)
"""Elsewhere eye heights are drawn between these shares of the longest side."""
HIGH_UP = 4.0
"""Who has another ground this many eye heights below stands on a roof or the like."""
SPARE_POINTS = 3
"""Places drawn for each that is used, so that bad ones can be left out."""
LEAST_UP = 0.7
"""Cosine between the vertical and the normal of ground that can be stood on."""
PITCH_DEGREES = (-20.0, 10.0)
ELEVATION_DEGREES = (5.0, 45.0)
CLOSE_PITCH_DEGREES = (-10.0, 45.0)
CLOSE_DISTANCES = (0.8, 4.0)
"""Distances of close views from what they look at, in eye heights."""
WALKING_AND_CLOSE_SHARES = (0.5, 0.3)
"""Shares of the candidates that walk, and that look closely; the others go around the scene."""
ORBITS_TRIED = 4
"""Views from around the scene that are drawn in any case; more only where there are fewer than..."""
ENOUGH = 2
"""... this many good views for each one asked for."""
ORBIT_DISTANCES = (0.6, 1.0)
"""Distances of views from around the scene, as shares of that from which all of it fits into the picture."""
ORBIT_SCALE = 0.25
"""What stands for the eye height of such views, as a share of the longest side."""
TOO_NEAR = 0.35
"""Nothing that fills the picture may be nearer to the eye than this many eye heights."""
TOO_NEAR_SHARE = 0.1
"""Share of the picture that may be."""
CHUNK = 1 << 20
"""Triangles that are transformed at once."""
SAMPLES = 4000
"""Points on textured surfaces by which the promise of a place is told before it is drawn."""
PROMISING_DISTANCE = 12.0
"""Such points count up to this many eye heights away, ..."""
PROMISING_COSINE = 0.75
"""... and within this cosine of the view's direction."""
PROMISE_BLUR = (0.3, 1.0)
"""Promise is multiplied by a random number between these, lest all candidates crowd in one place."""
ASIDE = 0.7
"""Close views look at a surface from its normal plus this much of a random level direction."""
SAME_PLACE = 1.0
"""Views closer than this many eye heights, and alike in direction, are one view."""
SAME_DIRECTION = math.cos(math.radians(30.0))
TEXTURE_WEIGHT = 8.0
"""What it counts to see a texture, against seeing a pair of textures in one block."""


@dataclass(frozen=True)
class ViewpointConfig:
    """How viewpoints are sampled."""

    count: int = 24
    """Most viewpoints returned."""
    seed: int = 0
    candidates_per_view: int = 6
    """Views drawn for each one asked for."""
    size: tuple[int, int] = (160, 90)
    """Width and height in pixels of the pictures that candidates are judged by."""
    fov_degrees: float = 60.0


@dataclass(frozen=True)
class _Rules:
    """What a candidate must fulfil."""

    least_covered: float
    """Share of the picture that shows textures."""
    most_of_one: float
    """Share of the picture that one texture may fill."""
    least_textures: int = 2


RULES = (
    _Rules(0.4, 0.7),
    _Rules(0.25, 0.8),
    _Rules(0.1, 0.85),
    _Rules(0.15, 0.8, 1),
    _Rules(0.02, 1.0, least_textures=1),
)
"""Relaxed in this order; views of one texture serve only where nothing fulfils the rules before."""


@dataclass(frozen=True, eq=False)
class _Points:
    """Points on surfaces."""

    points: Array
    """[N, 3]."""
    normals: Array
    """[N, 3] of length 1, to the side that is seen."""
    textures: NDArray[np.int64]
    """[N] texture ids, -1 for none."""


class _Ground:
    """The triangles of a scene in world space, of which points are drawn by area; never all held at once."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        transforms = scene.instances.transform.astype(np.float64)
        linear = transforms[:, :3, :3]
        # The matrix that carries area vectors over: its columns are cross products of the transform's columns.
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
        # Nobody stands on leaves or glass where there is anything else.
        if (self.up_area * self._opaque).any():
            self.up_area = self.up_area * self._opaque

    def _corners(self, primitive: int) -> Array:
        """[T, 3, 3] corners in local space."""
        row, geometry = self._scene.primitives[primitive], self._scene.geometry
        indices = geometry.indices[row.first_index : row.first_index + row.index_count].astype(np.int64)
        return (
            geometry.positions[row.base_vertex + indices[: len(indices) // 3 * 3]].reshape(-1, 3, 3).astype(np.float64)
        )

    def _local_areas(self, primitive: int) -> Array:
        """[T, 3] vectors along the normals, as long as twice the areas."""
        corners = self._corners(primitive)
        return np.nan_to_num(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))

    def _areas(self, instances: NDArray[np.int64], primitive: int) -> tuple[Array, Array]:
        """[K, T] areas of the triangles of instances of one primitive; the same, 0 where one cannot stand."""
        vectors = np.einsum("kij,tj->kti", self._area_matrix[instances], self._local[primitive])
        areas = np.linalg.norm(vectors, axis=2)
        up = np.where(self._mirrored[instances][:, None], -vectors[:, :, 1], vectors[:, :, 1])
        # A back is not drawn: who stands on it sees the scene from below its ground.
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

    def points(self, random: np.random.Generator, weights: Array, count: int, up_only: bool) -> "_Points":
        """`count` points, instances drawn by `weights` and triangles by area."""
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
        return _Points(points, normals, self.texture[chosen])

    def _box(self, primitive: int) -> Array:
        """[8, 3] corners of the box around a primitive in local space."""
        row = self._scene.primitives[primitive]
        positions = self._scene.geometry.positions[row.base_vertex : row.base_vertex + row.vertex_count]
        if not len(positions):
            return np.full((8, 3), np.nan)
        ends = np.array([positions.min(axis=0), positions.max(axis=0)], np.float64)
        return np.stack(np.meshgrid(*ends.T, indexing="ij"), axis=-1).reshape(8, 3)

    def around(self, eyes: Array, heights: Array) -> "_Around":
        """What opaque surfaces are met on the lines through `eyes` [N, 3] along the axes."""
        found = _Around.nothing(len(eyes))
        boxes = [self._box(index) for index in range(len(self._local))]
        for instance in np.nonzero(self._opaque)[0].tolist():
            primitive, matrix = int(self._scene.instances.primitive[instance]), self._transforms[instance]
            box = boxes[primitive] @ matrix[:3, :3].T + matrix[:3, 3]
            within = (eyes >= box.min(axis=0)) & (eyes <= box.max(axis=0))
            over = [np.nonzero(within[:, (axis + 1) % 3] & within[:, (axis + 2) % 3])[0] for axis in range(3)]
            if not any(len(indices) for indices in over):
                continue
            corners = self._corners(primitive) @ matrix[:3, :3].T + matrix[:3, 3]
            ranges = [_range(np.ascontiguousarray(corners[:, :, axis].T)) for axis in range(3)]
            for axis in range(3):
                (low_p, high_p), (low_q, high_q) = ranges[(axis + 1) % 3], ranges[(axis + 2) % 3]
                for index in over[axis].tolist():
                    eye = eyes[index]
                    p, q = float(eye[(axis + 1) % 3]), float(eye[(axis + 2) % 3])
                    met = np.nonzero((low_p <= p) & (high_p >= p) & (low_q <= q) & (high_q >= q))[0]
                    if len(met):
                        offsets, along = _crossings(corners[met] - eye, axis)
                        along ^= bool(self._mirrored[instance])
                        sided = bool(self._double_sided[instance])
                        found.add(axis, index, offsets, along, sided, float(heights[index]))
        return found


def _range(values: Array) -> tuple[Array, Array]:
    """[T] least and greatest of each triangle, of `values` [3, T] of its corners."""
    return np.minimum(np.minimum(*values[:2]), values[2]), np.maximum(np.maximum(*values[:2]), values[2])


def _crossings(corners: Array, axis: int) -> tuple[Array, NDArray[np.bool_]]:
    """Where on an axis triangles [T, 3, 3] cross it, and whether they face along it."""
    p, q = corners[:, :, (axis + 1) % 3], corners[:, :, (axis + 2) % 3]
    # Twice the areas that the origin makes with each side, seen along the axis: all of one sign inside.
    areas = p * np.roll(q, -1, axis=1) - q * np.roll(p, -1, axis=1)
    whole = areas.sum(axis=1)
    inside = ((areas >= 0.0).all(axis=1) | (areas <= 0.0).all(axis=1)) & (whole != 0.0)
    # Side i is opposite to corner i + 2.
    shares = np.roll(areas[inside], -1, axis=1) / whole[inside, None]
    return (shares * corners[inside, :, axis]).sum(axis=1), whole[inside] > 0.0


@dataclass(frozen=True, eq=False)
class _Around:
    """The nearest opaque surfaces of places [N] along each axis: [3, 2, N], first forwards, then backwards."""

    distance: Array
    """To the surface; infinite without one."""
    back: NDArray[np.bool_]
    """Whether it turns its back."""
    double_sided: NDArray[np.bool_]
    """Whether that is drawn."""
    high_up: NDArray[np.bool_]
    """[N] whether another ground lies far below."""

    @staticmethod
    def nothing(count: int) -> "_Around":
        """No surface anywhere."""
        flags = np.zeros((3, 2, count), bool)
        return _Around(np.full((3, 2, count), np.inf), flags, flags.copy(), np.zeros(count, bool))

    def add(
        self, axis: int, index: int, offsets: Array, along: NDArray[np.bool_], double_sided: bool, height: float
    ) -> None:
        """Count surfaces that are `offsets` [M] along `axis` from place `index`; `along` tells which face that way."""
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
        """[N] whether the place is under the ground or inside of something."""
        above, below = np.isfinite(self.distance[1])
        unseen = (self.back & ~self.double_sided)[1].any(axis=0)
        return np.asarray(unseen | self.back[1].all(axis=0) | (above & ~below))

    def behind_walls(self) -> NDArray[np.bool_]:
        """[N] whether it is behind a wall whose back is not drawn, so that one would look through it."""
        return np.asarray((self.back & ~self.double_sided)[[0, 2]].any(axis=(0, 1)))

    def on_top(self) -> NDArray[np.bool_]:
        """[N] whether it is on a roof or the like: under the sky, far above another ground."""
        return self.high_up & self.open_sky()

    def open_sky(self) -> NDArray[np.bool_]:
        """[N] whether nothing is above."""
        return ~np.isfinite(self.distance[1, 0])


def _direction(turn: Array, pitch: Array) -> Array:
    """[N, 3] unit vectors; angles in radians."""
    level = np.cos(pitch)
    return np.stack([level * np.sin(turn), np.sin(pitch), level * np.cos(turn)], axis=1)


def _log_uniform(random: np.random.Generator, between: tuple[float, float], count: int) -> Array:
    low, high = math.log(between[0]), math.log(between[1])
    return np.exp(random.uniform(low, high, count))


def _eye_heights(random: np.random.Generator, extent: float, count: int) -> Array:
    shares = extent * _log_uniform(random, EYE_HEIGHT_SHARES, count)
    if METRES[0] <= extent <= METRES[1]:
        return np.full(count, EYE_HEIGHT)
    if METRES[1] < extent <= PERHAPS_METRES:
        return np.where(np.arange(count) % 2 == 0, EYE_HEIGHT, shares)
    return np.asarray(shares)


@dataclass(frozen=True)
class _Candidate:
    """A camera that may be chosen."""

    camera: Camera
    scale: float
    """Its eye height: what near and far are measured by."""

    def alike(self, other: "_Candidate") -> bool:
        """Whether both look from one place in one direction."""
        first, second = (np.array([one.camera.eye, one.camera.target]) for one in (self, other))
        near = np.linalg.norm(first[0] - second[0]) < SAME_PLACE * max(self.scale, other.scale)
        ways = [(pair[1] - pair[0]) / np.linalg.norm(pair[1] - pair[0]) for pair in (first, second)]
        return bool(near and ways[0] @ ways[1] > SAME_DIRECTION)


def _cameras(eyes: Array, targets: Array, scales: Array, fov: float) -> list[_Candidate]:
    return [
        _Candidate(Camera("candidate", tuple(eye), tuple(target), fov_degrees=fov), scale)
        for eye, target, scale in zip(eyes.tolist(), targets.tolist(), scales.tolist(), strict=True)
    ]


class _Places:
    """Draws eyes and targets inside of a scene, more than are used, and keeps the promising ones."""

    def __init__(self, ground: _Ground, random: np.random.Generator, extent: float, fov: float) -> None:
        self._ground, self._random, self._extent, self._fov = ground, random, extent, fov
        textured, texture = ground.textured_area, np.maximum(ground.texture, 0)
        of_texture = np.bincount(texture, textured)[texture]
        self._weights = np.divide(textured, of_texture, out=np.zeros_like(textured), where=of_texture > 0.0)
        self._samples = ground.points(random, self._weights, SAMPLES, up_only=False)

    def _promise(self, eyes: Array, targets: Array, heights: Array) -> Array:
        """[N] textures that have a piece near and before each eye, hidden or not, blurred by chance."""
        ways = (targets - eyes) / np.linalg.norm(targets - eyes, axis=1, keepdims=True)
        promise = np.zeros(len(eyes))
        for index, (eye, way, height) in enumerate(zip(eyes, ways, heights.tolist(), strict=True)):
            to = self._samples.points - eye
            distance = np.linalg.norm(to, axis=1)
            before = (to @ way > PROMISING_COSINE * distance) & (distance < PROMISING_DISTANCE * height)
            promise[index] = len(np.unique(self._samples.textures[before]))
        return (1.0 + promise) * self._random.uniform(*PROMISE_BLUR, len(eyes))

    def _kept(self, eyes: Array, targets: Array, heights: Array, low_first: bool, count: int) -> list[_Candidate]:
        around = self._ground.around(eyes, heights)
        promise = self._promise(eyes, targets, heights)
        last = np.zeros(len(eyes), bool)
        if low_first:
            grounds = eyes[:, 1] - heights
            last = around.on_top() | (around.open_sky() & (grounds > np.median(grounds) + HIGH_UP * heights))
        # A roof is better than nothing and so is a shell of walls, a grave is not.
        order = np.lexsort((-promise, last, around.behind_walls()))
        best = order[~around.buried()[order]][:count]
        return _cameras(eyes[best], targets[best], heights[best], self._fov)

    def walking(self, count: int) -> list[_Candidate]:
        """Views of somebody who stands somewhere and looks about."""
        ground, random = self._ground, self._random
        if not ground.up_area.any():
            return []
        points = count * SPARE_POINTS
        heights = _eye_heights(random, self._extent, points)
        eyes = ground.points(random, ground.up_area, points, up_only=True).points
        eyes[:, 1] += heights
        turn, pitch = random.uniform(0.0, 2.0 * np.pi, points), random.uniform(*PITCH_DEGREES, points)
        targets = eyes + _direction(turn, np.radians(pitch)) * heights[:, None]
        return self._kept(eyes, targets, heights, True, count)

    def close(self, count: int) -> list[_Candidate]:
        """Views of a place on each texture from nearby; every texture is looked at equally often."""
        random, points = self._random, count * SPARE_POINTS
        targets = self._ground.points(random, self._weights, points, up_only=False)
        heights = _eye_heights(random, self._extent, points)
        away = targets.normals + ASIDE * _direction(random.uniform(0.0, 2.0 * np.pi, points), np.zeros(points))
        pitch = np.arctan2(away[:, 1], np.hypot(away[:, 0], away[:, 2]))
        pitch = np.clip(pitch, *np.radians(CLOSE_PITCH_DEGREES))
        away = _direction(np.arctan2(away[:, 0], away[:, 2]), pitch)
        distance = heights * _log_uniform(random, CLOSE_DISTANCES, points)
        return self._kept(targets.points + away * distance[:, None], targets.points, heights, False, count)


def _orbit(
    scene: Scene, random: np.random.Generator, extent: float, count: int, config: ViewpointConfig
) -> list[_Candidate]:
    """Views from around the scene that it fills."""
    fov, aspect = config.fov_degrees, config.size[0] / config.size[1]
    low, high = scene.bounds.astype(np.float64)
    centre, half = (low + high) / 2.0, np.maximum((high - low) / 2.0, extent * 1e-3)
    targets = centre + random.uniform(-0.25, 0.25, (count, 3)) * half
    way = _direction(random.uniform(0.0, 2.0 * np.pi, count), np.radians(random.uniform(*ELEVATION_DEGREES, count)))
    # As near as the frame allows to hold the corners of the box, or nearer.
    signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(8, 3)
    corners = centre + signs * half - targets[:, None]
    right = _direction(np.arctan2(way[:, 0], way[:, 2]) + np.pi / 2.0, np.zeros(count))
    aside = np.abs(np.einsum("nci,ni->nc", corners, right)) / aspect
    above = np.abs(np.einsum("nci,ni->nc", corners, np.cross(way, right)))
    behind = np.einsum("nci,ni->nc", corners, way)
    fitting = (behind + np.maximum(aside, above) / math.tan(math.radians(fov) / 2.0)).max(axis=1)
    distance = fitting * random.uniform(*ORBIT_DISTANCES, count)
    scales = np.full(count, extent * ORBIT_SCALE)
    return _cameras(targets + way * distance[:, None], targets, scales, fov)


@dataclass(frozen=True, eq=False)
class _View:
    """A candidate and what it shows."""

    candidate: _Candidate
    ids: NDArray[np.int32]
    """[H, W] texture ids."""
    covered: float
    """Share of the picture that shows textures."""
    dominant: float
    """Share that shows the texture which is seen most."""
    textures: int
    features: NDArray[np.int64]
    """Numbers of the textures and of the pairs of textures that are seen, and..."""
    amounts: Array
    """... the blocks in which each is."""

    @staticmethod
    def of(candidate: _Candidate, ids: NDArray[np.int32], textures: int) -> "_View":
        """`candidate` in a scene of `textures` textures, of which it sees `ids`."""
        pixels = np.bincount(ids[ids >= 0], minlength=textures)
        seen = np.nonzero(pixels)[0]
        together = seen_blocks([ids], textures)
        members = together.members
        pairs = sparse.coo_array(sparse.triu(members.T @ members.multiply(together.weights[:, None]), 1))
        features = np.concatenate([seen, textures + pairs.row.astype(np.int64) * textures + pairs.col])
        amounts = np.concatenate([pixels[seen] / (BLOCK[0] * BLOCK[1]), pairs.data])
        covered, dominant = float(pixels.sum()) / ids.size, float(pixels.max(initial=0)) / ids.size
        return _View(candidate, ids, covered, dominant, len(seen), features, amounts)

    def fulfils(self, rules: _Rules) -> bool:
        """Whether it is good enough."""
        return (
            self.covered >= rules.least_covered
            and self.dominant <= rules.most_of_one
            and self.textures >= rules.least_textures
        )


class _Pictures:
    """Draws what candidates see."""

    def __init__(self, see: See, size: tuple[int, int], scene: Scene) -> None:
        self._see, self._size, self._bounds, self._textures = see, size, scene.bounds, len(scene.textures)

    def views(self, candidates: Sequence[_Candidate]) -> list[_View]:
        """Those of `candidates` that see a texture."""
        seen = [_View.of(one, self._see(one.camera, self._size), self._textures) for one in candidates]
        return [view for view in seen if view.textures]

    def stands_free(self, view: _View) -> bool:
        """Whether nothing right before the eye hides what is behind it: without what is near it sees much the same."""
        camera = view.candidate.camera
        near, far = clip_distances(camera, self._bounds)
        clear = TOO_NEAR * view.candidate.scale
        if near >= clear:
            return True
        cut = self._see(replace(camera, near=clear, far=max(far, 2.0 * clear)), self._size)
        return float((cut != view.ids).mean()) <= TOO_NEAR_SHARE


class _Shown:
    """How much of each texture and pair of textures the views chosen so far show, and what others would add."""

    def __init__(self, views: Sequence[_View], textures: int) -> None:
        used, columns = np.unique(np.concatenate([view.features for view in views]), return_inverse=True)
        starts = np.cumsum([0, *(len(view.features) for view in views)])
        amounts = np.concatenate([view.amounts for view in views])
        self._amounts = sparse.csr_array((amounts, columns, starts), shape=(len(views), len(used)))
        self._weights = np.where(used < textures, TEXTURE_WEIGHT, 1.0)
        self._shown = np.zeros(len(used))

    def gains(self) -> Array:
        """[views] what each would add; of what is shown already, ever less. Every view shows something."""
        rows = self._amounts
        before = self._shown[rows.indices]
        each = (np.log1p(before + rows.data) - np.log1p(before)) * self._weights[rows.indices]
        return np.asarray(np.add.reduceat(each, rows.indptr[:-1]))

    def add(self, index: int) -> None:
        """View `index` is chosen."""
        row = slice(*self._amounts.indptr[index : index + 2])
        self._shown[self._amounts.indices[row]] += self._amounts.data[row]


def _choose(views: Sequence[_View], pictures: _Pictures, count: int, textures: int) -> list[_Candidate]:
    """At most `count` candidates, one after the other each that adds most; those that fulfil the strictest rules first."""
    shown = _Shown(views, textures)
    chosen: list[_Candidate] = []
    refused: set[int] = set()
    for rules in RULES:
        if rules.least_textures < 2 and chosen:
            break
        while len(chosen) < count:
            waiting = [i for i, view in enumerate(views) if i not in refused and view.fulfils(rules)]
            if not waiting:
                break
            best = waiting[int(np.argmax(shown.gains()[waiting]))]
            refused.add(best)
            candidate = views[best].candidate
            if not any(candidate.alike(other) for other in chosen) and pictures.stands_free(views[best]):
                shown.add(best)
                chosen.append(candidate)
    return chosen


def sample_viewpoints(scene: Scene, see: See, config: ViewpointConfig) -> tuple[Camera, ...]:
    """At most `config.count` cameras named "sampled_01" and so on, the most telling first; the same seed gives the same.

    Raises InputError where no viewpoint sees a texture.
    """
    if config.count < 1:
        raise InputError(f"viewpoints: count {config.count}; ask for one or more")
    nothing = InputError(f"{scene.name}: no viewpoint sees a texture; name a file of cameras by --views")
    ground = _Ground(scene)
    if not ground.textured_area.any():
        raise nothing
    random = np.random.default_rng(config.seed)
    extent = float((scene.bounds[1] - scene.bounds[0]).max())
    pictures = _Pictures(see, config.size, scene)
    total = config.count * config.candidates_per_view
    walking, close = (math.ceil(total * share) for share in WALKING_AND_CLOSE_SHARES)
    places = _Places(ground, random, extent, config.fov_degrees)
    views = pictures.views([*places.walking(walking), *places.close(close)])
    around = _orbit(scene, random, extent, max(total - walking - close, ORBITS_TRIED), config)
    views += pictures.views(around[:ORBITS_TRIED])
    # A town that can be walked in need not be seen from outside: that is the slowest to draw and shows the backs of it.
    if sum(view.fulfils(RULES[0]) for view in views) < ENOUGH * config.count:
        views += pictures.views(around[ORBITS_TRIED:])
    chosen = _choose(views, pictures, config.count, len(scene.textures)) if views else []
    if not chosen:
        raise nothing
    return tuple(replace(one.camera, name=f"sampled_{number:02}") for number, one in enumerate(chosen, 1))
