"""Culling by clusters on the GPU: no pixel differs from drawing everything, and the test is that of its float64 twin."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.gl.cluster_twin import may_be_seen
from tests.gl.small_scenes import FLAT, SCENES
from tests.support.lit_studio import LitStudio
from tests.support.picture_scenes import WHITE, Part, placed, scene_of, sphere
from viewer.gl import indirect
from viewer.gl.context import GraphicsContext
from viewer.render import scene_drawer
from viewer.render.passes import cull
from viewer.render.passes.cull import ClusterCulling, ClusterView
from viewer.render.renderer import Renderer
from viewer.render.resources.clusters import build_clusters
from viewer.render.resources.culling import Culling, placement_records
from viewer.render.resources.pack_buffers import scene_programs
from viewer.render.resources.visibility_buffer import SurfaceContent, VisibilityTarget
from viewer.scene.model import Camera, Material, Scene
from viewer.state.camera import view_projection
from viewer.state.view_state import ViewState

SIZE = (96, 64)
CLUSTER = 3
"""Triangles: small scenes have many clusters."""


def hostile() -> Scene:
    """Soup of triangles, degenerate ones too, single- and double-sided; sheared, mirrored, flattened and tiny instances."""
    random = np.random.default_rng(7)
    corners = random.normal(size=(400, 3))
    corners[40:80] = corners[40]
    corners[80:120, 1:] = 0.0
    corners[120:160] *= 40.0
    indices = random.permutation(np.arange(396)).astype(np.uint32)
    sheared = placed(0.5, 0.0, 0.0) @ np.array([[1, 0.7, 0, 0], [0, 1, 0, 0], [0, -0.4, 1, 0], [0, 0, 0, 1]])
    flattened = placed(0.0, -1.0, 0.0, (2.0, 0.0, 2.0))
    soup = [
        Part(
            material,
            positions=corners.astype(np.float32),
            uvs=np.zeros((400, 2), np.float32),
            indices=indices,
            transforms=tuple(np.asarray(t, np.float32) for t in transforms),
        )
        for material, transforms in enumerate(
            [[sheared, flattened], [placed(0.0, 0.0, 0.0, (-1.0, 1.0, 1.0)), placed(1e4, 0.0, 1e4)]]
        )
    ]
    small = sphere(0, *(placed(x, 1.0, 0.3, (0.02, 0.02, -0.02)) for x in np.linspace(-2.0, 2.0, 9)), steps=12)
    materials = [Material("one side", -1, WHITE), Material("both", -1, (0.2, 0.5, 0.9, 1.0), double_sided=True)]
    return scene_of([*soup, small], materials)


def views() -> tuple[Camera, ...]:
    """From anywhere to anywhere, through surfaces and far from them."""
    random = np.random.default_rng(11)
    found = [FLAT]
    for number in range(14):
        eye = tuple((random.normal(size=3) * (0.4, 3.0, 30.0)[number % 3]).tolist())
        target = tuple(random.normal(size=3).tolist())
        found.append(Camera(f"view {number}", eye, target, fov_degrees=float(random.uniform(15.0, 110.0))))
    return tuple(found)


MADE: dict[str, Callable[[], Scene]] = {**SCENES, "hostile": hostile}


@pytest.fixture(params=MADE)
def scene(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, graphics: GraphicsContext) -> Scene:
    """Each small scene, with as many clusters as a large one has."""
    if not graphics.features.compute:
        pytest.skip("this context does not compute")
    monkeypatch.setattr(scene_drawer, "ON_SOFTWARE", True)
    monkeypatch.setattr(scene_drawer, "LEAST_CLUSTERS", 1)
    monkeypatch.setattr(scene_drawer, "LEAST_OF_INSTANCE", 0)
    monkeypatch.setattr(scene_drawer, "GPU_CLUSTER_TRIANGLES", CLUSTER)
    return MADE[request.param]()


def drawn(graphics: GraphicsContext, scene: Scene) -> tuple[list[NDArray[np.uint32]], list[int]]:
    """Words of the visibility buffer for every view, and how many clusters were culled."""
    renderer = Renderer(graphics, scene)
    words, culled = [], []
    for camera in views():
        frame = renderer.render(ViewState(camera, SIZE, material_view="base"))
        words.append(renderer.visibility.words().copy())
        culled.append(frame.skipped["clusters_culled"])
        assert frame.drawn["triangles"] >= 0
    renderer.release()
    return words, culled


@pytest.mark.once
@pytest.mark.parametrize("counted", [True, False], ids=["counted", "padded"])
def test_no_pixel_differs(
    counted: bool, scene: Scene, graphics: GraphicsContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not counted:
        monkeypatch.setattr(indirect, "CORE_VERSION", 10_000)
        monkeypatch.setattr(indirect, "EXTENSION", "none")
    words, culled = drawn(graphics, scene)
    monkeypatch.setattr(cull, "ALL_TESTS", 0)
    whole, kept = drawn(graphics, scene)
    assert kept == [0] * len(kept)
    assert sum(number > 0 for number in culled) > len(culled) / 2
    for camera, ours, theirs in zip(views(), words, whole, strict=True):
        assert np.array_equal(ours, theirs), camera.name


def test_the_test_is_that_of_its_twin(scene: Scene, graphics: GraphicsContext) -> None:
    clusters = build_clusters(scene, CLUSTER)
    culling = Culling(scene, clusters)
    programs = scene_programs(graphics)
    on_gpu = ClusterCulling(graphics, programs, scene, culling)
    away = placement_records(scene, culling)["may_face_away"]
    answers = {True: 0, False: 0}
    for camera in views()[:8]:
        view = ClusterView(camera, SIZE, view_projection(camera, SIZE, scene.bounds))
        on_gpu.draw_list(view)
        counts = on_gpu.counts(waits=True)
        seen_clusters = 0
        for item in on_gpu.items(on_gpu.item_count):
            transform = scene.instances.transform[item["instance"]].astype(np.float64)
            bits = int(item["seen_low"]) | int(item["seen_high"]) << 32
            seen_clusters += bits.bit_count()
            for place in range(int(item["clusters"])):
                row, seen = int(item["first_cluster"]) + place, bool(bits >> place & 1)
                facing = bool(away[item["instance"]])
                answers[seen] += 1
                if seen:
                    assert may_be_seen(clusters, row, transform, view, facing, 3.0)
                else:
                    assert not may_be_seen(clusters, row, transform, view, facing, 0.0)
        assert on_gpu.instances.clusters - counts.clusters_culled == seen_clusters
    assert min(answers.values()) > 0
    on_gpu.release()
    programs.release()


def redrawn(graphics: GraphicsContext, scene: Scene) -> list[NDArray[np.uint32]]:
    """Words of a picture, of the same view in another size, and of the first again with other thresholds."""
    studio = LitStudio(graphics, scene, views()[1], SIZE)
    content = SurfaceContent(False, gradients=False)
    target, small = VisibilityTarget(graphics, SIZE, content), VisibilityTarget(graphics, (17, 11), content)
    found = []
    for action in (
        lambda: studio.drawer.draw(studio.camera, target),
        lambda: studio.drawer.redraw(small),
        lambda: studio.drawer.draw(studio.camera, target, 3),
    ):
        found.append(action().visibility.words().copy())
    target.release()
    small.release()
    studio.release()
    return found


@pytest.mark.once
@pytest.mark.parametrize("scene", ["masks"], indirect=True)
def test_another_size_is_culled_anew(scene: Scene, graphics: GraphicsContext, monkeypatch: pytest.MonkeyPatch) -> None:
    ours = redrawn(graphics, scene)
    monkeypatch.setattr(cull, "ALL_TESTS", 0)
    for culled, whole in zip(ours, redrawn(graphics, scene), strict=True):
        assert culled[..., 0].any()
        assert np.array_equal(culled, whole)
