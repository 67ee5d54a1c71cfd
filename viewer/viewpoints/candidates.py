"""Candidate viewpoints: at eye height above the ground, close to surfaces, and around the whole scene."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from viewer.scene.model import Camera, Scene
from viewer.viewpoints.surfaces import HIGH_UP, Surfaces

Array = NDArray[np.float64]
EYE_HEIGHT = 1.7
"""Eye height above the ground in metres."""
METRES = (5.0, 250.0)
"""Range of the longest side of scenes that are taken to be measured in metres."""
POSSIBLY_METRES = 2000.0
"""Longest side up to which a scene is a city in metres, or a small place in other units: candidates for both are drawn."""
EYE_HEIGHT_SHARES = (0.01, 0.1)
"""Range of eye heights where the unit is unknown, as shares of the longest side."""
OVERSAMPLING = 3
"""Number of places drawn for each one that is used; the worst are left out."""
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
"""Number of points on textured surfaces from which the score of a place is estimated before it is drawn."""
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


@dataclass(frozen=True)
class ViewpointConfig:
    """Settings of the sampling of viewpoints."""

    count: int = 24
    """Largest number of viewpoints returned."""
    seed: int = 0
    candidates_per_view: int = 6
    """Number of candidates rendered for each viewpoint returned."""
    size: tuple[int, int] = (160, 90)
    """Width and height in pixels of the pictures that candidates are judged by."""
    fov_degrees: float = 60.0


def _direction(turn: Array, pitch: Array) -> Array:
    """Return [N, 3] unit vectors; angles in radians."""
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
    """Camera that may be chosen."""

    camera: Camera
    scale: float
    """Eye height in scene units; distances to judge the view by are multiples of it."""

    def duplicates(self, other: "Candidate") -> bool:
        """Return whether both look from about the same place in about the same direction."""
        first, second = (np.array([one.camera.eye, one.camera.target]) for one in (self, other))
        near = np.linalg.norm(first[0] - second[0]) < DUPLICATE_DISTANCE * max(self.scale, other.scale)
        ways = [(pair[1] - pair[0]) / np.linalg.norm(pair[1] - pair[0]) for pair in (first, second)]
        return bool(near and ways[0] @ ways[1] > DUPLICATE_COSINE)


def candidates(eyes: Array, targets: Array, scales: Array, fov: float) -> list[Candidate]:
    return [
        Candidate(Camera("candidate", tuple(eye), tuple(target), fov_degrees=fov), scale)
        for eye, target, scale in zip(eyes.tolist(), targets.tolist(), scales.tolist(), strict=True)
    ]


class CandidateSampler:
    """Samples viewpoints inside of a scene and keeps those with the highest estimated score."""

    def __init__(self, ground: Surfaces, random: np.random.Generator, extent: float, fov: float) -> None:
        self._ground, self._random, self._extent, self._fov = ground, random, extent, fov
        textured, texture = ground.textured_area, np.maximum(ground.texture, 0)
        of_texture = np.bincount(texture, textured)[texture]
        self._weights = np.divide(textured, of_texture, out=np.zeros_like(textured), where=of_texture > 0.0)
        self._samples = ground.points(random, self._weights, SAMPLES, up_only=False)

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

    def _kept(self, eyes: Array, targets: Array, heights: Array, low_first: bool, count: int) -> list[Candidate]:
        around = self._ground.around(eyes, heights)
        scores = self._scores(eyes, targets, heights)
        last = np.zeros(len(eyes), bool)
        if low_first:
            grounds = eyes[:, 1] - heights
            last = around.on_top() | (around.open_sky() & (grounds > np.median(grounds) + HIGH_UP * heights))
        # Roofs and places behind back-facing walls come last; places under the ground are left out.
        order = np.lexsort((-scores, last, around.behind_walls()))
        best = order[~around.buried()[order]][:count]
        return candidates(eyes[best], targets[best], heights[best], self._fov)

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
        return self._kept(eyes, targets, heights, True, count)

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
        return self._kept(targets.points + away * distance[:, None], targets.points, heights, False, count)


def orbit(
    scene: Scene, random: np.random.Generator, extent: float, count: int, config: ViewpointConfig
) -> list[Candidate]:
    """Sample `count` views from around the scene that show all or most of it."""
    fov, aspect = config.fov_degrees, config.size[0] / config.size[1]
    low, high = scene.bounds.astype(np.float64)
    centre, half = (low + high) / 2.0, np.maximum((high - low) / 2.0, extent * 1e-3)
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
    scales = np.full(count, extent * ORBIT_SCALE)
    return candidates(targets + way * distance[:, None], targets, scales, fov)
