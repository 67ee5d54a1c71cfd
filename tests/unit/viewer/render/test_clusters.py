"""Bounds and cones of clusters, against each triangle by itself."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.picture_scenes import cube, scene_of
from viewer.render.resources import clusters as clusters_module
from viewer.render.resources.clusters import NEVER_BACKFACING, build_clusters
from viewer.render.scene_drawer import pays_on_gpu
from viewer.scene.model import Geometry, Material, Primitive, Scene

SIZE = 7


def hostile(random: np.random.Generator) -> Scene:
    """Primitives of random, degenerate and flat triangles, of none, and of fewer than a cluster."""
    corners = random.normal(size=(300, 3)).astype(np.float32)
    corners[90:150] = corners[90]
    corners[150:240, 2] = 0.0
    indices = random.integers(0, 100, 3 * 63).astype(np.uint16)
    flat = np.tile(np.array([[0, 1, 2]]), (20, 1)).ravel() + 3 * np.repeat(np.arange(20), 3)
    whole = np.concatenate([indices, flat]).astype(np.uint16)
    primitives = (
        Primitive("random", 0, 189, 0, 100, 0),
        Primitive("none", 189, 0, 0, 100, 0),
        Primitive("flat", 189, 60, 150, 90, 0),
        Primitive("few", 0, 6, 100, 100, 0),
    )
    geometry = Geometry(corners, np.zeros((300, 2), np.float32), None, whole)
    return replace(
        scene_of([cube(0, np.eye(4))], [Material("plain", -1, (1.0, 1.0, 1.0, 1.0))]),
        geometry=geometry,
        primitives=primitives,
    )


@pytest.mark.parametrize("piece", [1, 20, 1 << 18])
def test_clusters_hold_their_triangles(piece: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clusters_module, "PIECE_TRIANGLES", piece)
    scene = hostile(np.random.default_rng(3))
    clusters = build_clusters(scene, SIZE)
    for number, primitive in enumerate(scene.primitives):
        covered = []
        for row in range(int(clusters.first[number]), int(clusters.first[number + 1])):
            begin, count = int(clusters.first_index[row]), int(clusters.index_count[row])
            covered += list(range(begin, begin + count))
            if count == 0:
                continue
            index = scene.geometry.indices[begin : begin + count].astype(int) + primitive.base_vertex
            corners = scene.geometry.positions[index].astype(np.float64).reshape(-1, 3, 3)
            assert count <= 3 * SIZE
            outside = np.abs(corners - clusters.centre[row]) - clusters.half[row]
            assert outside.max() < 1e-12
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            lengths = np.linalg.norm(normals, axis=1)
            if clusters.cutoff[row] == NEVER_BACKFACING:
                continue
            cosines = normals[lengths > 0] @ clusters.axis[row] / lengths[lengths > 0]
            assert (cosines >= np.sqrt(1.0 - clusters.cutoff[row] ** 2) - 1e-9).all()
        assert covered == list(range(primitive.first_index, primitive.first_index + primitive.index_count))


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
