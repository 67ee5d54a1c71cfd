"""Where groupings look from: a cameras file, the scene's own cameras, or places sampled in the scene."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from viewer.gl.context import create_headless_context
from viewer.render.renderer import Renderer
from viewer.scene.cameras_file import read_cameras
from viewer.scene.model import Camera, Scene
from viewer.viewpoints import ViewpointConfig, sample_viewpoints
from viewer.viewpoints.nearby_cameras import NearbyConfig, nearby_cameras

SIZE = (1280, 720)
"""Pixels of a view from a given camera."""
NEARBY_SIZE = (640, 360)
"""Pixels of a view from near a given camera, or from a sampled place: a quarter of the blocks, for there are many."""
SAMPLED_WITHOUT_CAMERAS = 24
MOST_SAMPLED = 1000


@dataclass(frozen=True)
class ViewSource:
    """Which cameras are asked for."""

    file: Path | None = None
    """JSON file of cameras; None: the scene's own."""
    sampled: int | None = None
    """Places sampled in the scene besides; None: 24 where there are no cameras."""
    seed: int = 0

    def __post_init__(self) -> None:
        if self.sampled is not None and not 0 <= self.sampled <= MOST_SAMPLED:
            raise InputError(f"--sampled-views {self.sampled}: must be 0 to {MOST_SAMPLED}")


@dataclass(frozen=True, eq=False)
class SceneViews:
    """What is seen of a scene."""

    cameras: tuple[Camera, ...]
    """Named cameras, from the file or the scene."""
    sampled: tuple[Camera, ...]
    """Places sampled in the scene."""
    renderer: Renderer

    def exactly(self, cameras: Sequence[Camera]) -> tuple[NDArray[np.int32], ...]:
        """Texture ids [H, W] from these cameras."""
        return tuple(self.renderer.texture_ids_from(camera, SIZE) for camera in cameras)

    def near(self, cameras: Sequence[Camera]) -> tuple[NDArray[np.int32], ...]:
        """Texture ids [H, W] from places near these cameras."""
        nearby = nearby_cameras(cameras, self.renderer.scene, NearbyConfig())
        return tuple(self.renderer.texture_ids_from(camera, NEARBY_SIZE) for camera in nearby)

    def from_sampled(self) -> tuple[NDArray[np.int32], ...]:
        """Texture ids [H, W] from the sampled places."""
        return tuple(self.renderer.texture_ids_from(camera, NEARBY_SIZE) for camera in self.sampled)


def cameras_of(scene: Scene, source: ViewSource) -> tuple[Camera, ...]:
    """The named cameras: of the file, else the scene's own. Raises InputError for a file that cannot be read."""
    return read_cameras(source.file) if source.file is not None else scene.cameras


def scene_views(scene: Scene, source: ViewSource) -> SceneViews:
    """The cameras that `source` asks for. Raises InputError for a file that cannot be read and where nothing is seen."""
    cameras = cameras_of(scene, source)
    wanted = source.sampled
    if wanted is None:
        wanted = 0 if cameras else SAMPLED_WITHOUT_CAMERAS
    renderer = Renderer(create_headless_context(), scene)
    sampled: tuple[Camera, ...] = ()
    if wanted:
        sampled = sample_viewpoints(scene, renderer.texture_ids_from, ViewpointConfig(count=wanted, seed=source.seed))
        reason = "" if cameras else f"{scene.name} has no cameras: "
        sys.stderr.write(f"note: {reason}looking from {len(sampled)} places sampled in it\n")
    if not cameras and not sampled:
        raise InputError("--views: the scene has no cameras; name a file of them, or give --sampled-views")
    return SceneViews(cameras, sampled, renderer)
