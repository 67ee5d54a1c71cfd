"""Viewpoints that are sampled in a scene: repeatable, worth looking from, and of any size of scene."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.errors import InputError
from tests.gl.small_scenes import SCENES, textures
from tests.support.picture_scenes import WHITE, Part, cube, placed, scene_of, texture
from viewer.gl.context import GraphicsContext
from viewer.locations import builtin_scene_path
from viewer.render.renderer import Renderer
from viewer.scene.load import load_scene
from viewer.scene.model import Camera, Material, Scene
from viewer.viewpoints.sampling import ViewpointConfig, sample_viewpoints

pytestmark = pytest.mark.once
SIZE = (160, 90)
See = Callable[[Camera, tuple[int, int]], NDArray[np.int32]]
GROUND = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], np.float32)
"""Lays a quad down, its front up."""


@pytest.fixture
def eyes(graphics: GraphicsContext) -> Iterator[Callable[[Scene], See]]:
    """Makes what draws the texture ids of a scene."""
    renderers = []

    def of(scene: Scene) -> See:
        renderers.append(Renderer(graphics, scene))
        return renderers[-1].texture_ids_from

    yield of
    for renderer in renderers:
        renderer.release()


@pytest.fixture(scope="module")
def courtyard() -> Scene:
    return load_scene(builtin_scene_path())


def seen(see: See, cameras: tuple[Camera, ...]) -> list[set[int]]:
    """Texture ids that each camera sees."""
    return [set(np.unique(see(camera, SIZE)).tolist()) - {-1} for camera in cameras]


def test_the_builtin_scene_is_seen_as_a_whole(courtyard: Scene, eyes: Callable[[Scene], See]) -> None:
    see = eyes(courtyard)
    cameras = sample_viewpoints(courtyard, see, ViewpointConfig(count=12))
    assert [camera.name for camera in cameras] == [f"sampled_{number:02}" for number in range(1, 13)]
    views = seen(see, cameras)
    assert min(len(view) for view in views) >= 2
    assert set.union(*views) == set(range(len(courtyard.textures)))
    for camera in cameras:
        ids = see(camera, SIZE)
        assert (ids >= 0).mean() >= 0.4
        assert np.bincount(ids[ids >= 0]).max() <= 0.7 * ids.size


def test_a_seed_gives_the_same_views_again_and_another_gives_others(
    courtyard: Scene, eyes: Callable[[Scene], See]
) -> None:
    see = eyes(courtyard)
    config = ViewpointConfig(count=4, candidates_per_view=3)
    first = sample_viewpoints(courtyard, see, config)
    assert sample_viewpoints(courtyard, see, config) == first
    assert sample_viewpoints(courtyard, see, replace(config, seed=1)) != first


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("count", [1, 5])
def test_small_scenes_give_what_was_asked_for(name: str, count: int, eyes: Callable[[Scene], See]) -> None:
    scene = SCENES[name]()
    see = eyes(scene)
    cameras = sample_viewpoints(scene, see, ViewpointConfig(count=count))
    assert len(cameras) == count
    assert min(len(view) for view in seen(see, cameras)) >= 2


@pytest.mark.parametrize("turn", [np.eye(4, dtype=np.float32), GROUND], ids=["upright", "lying"])
@pytest.mark.parametrize("double_sided", [False, True])
def test_one_textured_quad_alone_is_seen(
    turn: NDArray[np.float32], double_sided: bool, eyes: Callable[[Scene], See]
) -> None:
    quad = Part(0, transforms=(turn,))
    scene = scene_of([quad], [Material("m", 0, WHITE, double_sided=double_sided)], [texture()])
    see = eyes(scene)
    cameras = sample_viewpoints(scene, see, ViewpointConfig(count=3))
    assert 1 <= len(cameras) <= 3
    assert all(view == {0} for view in seen(see, cameras))


@pytest.mark.parametrize(
    "scene",
    [
        scene_of([], []),
        scene_of([cube(0)], [Material("plain", -1, WHITE)]),
        scene_of([cube(0)], [Material("plain", -1, WHITE)], textures()),
        scene_of([Part(0, transforms=(np.zeros((4, 4), np.float32),))], [Material("m", 0, WHITE)], [texture()]),
    ],
    ids=["empty", "no textures", "unused textures", "no area"],
)
def test_a_scene_in_which_no_texture_is_seen_is_refused(scene: Scene, eyes: Callable[[Scene], See]) -> None:
    with pytest.raises(InputError, match="no viewpoint sees a texture"):
        sample_viewpoints(scene, eyes(scene), ViewpointConfig(count=3))


@pytest.mark.parametrize(("double_sided", "roofed"), [(False, True), (True, True), (False, False)])
def test_nobody_stands_under_the_ground_or_in_a_block(
    double_sided: bool, roofed: bool, eyes: Callable[[Scene], See]
) -> None:
    ground = Part(0, transforms=(GROUND * np.array([[30.0], [1.0], [30.0], [1.0]], np.float32),))
    block = cube(1, *(placed(x, 4.2, z, (5.0, 4.0, 5.0)) for x in (-15.0, 15.0) for z in (-15.0, 15.0)))
    if not roofed:
        level = np.ptp(block.positions[block.indices.reshape(-1, 3)][:, :, 1], axis=1) == 0.0
        block = replace(block, indices=block.indices.reshape(-1, 3)[~level].reshape(-1))
    materials = [Material("ground", 0, WHITE), Material("block", 1, WHITE, double_sided=double_sided)]
    scene = scene_of([ground, block], materials, textures()[:2])
    cameras = sample_viewpoints(scene, eyes(scene), ViewpointConfig(count=12))
    where: Counter[str] = Counter()
    for camera in cameras:
        x, y, z = camera.eye
        inside = y < 8.2 and abs(abs(x) - 15.0) < 5.0 and abs(abs(z) - 15.0) < 5.0
        where["under" if y < 0.0 else "inside" if inside else "outside"] += 1
    assert where == {"outside": len(cameras)}
