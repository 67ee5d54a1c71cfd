"""Bounds and cones of clusters, against each triangle by itself."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.picture_scenes import cube, scene_of
from viewer.render.scene_drawer import pays_on_gpu
from viewer.scene.model import Material, Scene


def large(triangles: int, instances: int) -> Scene:
    """A scene that says it has so many triangles at each of so many nodes; its arrays hold fewer."""
    scene = scene_of([cube(0, *[np.eye(4)] * instances)], [Material("plain", -1, (1.0, 1.0, 1.0, 1.0))])
    return replace(scene, primitives=(replace(scene.primitives[0], index_count=3 * triangles),))


@pytest.mark.parametrize(
    ("triangles", "instances", "storage_bytes", "is_software", "pays"),
    [
        (12, 3, 1 << 27, False, False),
        (1_000_000, 1, 1 << 27, False, False),
        (3_000_000, 1, 1 << 27, False, True),
        (60_000, 40, 1 << 27, False, True),
        (600, 4000, 1 << 27, False, False),
        (3_000_000, 1, 1 << 20, False, False),
        (3_000_000, 1, 1 << 27, True, False),
    ],
    ids=["small", "below", "one large", "many of some", "many of few", "no room", "no GPU"],
)
def test_only_scenes_of_many_clusters_are_culled_on_the_gpu(
    triangles: int, instances: int, storage_bytes: int, is_software: bool, pays: bool
) -> None:
    assert pays_on_gpu(large(triangles, instances), storage_bytes, is_software) is pays
