"""The views that a grouping is optimised for: from a cameras file, the scene's cameras, or sampled viewpoints."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from viewer.gl.context import create_headless_context
from viewer.render.renderer import Renderer
from viewer.scene.cameras_file import read_cameras
from viewer.scene.model import Camera, Scene
from viewer.viewpoints.sampling import ViewpointConfig, sample_viewpoints


@dataclass(frozen=True)
class NearbyConfig:
    """Distribution of nearby cameras."""

    count: int = 8
    """Number of nearby cameras for each camera."""
    yaw_degrees: float = 20.0
    """Standard deviation of the yaw, in degrees."""
    pitch_slope: float = 0.1
    """Standard deviation of the target's height, as a share of the distance to the target."""
    step_share: float = 0.1
    """Standard deviation of the eye's position on each level axis, as a share of the distance to the target; 0.3 of it vertically."""
    step_of_extent: float = 0.01
    """Upper limit of the standard deviation of the eye's position, as a share of the scene's extent."""
    seed: int = 0


def nearby_cameras(cameras: Sequence[Camera], scene: Scene, config: NearbyConfig) -> tuple[Camera, ...]:
    """Return `config.count` cameras near each of `cameras`.

    Without them a grouping overfits the pixels of a few pictures; docs/explanation/sharing.md has the measured gain.
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


SIZE = (1280, 720)
"""Width and height in pixels of a view from a given camera."""
NEARBY_SIZE = (640, 360)
"""Width and height in pixels of a view near a given camera or from a sampled viewpoint: a quarter of the blocks."""
SAMPLED_WITHOUT_CAMERAS = 24
MOST_SAMPLED = 1000


@dataclass(frozen=True)
class ViewSource:
    """Choice of the views."""

    file: Path | None = None
    """JSON file of cameras; None takes the scene's cameras."""
    sampled: int | None = None
    """Number of viewpoints sampled besides the cameras; None samples 24 where there are no cameras."""
    seed: int = 0

    def __post_init__(self) -> None:
        if self.sampled is not None and not 0 <= self.sampled <= MOST_SAMPLED:
            raise InputError(f"--sampled-views {self.sampled}: must be 0 to {MOST_SAMPLED}")


@dataclass(frozen=True, eq=False)
class SceneViews:
    """Views of a scene and a renderer that draws their texture ids."""

    cameras: tuple[Camera, ...]
    """Named cameras, from the file or the scene."""
    sampled: tuple[Camera, ...]
    """Viewpoints sampled in the scene."""
    renderer: Renderer
    note: str = ""
    """Line for the user about sampled viewpoints; empty without them."""

    def exactly(self, cameras: Sequence[Camera]) -> tuple[NDArray[np.int32], ...]:
        """Draw the texture ids [H, W] from exactly these cameras."""
        return tuple(self.renderer.texture_ids_from(camera, SIZE) for camera in cameras)

    def near(self, cameras: Sequence[Camera]) -> tuple[NDArray[np.int32], ...]:
        """Draw the texture ids [H, W] from places near these cameras."""
        nearby = nearby_cameras(cameras, self.renderer.scene, NearbyConfig())
        return tuple(self.renderer.texture_ids_from(camera, NEARBY_SIZE) for camera in nearby)

    def from_sampled(self) -> tuple[NDArray[np.int32], ...]:
        """Draw the texture ids [H, W] from the sampled viewpoints."""
        return tuple(self.renderer.texture_ids_from(camera, NEARBY_SIZE) for camera in self.sampled)

    def all_then_release(self, textures: int) -> tuple[NDArray[np.int32], ...]:
        """Draw the texture ids [H, W] of all views, those near the cameras included, and release the renderer.

        Ids from `textures` on become -1: textures without a base colour, which have the last ids, may be left out of an encoding.
        """
        views = (*self.exactly(self.cameras), *self.near(self.cameras), *self.from_sampled())
        self.renderer.release()
        return tuple(np.where(view < textures, view, -1) for view in views)


def cameras_of(scene: Scene, source: ViewSource) -> tuple[Camera, ...]:
    """Return the cameras of the source's file, or the scene's where there is no file. Raises InputError for an unreadable file."""
    return read_cameras(source.file) if source.file is not None else scene.cameras


def scene_views(scene: Scene, source: ViewSource) -> SceneViews:
    """Prepare the views of `source`. Raises InputError for an unreadable file, and where no view shows a texture."""
    cameras = cameras_of(scene, source)
    wanted = source.sampled
    if wanted is None:
        wanted = 0 if cameras else SAMPLED_WITHOUT_CAMERAS
    renderer = Renderer(create_headless_context(), scene)
    sampled: tuple[Camera, ...] = ()
    note = ""
    if wanted:
        sampled = sample_viewpoints(scene, renderer.texture_ids_from, ViewpointConfig(count=wanted, seed=source.seed))
        reason = "" if cameras else f"{scene.name} has no cameras: "
        note = f"{reason}using {len(sampled)} viewpoints sampled in it"
    if not cameras and not sampled:
        raise InputError("--views: the scene has no cameras; give a file of cameras, or --sampled-views")
    return SceneViews(cameras, sampled, renderer, note)
