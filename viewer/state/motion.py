"""Motion as pure functions of a time step: turntable, recorded path of the camera, and the scene's animation."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from viewer.scene.model import AnimationFacts, Camera, Pose
from viewer.state.navigation import FREE, rotated
from viewer.state.setting import Arg, Setting

VERTICAL = np.array([0.0, 1.0, 0.0])
PATH_SECONDS = 0.25
"""Time between two cameras of a path, in seconds; recording uses the same."""


@dataclass(frozen=True)
class Turntable:
    """Turn of the camera about the vertical through the scene's centre."""

    degrees_per_second: float

    def advance(self, camera: Camera, bounds: NDArray[np.float32], seconds: float) -> "tuple[Camera, Motion | None]":
        """Return the camera `seconds` later and the motion that continues; `bounds` [2, 3] in scene units."""
        angle = math.radians(self.degrees_per_second * seconds)
        centre = bounds.astype(np.float64).mean(axis=0)
        places = centre + rotated(np.array([camera.eye, camera.target]) - centre, VERTICAL, angle)
        eye, target = (tuple(place) for place in places.tolist())
        # Clip distances of a scene's camera fit only its position.
        moved = replace(camera, name=FREE, eye=eye, target=target, near=None, far=None)
        return moved, self


@dataclass(frozen=True)
class Playback:
    """Motion along a path of cameras, in straight lines between them."""

    cameras: tuple[Camera, ...]
    """Cameras of the path, at least one."""
    elapsed: float = 0.0
    """Time since the first camera, in seconds."""

    def advance(self, _camera: Camera, _bounds: NDArray[np.float32], seconds: float) -> "tuple[Camera, Motion | None]":
        """Return the camera `seconds` later and the motion that continues, None after the last camera."""
        elapsed = self.elapsed + seconds
        position = elapsed / PATH_SECONDS
        index = int(position)
        if index >= len(self.cameras) - 1:
            return self.cameras[-1], None
        return between(self.cameras[index], self.cameras[index + 1], position - index), replace(self, elapsed=elapsed)


Motion = Turntable | Playback


def between(first: Camera, second: Camera, share: float) -> Camera:
    """Return the camera at `share` (0 to 1) of the way; `first` where eye and target would meet."""

    def mixed(one: tuple[float, float, float], other: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = (a + (b - a) * share for a, b in zip(one, other, strict=True))
        return x, y, z

    eye, target = mixed(first.eye, second.eye), mixed(first.target, second.target)
    if math.dist(eye, target) < 1e-9:
        return first
    fov = first.fov_degrees + (second.fov_degrees - first.fov_degrees) * share
    return replace(first, name=FREE, eye=eye, target=target, fov_degrees=fov, near=None, far=None)


@dataclass(frozen=True)
class AnimationPlayback:
    """State of the playing animation."""

    is_playing: bool = False
    speed: Annotated[
        float,
        Meta(ge=0.05, le=20.0),
        Setting("animation.speed", "Animation speed", "set the speed of the animation"),
        Arg("seconds of the animation per second", clamp=True, offers=(0.1, 0.25, 0.5, 1.0, 2.0, 4.0)),
    ] = 1.0
    repeats: Annotated[
        bool,
        Setting(
            "animation.repeat", "Repeat animation", "restart the animation at its end", toggles=True, icon="repeat"
        ),
    ] = True

    def advance(
        self, animations: Sequence[AnimationFacts], pose: Pose | None, seconds: float
    ) -> "tuple[Pose, AnimationPlayback]":
        """Return the pose `seconds` after `pose`, and the next state: paused at the end of an animation that does not repeat."""
        shown = chosen_animation(animations, pose)
        at = (pose.seconds if pose is not None else 0.0) + seconds * self.speed
        if at < shown.seconds:
            return Pose(shown.name, at), self
        if self.repeats and shown.seconds > 0.0:
            return Pose(shown.name, at % shown.seconds), self
        return Pose(shown.name, shown.seconds), replace(self, is_playing=False)


def chosen_animation(animations: Sequence[AnimationFacts], pose: Pose | None) -> AnimationFacts:
    """Return the animation of a pose; the first one for None and for an unknown name."""
    named = (animation for animation in animations if pose is not None and animation.name == pose.animation)
    return next(named, animations[0])
