"""Viewpoints sampled in a scene: random candidates, and a greedy choice among them.

A grouping is optimised for pictures, and a scene without cameras has none. `sample_viewpoints` makes them in three steps:

1. Draw random places of three kinds: at eye height on the ground, close to textured surfaces, and around the scene. Of OVERSAMPLING
   times as many as needed, take those with most textures in a cone before the eye. That estimate ignores occlusion and is cheap.
2. Render the texture ids of each candidate at low resolution. The features of a view are its textures, and the pairs of textures
   that share a framebuffer block: such a pair costs divergence unless both textures have one decoder.
3. Add, one at a time, the view that most increases F = sum over features of w log(1 + blocks that show the feature). F is monotone and
   submodular, so that greedy choice alone reaches 1 - 1/e of its maximum (Nemhauser, Wolsey and Fisher 1978). Criteria from strict
   to loose, near duplicates and obstructed views restrict it further, without such a bound.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.metrics.divergence import BLOCK
from viewer.scene.model import Camera, Scene
from viewer.state.camera import clip_distances
from viewer.viewpoints.surfaces import DIRECTIONS, HIGH_UP, Surfaces

Array = NDArray[np.float64]
EYE_HEIGHT = 1.7
"""Eye height above the ground in metres."""
METRES = (5.0, 250.0)
"""Range of the longest side of a scene whose unit is assumed to be the metre."""
POSSIBLY_METRES = 2000.0
"""Longest side up to which a scene may be a city in metres or a small place in other units. Candidates for both are drawn."""
EYE_HEIGHT_SHARES = (0.01, 0.1)
"""Range of eye heights where the unit is unknown, as shares of the longest side."""
OVERSAMPLING = 3
"""Number of places drawn for each candidate; those with the highest estimated score are rendered."""
PITCH_DEGREES = (-20.0, 10.0)
ELEVATION_DEGREES = (5.0, 45.0)
CLOSE_PITCH_DEGREES = (-10.0, 45.0)
CLOSE_DISTANCES = (0.8, 4.0)
"""Distances of close views from their targets, in eye heights."""
ORBIT_DISTANCES = (0.6, 1.0)
"""Distances of views around the scene, as shares of the distance at which all of it fits into the picture."""
ORBIT_SCALE = 0.25
"""Eye height of views around the scene, as a share of the longest side."""
SAMPLES = 4000
"""Number of points on textured surfaces that estimate the score of a place before it is rendered."""
SCORE_DISTANCE = 12.0
"""Distance in eye heights beyond which points do not count."""
SCORE_COSINE = 0.75
"""Cosine of the cone about the view's direction outside of which points do not count."""
SCORE_JITTER = (0.3, 1.0)
"""Range of the random factor of scores, so that candidates do not crowd in one place."""
SIDEWAYS = 0.7
"""Share of a random horizontal direction that is added to the surface normal for close views."""
DUPLICATE_DISTANCE = 1.0
"""Distance in eye heights below which views with directions within DUPLICATE_COSINE count as one."""
DUPLICATE_COSINE = math.cos(math.radians(30.0))


FLOOR_TOLERANCE = 0.5
"""Largest height in metres of a floor or of ground outdoors above the median floor. Higher ground is a table or a roof."""
LEAST_INDOORS = 0.5
"""Share of the low ground that must lie in rooms for a scene to be an interior."""
LEAST_OF_ALL = 0.25
"""Share of all ground, tables and roofs included, that must lie in rooms for a scene to be an interior."""
INDOOR_POINTS = 64
"""Number of sampled points on the ground that decide whether a scene is an interior."""
LEAST_WALLED = 0.75
"""Share of the level directions in which a room must have a wall."""
ROOM_HEIGHTS = (2.0, 8.0)
"""Range of the heights of rooms in metres."""
UNITS = (1.0, 100.0)
"""Scene units per metre in interiors: 1 where the unit is glTF's metre, 100 where it is the centimetre."""
INDOOR_SLOPE = 0.12
"""Slope downwards of views in rooms, so that the floor is in the picture."""
CLEARANCE = 0.35
"""Distance in eye heights below which surfaces obstruct the view."""


@dataclass(frozen=True)
class ViewpointConfig:
    """Settings of the sampling of viewpoints."""

    count: int = 24
    """Largest number of viewpoints returned."""
    seed: int = 0
    candidates_per_view: int = 6
    """Number of candidates rendered for each viewpoint returned."""
    size: tuple[int, int] = (160, 90)
    """Width and height in pixels of the rendered pictures of candidates."""
    fov_degrees: float = 60.0


def _direction(turn: Array, pitch: Array) -> Array:
    """Return [N, 3] unit vectors of directions given by `turn` [N] about the vertical and `pitch` [N], in radians."""
    level = np.cos(pitch)
    return np.stack([level * np.sin(turn), np.sin(pitch), level * np.cos(turn)], axis=1)


def _log_uniform(random: np.random.Generator, between: tuple[float, float], count: int) -> Array:
    low, high = math.log(between[0]), math.log(between[1])
    return np.exp(random.uniform(low, high, count))


def _eye_heights(random: np.random.Generator, extent: float, count: int) -> Array:
    shares = extent * _log_uniform(random, EYE_HEIGHT_SHARES, count)
    if METRES[0] <= extent <= METRES[1]:
        return np.full(count, EYE_HEIGHT)
    if METRES[1] < extent <= POSSIBLY_METRES:
        return np.where(np.arange(count) % 2 == 0, EYE_HEIGHT, shares)
    return np.asarray(shares)


@dataclass(frozen=True)
class Candidate:
    """Candidate viewpoint: a camera that may be chosen."""

    camera: Camera
    scale: float
    """Eye height in scene units. Distances of the criteria are multiples of it."""

    def duplicates(self, other: "Candidate") -> bool:
        """Return whether both cameras are within DUPLICATE_DISTANCE and DUPLICATE_COSINE of each other."""
        first, second = (np.array([one.camera.eye, one.camera.target]) for one in (self, other))
        near = np.linalg.norm(first[0] - second[0]) < DUPLICATE_DISTANCE * max(self.scale, other.scale)
        ways = [(pair[1] - pair[0]) / np.linalg.norm(pair[1] - pair[0]) for pair in (first, second)]
        return bool(near and ways[0] @ ways[1] > DUPLICATE_COSINE)


def candidates(eyes: Array, targets: Array, scales: Array, fov: float) -> list[Candidate]:
    """Return the candidates with `eyes` [N, 3], `targets` [N, 3] and `scales` [N]; `fov` is vertical, in degrees."""
    return [
        Candidate(Camera("candidate", tuple(eye), tuple(target), fov_degrees=fov), scale)
        for eye, target, scale in zip(eyes.tolist(), targets.tolist(), scales.tolist(), strict=True)
    ]


class CandidateSampler:
    """Sampler of viewpoints in a scene; it returns those with the highest estimated score."""

    def __init__(self, scene: Scene, config: ViewpointConfig, ground: Surfaces) -> None:
        """Prepare the sampling of `scene`, of which some surfaces in `ground` have a texture."""
        self._scene, self._config, self._ground = scene, config, ground
        self._random = np.random.default_rng(config.seed)
        self._extent = float((scene.bounds[1] - scene.bounds[0]).max())
        textured, texture = ground.textured_area, np.maximum(ground.texture, 0)
        of_texture = np.bincount(texture, textured)[texture]
        self._weights = np.divide(textured, of_texture, out=np.zeros_like(textured), where=of_texture > 0.0)
        self._samples = ground.points(self._random, self._weights, SAMPLES, up_only=False)

    @classmethod
    def of(cls, scene: Scene, config: ViewpointConfig) -> "CandidateSampler | None":
        """Return the sampler of a scene; None where no surface has a texture."""
        ground = Surfaces(scene)
        return cls(scene, config, ground) if ground.textured_area.any() else None

    def _scores(self, eyes: Array, targets: Array, heights: Array) -> Array:
        """Return [N] number of textures with a sample in front of each eye, occluded or not, times a random jitter."""
        ways = (targets - eyes) / np.linalg.norm(targets - eyes, axis=1, keepdims=True)
        scores = np.zeros(len(eyes))
        for index, (eye, way, height) in enumerate(zip(eyes, ways, heights.tolist(), strict=True)):
            to = self._samples.points - eye
            distance = np.linalg.norm(to, axis=1)
            before = (to @ way > SCORE_COSINE * distance) & (distance < SCORE_DISTANCE * height)
            scores[index] = len(np.unique(self._samples.textures[before]))
        return (1.0 + scores) * self._random.uniform(*SCORE_JITTER, len(eyes))

    def _best_candidates(
        self, eyes: Array, targets: Array, heights: Array, low_first: bool, count: int
    ) -> list[Candidate]:
        """Return at most `count` candidates, by score; `low_first` puts places on roofs last."""
        around = self._ground.around(eyes, heights)
        scores = self._scores(eyes, targets, heights)
        last = np.zeros(len(eyes), bool)
        if low_first:
            grounds = eyes[:, 1] - heights
            last = around.on_top() | (around.open_sky() & (grounds > np.median(grounds) + HIGH_UP * heights))
        # Roofs and places behind back-facing walls come last; places under the ground are left out.
        order = np.lexsort((-scores, last, around.behind_walls()))
        best = order[~around.buried()[order]][:count]
        return candidates(eyes[best], targets[best], heights[best], self._config.fov_degrees)

    def walking(self, count: int) -> list[Candidate]:
        """Sample at most `count` views from eye height above the ground, in random directions."""
        ground, random = self._ground, self._random
        if not ground.up_area.any():
            return []
        points = count * OVERSAMPLING
        heights = _eye_heights(random, self._extent, points)
        eyes = ground.points(random, ground.up_area, points, up_only=True).points
        eyes[:, 1] += heights
        turn, pitch = random.uniform(0.0, 2.0 * np.pi, points), random.uniform(*PITCH_DEGREES, points)
        targets = eyes + _direction(turn, np.radians(pitch)) * heights[:, None]
        return self._best_candidates(eyes, targets, heights, True, count)

    def indoors(self, count: int) -> list[Candidate]:
        """Return at most `count` views from eye height in rooms; empty where the scene is not an interior.

        A room is a place with walls in most level directions and a ceiling at one of ROOM_HEIGHTS, in one of UNITS. A scene is an
        interior by LEAST_INDOORS and LEAST_OF_ALL. Each view looks along its longest free distance, the longest first. The camera
        orbits the middle of that distance.
        """
        ground = self._ground
        if not ground.up_area.any():
            return []
        floors = ground.points(self._random, ground.up_area, INDOOR_POINTS, up_only=True).points
        # The test looks from just above the floor, because the eye may be in a table or above a low ceiling.
        around = ground.around(floors + np.array([0.0, 1e-3 * self._extent, 0.0]), np.ones(len(floors)))
        walls, rooms = np.isfinite(around.distance[[0, 2]]).mean(axis=(0, 1)), around.distance[1, 0]
        is_closed = (walls >= LEAST_WALLED) & ~around.buried()
        in_rooms = [is_closed & (rooms > unit * ROOM_HEIGHTS[0]) & (rooms < unit * ROOM_HEIGHTS[1]) for unit in UNITS]
        unit, inside = max(zip(UNITS, in_rooms, strict=True), key=lambda pair: int(pair[1].sum()))
        if not inside.any():
            return []
        is_low = floors[:, 1] <= np.median(floors[inside, 1]) + FLOOR_TOLERANCE * unit
        inside &= is_low
        outside = around.open_sky() & is_low
        if inside.sum() < LEAST_INDOORS * (inside | outside).sum() or inside.mean() < LEAST_OF_ALL:
            return []
        floors, heights = floors[inside], np.full(int(inside.sum()), EYE_HEIGHT * unit)
        eyes = floors + np.array([0.0, 1.0, 0.0]) * heights[:, None]
        free = ground.free_distances(eyes, heights)
        is_room = (np.isfinite(free).mean(axis=1) >= LEAST_WALLED) & (free.min(axis=1) >= CLEARANCE * heights)
        longest = np.where(np.isfinite(free), free, 0.0)
        order = np.argsort(-longest.max(axis=1))
        best = order[is_room[order]][:count]
        turn = longest[best].argmax(axis=1) * 2.0 * np.pi / DIRECTIONS
        way = _direction(turn, np.full(len(best), -math.atan(INDOOR_SLOPE)))
        targets = eyes[best] + way * longest[best].max(axis=1)[:, None] / 2.0
        return candidates(eyes[best], targets, heights[best], self._config.fov_degrees)

    def close(self, count: int) -> list[Candidate]:
        """Sample at most `count` close views of textured surfaces; every texture is targeted equally often."""
        random, points = self._random, count * OVERSAMPLING
        targets = self._ground.points(random, self._weights, points, up_only=False)
        heights = _eye_heights(random, self._extent, points)
        away = targets.normals + SIDEWAYS * _direction(random.uniform(0.0, 2.0 * np.pi, points), np.zeros(points))
        pitch = np.arctan2(away[:, 1], np.hypot(away[:, 0], away[:, 2]))
        pitch = np.clip(pitch, *np.radians(CLOSE_PITCH_DEGREES))
        away = _direction(np.arctan2(away[:, 0], away[:, 2]), pitch)
        distance = heights * _log_uniform(random, CLOSE_DISTANCES, points)
        return self._best_candidates(targets.points + away * distance[:, None], targets.points, heights, False, count)

    def around(self, count: int) -> list[Candidate]:
        """Sample `count` views from around the scene that show all or most of it."""
        random, fov = self._random, self._config.fov_degrees
        aspect = self._config.size[0] / self._config.size[1]
        low, high = self._scene.bounds.astype(np.float64)
        centre, half = (low + high) / 2.0, np.maximum((high - low) / 2.0, self._extent * 1e-3)
        targets = centre + random.uniform(-0.25, 0.25, (count, 3)) * half
        way = _direction(random.uniform(0.0, 2.0 * np.pi, count), np.radians(random.uniform(*ELEVATION_DEGREES, count)))
        # The distance at which the corners of the bounding box just fit into the frame.
        signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(8, 3)
        corners = centre + signs * half - targets[:, None]
        right = _direction(np.arctan2(way[:, 0], way[:, 2]) + np.pi / 2.0, np.zeros(count))
        aside = np.abs(np.einsum("nci,ni->nc", corners, right)) / aspect
        above = np.abs(np.einsum("nci,ni->nc", corners, np.cross(way, right)))
        behind = np.einsum("nci,ni->nc", corners, way)
        fitting = (behind + np.maximum(aside, above) / math.tan(math.radians(fov) / 2.0)).max(axis=1)
        distance = fitting * random.uniform(*ORBIT_DISTANCES, count)
        scales = np.full(count, self._extent * ORBIT_SCALE)
        return candidates(targets + way * distance[:, None], targets, scales, fov)


DrawTextureIds = Callable[[Camera, tuple[int, int]], NDArray[np.int32]]
"""Function: (camera, (width, height)) -> texture ids [H, W] int32, -1 for none, row 0 on top."""

MOST_OBSTRUCTED = 0.1
"""Largest share of the picture that obstructing surfaces may hide."""
TEXTURE_WEIGHT = 8.0
"""Weight of a visible texture, relative to that of a pair of textures that share a block."""


@dataclass(frozen=True)
class ViewCriteria:
    """Criteria that a candidate view must meet."""

    least_covered: float
    """Share of the picture that shows textures."""
    most_of_one: float
    """Share of the picture that one texture may fill."""
    least_textures: int = 2


CRITERIA = (
    ViewCriteria(0.4, 0.7),
    ViewCriteria(0.25, 0.8),
    ViewCriteria(0.1, 0.85),
    ViewCriteria(0.15, 0.8, 1),
    ViewCriteria(0.02, 1.0, least_textures=1),
)
"""Criteria from strict to loose; views of a single texture are taken only where nothing meets the criteria before."""


@dataclass(frozen=True, eq=False)
class CandidateView:
    """Candidate and the textures that are visible from it."""

    candidate: Candidate
    ids: NDArray[np.int32]
    """[H, W] texture ids."""
    covered: float
    """Share of the picture that shows textures."""
    dominant: float
    """Share of the most visible texture."""
    textures: int
    features: NDArray[np.int64]
    """[F] numbers of the features: visible textures, and pairs of textures that share a block."""
    amounts: Array
    """[F] number of blocks that show each feature."""

    @staticmethod
    def of(candidate: Candidate, ids: NDArray[np.int32], textures: int) -> "CandidateView":
        """Make the view with the texture ids `ids` [H, W] in a scene of `textures` textures."""
        pixels = np.bincount(ids[ids >= 0], minlength=textures)
        seen = np.nonzero(pixels)[0]
        from scipy import sparse

        from ntc.grouping.covisible import seen_blocks

        together = seen_blocks([ids], textures)
        members = together.members
        pairs = sparse.coo_array(sparse.triu(members.T @ members.multiply(together.weights[:, None]), 1))
        features = np.concatenate([seen, textures + pairs.row.astype(np.int64) * textures + pairs.col])
        amounts = np.concatenate([pixels[seen] / (BLOCK[0] * BLOCK[1]), pairs.data])
        covered, dominant = float(pixels.sum()) / ids.size, float(pixels.max(initial=0)) / ids.size
        return CandidateView(candidate, ids, covered, dominant, len(seen), features, amounts)

    def meets(self, criteria: ViewCriteria) -> bool:
        """Return whether the view shows enough textures, and no texture fills too much of it."""
        return (
            self.covered >= criteria.least_covered
            and self.dominant <= criteria.most_of_one
            and self.textures >= criteria.least_textures
        )


class CandidateRenderer:
    """Renderer of the texture ids of candidates."""

    def __init__(self, draw_ids: DrawTextureIds, size: tuple[int, int], scene: Scene) -> None:
        self._draw_ids, self._size, self._bounds, self._textures = draw_ids, size, scene.bounds, len(scene.textures)

    def views(self, candidates: Sequence[Candidate]) -> list[CandidateView]:
        """Return the views of `candidates` that show a texture."""
        seen = [CandidateView.of(one, self._draw_ids(one.camera, self._size), self._textures) for one in candidates]
        return [view for view in seen if view.textures]

    def is_unobstructed(self, view: CandidateView) -> bool:
        """Return whether surfaces closer than CLEARANCE hide at most MOST_OBSTRUCTED of the picture."""
        camera = view.candidate.camera
        near, far = clip_distances(camera, self._bounds)
        clear = CLEARANCE * view.candidate.scale
        if near >= clear:
            return True
        cut = self._draw_ids(replace(camera, near=clear, far=max(far, 2.0 * clear)), self._size)
        return float((cut != view.ids).mean()) <= MOST_OBSTRUCTED


class _Coverage:
    """Coverage of features by the chosen views, in blocks, and the gain of each further view."""

    def __init__(self, views: Sequence[CandidateView], textures: int) -> None:
        from scipy import sparse

        used, columns = np.unique(np.concatenate([view.features for view in views]), return_inverse=True)
        starts = np.cumsum([0, *(len(view.features) for view in views)])
        amounts = np.concatenate([view.amounts for view in views])
        self._amounts = sparse.csr_array((amounts, columns, starts), shape=(len(views), len(used)))
        self._weights = np.where(used < textures, TEXTURE_WEIGHT, 1.0)
        self._blocks = np.zeros(len(used))

    def gains(self) -> Array:
        """Return [views] the gain of each view: logarithmic in the blocks, because repeated content adds little."""
        rows = self._amounts
        before = self._blocks[rows.indices]
        each = (np.log1p(before + rows.data) - np.log1p(before)) * self._weights[rows.indices]
        return np.asarray(np.add.reduceat(each, rows.indptr[:-1]))

    def add(self, index: int) -> None:
        """Count view `index` as chosen."""
        row = slice(*self._amounts.indptr[index : index + 2])
        self._blocks[self._amounts.indices[row]] += self._amounts.data[row]


def choose(views: Sequence[CandidateView], renderer: CandidateRenderer, count: int, textures: int) -> list[Candidate]:
    """Choose at most `count` candidates greedily by their gain; those that meet the strictest criteria come first."""
    coverage = _Coverage(views, textures)
    chosen: list[Candidate] = []
    refused: set[int] = set()
    for criteria in CRITERIA:
        if criteria.least_textures < 2 and chosen:
            break
        while len(chosen) < count:
            waiting = [i for i, view in enumerate(views) if i not in refused and view.meets(criteria)]
            if not waiting:
                break
            best = waiting[int(np.argmax(coverage.gains()[waiting]))]
            refused.add(best)
            candidate = views[best].candidate
            if not any(candidate.duplicates(other) for other in chosen) and renderer.is_unobstructed(views[best]):
                coverage.add(best)
                chosen.append(candidate)
    return chosen


WALKING_AND_CLOSE_SHARES = (0.5, 0.3)
"""Shares of the candidates at eye height and close to surfaces; the others are around the scene."""
ORBITS_TRIED = 4
"""Number of views around the scene that are always rendered. The others are rendered only where good views are few."""
ENOUGH = 2
"""Number of good views per requested view from which no further views around the scene are rendered."""


def sample_viewpoints(scene: Scene, draw_ids: DrawTextureIds, config: ViewpointConfig) -> tuple[Camera, ...]:
    """Sample at most `config.count` cameras named "sampled_01" and so on, by decreasing gain; equal seeds give equal cameras.

    The module's head describes the steps. Raises InputError where no viewpoint sees a texture.
    """
    if config.count < 1:
        raise InputError(f"viewpoints: count {config.count}; ask for one or more")
    nothing = InputError(f"{scene.name}: no viewpoint sees a texture; give a file of cameras by --views")
    places = CandidateSampler.of(scene, config)
    if places is None:
        raise nothing
    renderer = CandidateRenderer(draw_ids, config.size, scene)
    total = config.count * config.candidates_per_view
    walking, close = (math.ceil(total * share) for share in WALKING_AND_CLOSE_SHARES)
    views = renderer.views([*places.walking(walking), *places.close(close)])
    around = places.around(max(total - walking - close, ORBITS_TRIED))
    views += renderer.views(around[:ORBITS_TRIED])
    # Views around the scene are the slowest to render, and those of a town mostly show the backs of houses.
    if sum(view.meets(CRITERIA[0]) for view in views) < ENOUGH * config.count:
        views += renderer.views(around[ORBITS_TRIED:])
    chosen = choose(views, renderer, config.count, len(scene.textures)) if views else []
    if not chosen:
        raise nothing
    return tuple(replace(one.camera, name=f"sampled_{number:02}") for number, one in enumerate(chosen, 1))
