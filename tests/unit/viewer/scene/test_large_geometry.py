"""Scenes of many triangles: compact arrays, read without holding the file's bytes twice, synthetic ones for measuring."""

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.benchmarks.geometry.scenes import MESH_TRIANGLES, write_geometry
from tests.support.scenes import world_triangles
from viewer.scene.gltf.joined_arrays import SHORT_INDICES, joined, joined_indices
from viewer.scene.load import load_scene


def test_parts_are_joined_and_let_go() -> None:
    parts: list[NDArray[np.float32] | None] = [np.ones((2, 3), np.float32), None, np.full((1, 3), 2.0, np.float32)]
    whole = joined(parts, [2, 2, 1], 3, 5.0)
    assert whole is not None
    assert whole[:, 0].tolist() == [1, 1, 5, 5, 2]
    assert parts == [None, None, None]
    assert joined([None, None], [2, 2], 3) is None


@pytest.mark.parametrize(("highest", "kind"), [(SHORT_INDICES - 1, np.uint16), (SHORT_INDICES, np.uint32)])
def test_indices_take_two_bytes_where_they_fit(highest: int, kind: type[np.generic]) -> None:
    parts: list[NDArray[Any] | None] = [np.array([0, 1, 2], np.uint8), np.array([0, highest, 7], np.uint32), None]
    whole = joined_indices(parts, 6, highest)
    assert whole.dtype == kind
    assert whole.tolist() == [0, 1, 2, 0, highest, 7]
    assert parts == [None, None, None]


@pytest.fixture(scope="module")
def scene_files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Scenes of 300,000 triangles: every body of its own, and few bodies at many nodes."""
    folder = tmp_path_factory.mktemp("geometry")
    plain, instanced = folder / "plain.glb", folder / "instanced.glb"
    assert write_geometry(plain, 300_000, instanced=False) == write_geometry(instanced, 300_000, instanced=True)
    return plain, instanced


def test_a_large_scene_is_not_held_twice_over(scene_files: tuple[Path, Path]) -> None:
    size = scene_files[0].stat().st_size
    tracemalloc.start()
    try:
        scene = load_scene(scene_files[0])
        left, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # The file's bytes and the scene's arrays, which hold the same; then the arrays alone.
    assert peak < 2.3 * size
    assert left < 1.2 * size
    assert scene.geometry.indices.dtype == np.uint16
    assert scene.geometry.positions.flags.owndata


def test_a_mesh_at_many_nodes_is_stored_once(scene_files: tuple[Path, Path]) -> None:
    plain, instanced = (load_scene(file) for file in scene_files)
    assert plain.report.used["triangles drawn"] == instanced.report.used["triangles drawn"] == 12 * MESH_TRIANGLES
    assert instanced.report.used["triangles"] == 8 * MESH_TRIANGLES
    assert len(instanced.geometry.positions) * 12 == len(plain.geometry.positions) * 8
    # The first bodies are the same ones in both.
    assert np.array_equal(world_triangles(plain)[:100], world_triangles(instanced)[:100])
