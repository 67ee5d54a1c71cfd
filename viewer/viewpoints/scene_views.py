"""The views that a grouping is chosen for: a cameras file, the scene's own cameras, or viewpoints sampled in it."""

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
"""Width and height in pixels of a view from a given camera."""
NEARBY_SIZE = (640, 360)
"""The same for a view near a given camera or from a sampled viewpoint: a quarter of the blocks, as there are many."""
SAMPLED_WITHOUT_CAMERAS = 24
MOST_SAMPLED = 1000


@dataclass(frozen=True)
class ViewSource:
    """Which views to use."""

    file: Path | None = None
    """JSON file of cameras; None: the scene's own."""
    sampled: int | None = None
    """Viewpoints sampled in the scene besides; None: 24 where there are no cameras."""
    seed: int = 0

    def __post_init__(self) -> None:
        if self.sampled is not None and not 0 <= self.sampled <= MOST_SAMPLED:
            raise InputError(f"--sampled-views {self.sampled}: must be 0 to {MOST_SAMPLED}")


@dataclass(frozen=True, eq=False)
class SceneViews:
    """The views of a scene and a renderer that draws their texture ids."""

    cameras: tuple[Camera, ...]
    """Named cameras, from the file or the scene."""
    sampled: tuple[Camera, ...]
    """Viewpoints sampled in the scene."""
    renderer: Renderer
    note: str = ""
    """One line for the user about sampled viewpoints; empty without them."""

    def exactly(self, cameras: Sequence[Camera]) -> tuple[NDArray[np.int32], ...]:
        """Texture ids [H, W] from these cameras."""
        return tuple(self.renderer.texture_ids_from(camera, SIZE) for camera in cameras)

    def near(self, cameras: Sequence[Camera]) -> tuple[NDArray[np.int32], ...]:
        """Texture ids [H, W] from places near these cameras."""
        nearby = nearby_cameras(cameras, self.renderer.scene, NearbyConfig())
        return tuple(self.renderer.texture_ids_from(camera, NEARBY_SIZE) for camera in nearby)

    def from_sampled(self) -> tuple[NDArray[np.int32], ...]:
        """Texture ids [H, W] from the sampled viewpoints."""
        return tuple(self.renderer.texture_ids_from(camera, NEARBY_SIZE) for camera in self.sampled)

    def all_then_release(self) -> tuple[NDArray[np.int32], ...]:
        """Texture ids [H, W] of all views, those near the cameras included; the renderer is released after it."""
        views = (*self.exactly(self.cameras), *self.near(self.cameras), *self.from_sampled())
        self.renderer.release()
        return views


def cameras_of(scene: Scene, source: ViewSource) -> tuple[Camera, ...]:
    """The named cameras: of the file, else the scene's own. Raises InputError for a file that cannot be read."""
    return read_cameras(source.file) if source.file is not None else scene.cameras


def scene_views(scene: Scene, source: ViewSource) -> SceneViews:
    """The views that `source` asks for. Raises InputError for a file that cannot be read and where nothing is visible."""
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
        note = f"{reason}looking from {len(sampled)} places sampled in it"
    if not cameras and not sampled:
        raise InputError("--views: the scene has no cameras; name a file of them, or give --sampled-views")
    return SceneViews(cameras, sampled, renderer, note)
