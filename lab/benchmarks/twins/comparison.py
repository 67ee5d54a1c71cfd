"""How far the picture of a twin may lie from that of its plain scene, and how far it does."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from lab.benchmarks.twins.geometry import Error
from ntc.codec.mips import linear_to_srgb8
from viewer.gl.context import GraphicsContext
from viewer.render.renderer import Renderer
from viewer.scene.model import Camera, Scene
from viewer.state.camera import view_projection
from viewer.state.view_state import REFERENCE, Slot, ViewState

FINER = 3
LEAST_DISTANCE = 1e-3
"""Of a vertex in front of the camera."""


@dataclass(frozen=True)
class Bound:
    """What the errors of a twin come to in one picture."""

    pixels: float
    """How far a point may move, in pixels."""
    values: int
    """By how much a pixel may differ where nothing moves, of 255."""


def draw_base(context: GraphicsContext, scene: Scene, camera: Camera, size: tuple[int, int]) -> NDArray[np.uint8]:
    """[H, W, 3] uint8 sRGB: base colours of the original images, black where nothing is."""
    renderer = Renderer(context, scene)
    view = ViewState(camera=camera, size=size, slot_a=Slot(REFERENCE), material_view="base")
    try:
        renderer.render(view, whole=True)
        return linear_to_srgb8(renderer.picture(view.slot_a))
    finally:
        renderer.release()


def picture_bound(scene: Scene, camera: Camera, size: tuple[int, int], error: Error) -> Bound:
    """The bound of a picture of `scene`, which is the plain one.

    Points: the error in the mesh, times the largest scale of an instance, seen at the distance of the nearest vertex in the picture.
    Values: filtering is a mean in linear light, which does not grow an error in sRGB beyond the largest of its texels; a shift in
    UV by a part of a texel changes a value by at most that part of the largest step between neighbouring texels. One more for
    rounding, where there is any error at all.
    """
    if error == Error():
        return Bound(0.0, 0)
    linear = scene.instances.transform[:, :3, :3].astype(np.float64)
    scale = float(np.linalg.norm(linear, ord=2, axis=(1, 2)).max())
    moved = error.position * scale * np.sqrt(3.0)
    focal = size[1] / 2.0 / np.tan(np.radians(camera.fov_degrees) / 2.0)
    shift = moved * focal / max(_nearest(scene, camera, size), LEAST_DISTANCE)
    steps = 0.0
    for texture in scene.textures if error.uv else ():
        pixels = texture.pixels[..., :3].astype(np.int16)
        across, down = (float(np.abs(np.diff(pixels, axis=axis)).max(initial=0)) for axis in (1, 0))
        height, width = pixels.shape[:2]
        steps = max(steps, error.uv * (across * width + down * height))
    return Bound(float(shift), error.texel + int(np.ceil(steps)) + 1)


def _nearest(scene: Scene, camera: Camera, size: tuple[int, int]) -> float:
    """Depth of the nearest vertex that the camera sees."""
    seen_by = view_projection(camera, size, scene.bounds).astype(np.float64)
    nearest = np.inf
    positions = scene.geometry.positions.astype(np.float64)
    for number, matrix in zip(scene.instances.primitive, scene.instances.transform, strict=True):
        part = scene.primitives[int(number)]
        points = positions[part.base_vertex : part.base_vertex + part.vertex_count]
        world = np.c_[points, np.ones(len(points))] @ (seen_by @ matrix.astype(np.float64)).T
        seen = (world[:, 3] > LEAST_DISTANCE) & (np.abs(world[:, :2]) <= world[:, 3:]).all(axis=1)
        nearest = min(nearest, float(world[seen, 3].min(initial=np.inf)))
    return nearest


def fine_size(size: tuple[int, int]) -> tuple[int, int]:
    """Size of the picture that shows what lies between the pixels of one of `size`."""
    return size[0] * FINER, size[1] * FINER


def outside(
    plain: NDArray[np.uint8], fine: NDArray[np.uint8], twin: NDArray[np.uint8], bound: Bound
) -> NDArray[np.bool_]:
    """[H, W] where `twin` shows what the plain scene shows nowhere within the bound's pixels, give or take its values.

    `plain` [H, W, 3] is the plain scene in the same size, `fine` in `fine_size`, for what is narrower than a pixel.
    """
    low, high = plain.astype(int), plain.astype(int)
    if bound.pixels > 0.0:
        side = 2 * int(np.ceil(bound.pixels)) + 1
        blocks = fine.reshape(plain.shape[0], FINER, plain.shape[1], FINER, 3)
        low = minimum_filter(np.minimum(plain, blocks.min(axis=(1, 3))), (side, side, 1)).astype(int)
        high = maximum_filter(np.maximum(plain, blocks.max(axis=(1, 3))), (side, side, 1)).astype(int)
    return np.asarray(((twin < low - bound.values) | (twin > high + bound.values)).any(axis=2))
