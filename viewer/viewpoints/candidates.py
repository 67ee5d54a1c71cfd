"""Viewpoints that may be chosen: where a person would stand, what is looked at from near, and from around."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from viewer.scene.model import Camera, Scene
from viewer.viewpoints.surfaces import Surfaces
from viewer.viewpoints.surroundings import HIGH_UP

Array = NDArray[np.float64]
EYE_HEIGHT = 1.7
"""Metres above the ground."""
METRES = (5.0, 250.0)
"""A scene whose longest side lies between these is taken to be measured in metres."""
PERHAPS_METRES = 2000.0
"""One that is longer, up to this, may be a city or a small place in other units: views of both are drawn."""
EYE_HEIGHT_SHARES = (0.01, 0.1)
"""Elsewhere eye heights are drawn between these shares of the longest side."""
SPARE_POINTS = 3
"""Places drawn for each that is used, so that bad ones can be left out."""
PITCH_DEGREES = (-20.0, 10.0)
ELEVATION_DEGREES = (5.0, 45.0)
CLOSE_PITCH_DEGREES = (-10.0, 45.0)
CLOSE_DISTANCES = (0.8, 4.0)
"""Distances of close views from what they look at, in eye heights."""
ORBIT_DISTANCES = (0.6, 1.0)
"""Distances of views from around the scene, as shares of that from which all of it fits into the picture."""
ORBIT_SCALE = 0.25
"""What stands for the eye height of such views, as a share of the longest side."""
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
class Candidate:
    """A camera that may be chosen."""

    camera: Camera
    scale: float
    """Its eye height: what near and far are measured by."""

    def alike(self, other: "Candidate") -> bool:
        """Whether both look from one place in one direction."""
        first, second = (np.array([one.camera.eye, one.camera.target]) for one in (self, other))
        near = np.linalg.norm(first[0] - second[0]) < SAME_PLACE * max(self.scale, other.scale)
        ways = [(pair[1] - pair[0]) / np.linalg.norm(pair[1] - pair[0]) for pair in (first, second)]
        return bool(near and ways[0] @ ways[1] > SAME_DIRECTION)


def candidates(eyes: Array, targets: Array, scales: Array, fov: float) -> list[Candidate]:
    return [
        Candidate(Camera("candidate", tuple(eye), tuple(target), fov_degrees=fov), scale)
        for eye, target, scale in zip(eyes.tolist(), targets.tolist(), scales.tolist(), strict=True)
    ]


class Places:
    """Draws eyes and targets inside of a scene, more than are used, and keeps the promising ones."""

    def __init__(self, ground: Surfaces, random: np.random.Generator, extent: float, fov: float) -> None:
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

    def _kept(self, eyes: Array, targets: Array, heights: Array, low_first: bool, count: int) -> list[Candidate]:
        around = self._ground.around(eyes, heights)
        promise = self._promise(eyes, targets, heights)
        last = np.zeros(len(eyes), bool)
        if low_first:
            grounds = eyes[:, 1] - heights
            last = around.on_top() | (around.open_sky() & (grounds > np.median(grounds) + HIGH_UP * heights))
        # A roof is better than nothing and so is a shell of walls, a grave is not.
        order = np.lexsort((-promise, last, around.behind_walls()))
        best = order[~around.buried()[order]][:count]
        return candidates(eyes[best], targets[best], heights[best], self._fov)

    def walking(self, count: int) -> list[Candidate]:
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

    def close(self, count: int) -> list[Candidate]:
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


def orbit(
    scene: Scene, random: np.random.Generator, extent: float, count: int, config: ViewpointConfig
) -> list[Candidate]:
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
    return candidates(targets + way * distance[:, None], targets, scales, fov)
