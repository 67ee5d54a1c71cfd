"""The test of clusters in float64, cluster by cluster: twin of shaders/passes/cull_clusters/test.comp."""

import numpy as np
from numpy.typing import NDArray

from viewer.render.passes.cull import ClusterView
from viewer.render.resources.clusters import CONE_MARGIN, PIXEL_MARGIN, ROUNDING, Clusters

Array = NDArray[np.float64]
SIGNS = np.array([[(corner >> axis & 1) * 2.0 - 1.0 for axis in range(3)] for corner in range(8)])


def may_be_seen(
    clusters: Clusters, row: int, transform: Array, view: ClusterView, may_face_away: bool, margins: float
) -> bool:
    """Whether cluster `row` of an instance may be seen; with `margins` times what the shader allows for rounding."""
    centre, half, matrix = clusters.centre[row], clusters.half[row], view.matrix
    corners = (centre + SIGNS * half) @ transform[:3, :3].T + transform[:3, 3]
    clip = corners @ matrix[:, :3].T + matrix[:, 3]
    reach = np.abs(transform[:3, :3]) @ (np.abs(centre) + half) + np.abs(transform[:3, 3])
    error = margins * ROUNDING * (np.abs(matrix[:, :3]) @ reach + np.abs(matrix[:, 3]))
    for axis in range(3):
        slack = -error[3] - error[axis]
        if (clip[:, 3] + clip[:, axis]).max() < slack or (clip[:, 3] - clip[:, axis]).max() < slack:
            return False
    if may_face_away and view.camera.orthographic_height is None and clusters.cutoff[row] <= 1.0:
        eye = np.linalg.inv(transform) @ np.append(np.array(view.camera.eye, np.float64), 1.0)
        towards = centre - eye[:3]
        away = float(np.linalg.norm(towards))
        doubt = margins * (CONE_MARGIN * away + ROUNDING * float(np.linalg.norm(centre) + np.linalg.norm(eye[:3])))
        reached = clusters.cutoff[row] * away + float(np.linalg.norm(half)) + doubt
        if float(towards @ clusters.axis[row]) >= reached:
            return False
    nearest = float(clip[:, 3].min()) - error[3]
    if nearest <= 0.0:
        return True
    places = clip[:, :2] / clip[:, 3:]
    low, high = places.min(axis=0), places.max(axis=0)
    doubt_of_place = (error[:2] + error[3] * np.maximum(np.abs(low), np.abs(high))) / nearest
    low = ((low - doubt_of_place) * 0.5 + 0.5) * view.size - margins * PIXEL_MARGIN
    high = ((high + doubt_of_place) * 0.5 + 0.5) * view.size + margins * PIXEL_MARGIN
    return bool((np.floor(high - 0.5) >= np.ceil(low - 0.5)).all())
