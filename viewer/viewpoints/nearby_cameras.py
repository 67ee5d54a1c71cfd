"""Cameras near a camera, because the texture ids of a single viewpoint do not generalise to its surroundings."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from viewer.scene.model import Camera, Scene


@dataclass(frozen=True)
class NearbyConfig:
    """How nearby cameras are distributed."""

    count: int = 8
    """Nearby cameras for each camera."""
    yaw_degrees: float = 20.0
    """Standard deviation of the direction, to the sides."""
    pitch_slope: float = 0.1
    """Standard deviation of the direction, up and down, as a share of the distance to the target."""
    step_share: float = 0.1
    """Standard deviation of the eye as a share of the distance to the target; 0.3 of it up and down."""
    step_of_extent: float = 0.01
    """Upper limit of that deviation as a share of the scene's extent."""
    seed: int = 0


def nearby_cameras(cameras: Sequence[Camera], scene: Scene, config: NearbyConfig) -> tuple[Camera, ...]:
    """`config.count` cameras near each of `cameras`.

    Without them a grouping overfits the pixels of a few pictures; docs/explanation/sharing.md measures what they bring.
    """
    random = np.random.default_rng(config.seed)
    extent = float(np.linalg.norm(scene.bounds[1] - scene.bounds[0]))
    made: list[Camera] = []
    for camera in cameras:
        eye = np.array(camera.eye)
        forward = np.array(camera.target) - eye
        distance = float(np.linalg.norm(forward))
        step = min(config.step_share * distance, config.step_of_extent * extent)
        for number in range(config.count):
            yaw = math.radians(float(random.normal()) * config.yaw_degrees)
            cosine, sine = math.cos(yaw), math.sin(yaw)
            turned = np.array(
                [
                    cosine * forward[0] + sine * forward[2],
                    forward[1] + float(random.normal()) * config.pitch_slope * distance,
                    cosine * forward[2] - sine * forward[0],
                ]
            )
            place = eye + random.normal(size=3) * np.array([1.0, 0.3, 1.0]) * step
            name = f"{camera.name} nearby {number + 1}"
            made.append(replace(camera, name=name, eye=tuple(place), target=tuple(place + turned)))
    return tuple(made)
