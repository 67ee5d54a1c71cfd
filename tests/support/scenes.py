"""Scenes built in memory, their triangles in world space, and what scripts on a session are tried with."""

import numpy as np
from numpy.typing import NDArray

from tests.support.gltf_builder import GltfBuilder
from viewer.scene.gltf.container import parse_gltf
from viewer.scene.load import build_scene
from viewer.scene.model import Scene
from viewer.state.framing import frame_all
from viewer.state.session import Session
from viewer.state.view_file import SavedView

REACHING_OUT = ("file.", "training.", "view.save")
"""Beginnings of commands that write files, open others, or start processes."""


def built(builder: GltfBuilder) -> Scene:
    """The scene in the GLB of `builder`."""
    return build_scene(parse_gltf(builder.glb(), "test.glb", None), "test", None)


def world_triangles(scene: Scene) -> NDArray[np.float64]:
    """[T, 3, 3] world-space corners of all drawn triangles, in the order of their front faces."""
    parts = []
    for row, transform in zip(scene.instances.primitive, scene.instances.transform, strict=True):
        primitive = scene.primitives[row]
        index = scene.geometry.indices[primitive.first_index : primitive.first_index + primitive.index_count]
        local = scene.geometry.positions[primitive.base_vertex + index.astype(np.int64)].astype(np.float64)
        placed = (local @ transform[:3, :3].T.astype(np.float64) + transform[:3, 3]).reshape(-1, 3, 3)
        parts.append(placed if np.linalg.det(transform[:3, :3]) > 0 else placed[:, ::-1])
    return np.concatenate(parts)


def sorted_triangles(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return `triangles` [T, 3, 3] in canonical order: corners, then triangles, ascending (winding is lost)."""
    rounded = np.round(triangles, 4) + 0.0
    corners = np.array([sorted(triangle.tolist()) for triangle in rounded])
    return corners[np.lexsort(corners.reshape(len(corners), -1).T[::-1])]


def example_view(session: Session) -> SavedView:
    """The view of `session` with a bookmark."""
    return SavedView(session.scene.name, session.view, 1.0, {"bookmark": frame_all(session.scene)})
