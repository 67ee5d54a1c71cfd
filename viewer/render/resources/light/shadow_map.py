"""The sun's shadow map: one orthographic depth picture of the whole scene, seen from the sun."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext

SHADOW_SIDE: Final = 2048
"""Texels a side."""
MARGIN: Final = 0.01
"""Of the scene's extent, on each side."""


@dataclass(frozen=True, eq=False)
class ShadowView:
    """How the sun sees a scene."""

    matrix: NDArray[np.float64]
    """[4, 4] world to clip."""
    texel: float
    """Width of a texel of the map in the world, the longer side."""

    @property
    def to_map(self) -> NDArray[np.float64]:
        """[4, 4] world to the map's x, y and depth, all in [0, 1]."""
        halves = np.diag([0.5, 0.5, 0.5, 1.0])
        halves[:3, 3] = 0.5
        return np.asarray(halves @ self.matrix)


def shadow_view(bounds: NDArray[np.float32], direction: tuple[float, float, float]) -> ShadowView:
    """The view of `bounds` [2, 3] along the light of a sun that stands in `direction` (unit vector)."""
    backward = np.array(direction, np.float64)
    helper = np.array([0.0, 0.0, 1.0]) if abs(backward[1]) > 0.9 else np.array([0.0, 1.0, 0.0])
    right = np.cross(helper, backward)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(backward, right), backward])
    low, high = bounds.astype(np.float64)
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    seen = corners @ axes.T
    nearest, farthest = seen.min(axis=0), seen.max(axis=0)
    centre, half = (nearest + farthest) / 2.0, (farthest - nearest) / 2.0
    half = np.maximum(half * (1.0 + MARGIN), 1e-3 * max(float(half.max()), 1e-6))
    matrix = np.eye(4)
    # Depth grows away from the sun.
    matrix[:3, :3] = axes * (np.array([1.0, 1.0, -1.0]) / half)[:, None]
    matrix[:3, 3] = -centre * np.array([1.0, 1.0, -1.0]) / half
    return ShadowView(matrix, float(2.0 * half[:2].max() / SHADOW_SIDE))


class ShadowMap:
    """A depth texture, and the framebuffer that it is drawn into."""

    def __init__(self, context: GraphicsContext, side: int = SHADOW_SIDE) -> None:
        """Raises GpuMemoryError."""
        what = f"a shadow map of {side} x {side}"
        with context.memory.transaction():
            self.depth = context.memory.depth_texture(what, (side, side))
            self.framebuffer = context.memory.framebuffer(what, [], self.depth)
        # Shaders compare for themselves.
        self.depth.compare_func = ""
        self.depth.repeat_x = self.depth.repeat_y = False

    def read(self) -> NDArray[np.float32]:
        """[side, side] float32 depth in [0, 1], row 0 at the bottom."""
        return np.frombuffer(self.depth.read(), np.float32).reshape(self.depth.size[1], self.depth.size[0])

    def release(self) -> None:
        """Free the texture."""
        self.framebuffer.release()
        self.depth.release()
