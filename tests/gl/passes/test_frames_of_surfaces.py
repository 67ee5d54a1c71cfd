"""Normals and tangents in the visibility buffer: as the file gives them, as triangles imply them, turned with instances, on backs."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.support.picture_scenes import QUAD, WHITE, Part, as_set, placed, scene_of, texture
from viewer.gl.context import GraphicsContext
from viewer.render.renderer import Renderer
from viewer.scene.model import Camera, Material, PlaneTexture, Scene
from viewer.state.view_state import ViewState

Array = NDArray[np.float64]
SIZE = (64, 64)
"""Perspective bends what a pixel and its neighbour tell of a triangle: less the smaller they are."""
PLACES = {
    "straight": placed(0.0, 0.0, 0.0),
    "turned": placed(0.0, 0.0, 0.0, turn=35.0),
    "stretched": placed(0.0, 0.0, 0.0, (1.5, 0.7, 1.0), -50.0),
    "mirrored": placed(0.0, 0.0, 0.0, (-1.0, 1.0, 1.0), 20.0),
    "behind": placed(0.0, 0.0, 0.0, turn=160.0),
    "mirrored, behind": placed(0.0, 0.0, 0.0, (1.0, -1.2, 1.0), 200.0),
}


def from_octahedron(place: Array) -> Array:
    """[..., 3] unit vectors."""
    z = 1.0 - np.abs(place).sum(-1)
    folded = (1.0 - np.abs(place[..., ::-1])) * np.where(place >= 0.0, 1.0, -1.0)
    found = np.concatenate([np.where(z[..., None] >= 0.0, place, folded), z[..., None]], -1)
    return np.asarray(found / np.linalg.norm(found, axis=-1, keepdims=True))


def unpacked(words: NDArray[np.uint32]) -> tuple[Array, Array, Array]:
    """(normals, tangents [..., 3], handedness [...]) of frames [..., 2]."""
    normal = words[..., 0, None] >> np.array([0, 16], np.uint32) & np.uint32(0xFFFF)
    tangent = words[..., 1, None] >> np.array([0, 15], np.uint32) & np.uint32(0x7FFF)
    handedness = np.where(words[..., 1] >> np.uint32(31), -1.0, 1.0)
    snorm = np.maximum(normal.astype(np.uint16).view(np.int16) / 32767.0, -1.0)
    return from_octahedron(snorm), from_octahedron(tangent / 32766.0 * 2.0 - 1.0), handedness


def sheet(place: NDArray[np.floating], normals: Array | None, tangents: Array | None) -> Scene:
    """A quad whose u runs along x and whose v runs down, with the same normal and tangent at each corner."""
    scene = scene_of([Part(0, transforms=(place,))], [Material("m", -1, WHITE, double_sided=True)])

    def at_corners(value: Array | None) -> NDArray[np.float32] | None:
        return None if value is None else np.tile(value, (len(QUAD), 1)).astype(np.float32)

    geometry = replace(scene.geometry, normals=at_corners(normals), tangents=at_corners(tangents))
    return replace(scene, geometry=geometry)


def seen(graphics: GraphicsContext, scene: Scene) -> tuple[Array, Array, float]:
    """(normal, tangent, handedness) at the middle of the picture, the first two in world space."""
    renderer = Renderer(graphics, scene)
    camera = Camera("c", (0.0, 0.0, 3.0), (0.0, 0.0, 0.0), fov_degrees=40.0)
    renderer.render(ViewState(camera, SIZE, material_view="lit"))
    normals, tangents, handedness = unpacked(renderer.visibility.frames()[32, 32])
    renderer.release()
    return normals, tangents, float(handedness)


def expected_frame(place: NDArray[np.floating], normal: Array, tangent: Array) -> tuple[Array, Array, float]:
    """What glTF asks for: normals by the inverse transposed matrix, tangents by the matrix, all axes turned round on the back."""
    matrix = place[:3, :3].astype(float)
    turned = np.linalg.inv(matrix).T @ normal
    along = matrix @ tangent[:3]
    # The picture looks along -z: the back is seen where the sheet's own face points away.
    face = np.linalg.inv(matrix).T @ np.array([0.0, 0.0, 1.0])
    side = 1.0 if face[2] > 0.0 else -1.0
    turned, along = side * turned / np.linalg.norm(turned), side * along / np.linalg.norm(along)
    along -= turned * (turned @ along)
    mirror = 1.0 if np.linalg.det(matrix) > 0.0 else -1.0
    return turned, along / np.linalg.norm(along), float(tangent[3] * side * mirror)


@pytest.mark.parametrize("name", PLACES)
def test_given_frames_are_turned_with_the_instance(graphics: GraphicsContext, name: str) -> None:
    normal, tangent = np.array([0.2, -0.1, 0.97]), np.array([0.9, 0.4, 0.1, -1.0])
    normal /= np.linalg.norm(normal)
    found = seen(graphics, sheet(PLACES[name], normal, tangent))
    expected = expected_frame(PLACES[name], normal, tangent)
    np.testing.assert_allclose(found[0], expected[0], atol=2e-4)
    np.testing.assert_allclose(found[1], expected[1], atol=5e-4)
    assert found[2] == expected[2]


@pytest.mark.parametrize(("name", "given"), zip(PLACES, ["nothing", "zeros", "a normal alone"] * 2, strict=True))
def test_frames_that_the_file_lacks_follow_from_the_triangle(graphics: GraphicsContext, name: str, given: str) -> None:
    normal, tangent = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0, 1.0])
    lacking = {"nothing": (None, None), "zeros": (0.0 * normal, 0.0 * tangent), "a normal alone": (normal, None)}[given]
    found = seen(graphics, sheet(PLACES[name], *lacking))
    expected = expected_frame(PLACES[name], normal, tangent)
    np.testing.assert_allclose(found[0], expected[0], atol=2e-3)
    np.testing.assert_allclose(found[1], expected[1], atol=2e-3)
    assert found[2] == expected[2]


def test_hostile_frames_stay_unit_vectors(graphics: GraphicsContext) -> None:
    for normal, tangent in (
        ([np.nan] * 3, [np.inf, 0.0, 0.0, 0.0]),
        ([1e-30, 0.0, 0.0], [1e-30] * 4),
        ([0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]),
        ([3e20, 0.0, 3e20], [0.0, 1e25, 0.0, -1.0]),
    ):
        found = seen(graphics, sheet(PLACES["turned"], np.array(normal), np.array(tangent)))
        for axis in found[:2]:
            assert np.linalg.norm(axis) == pytest.approx(1.0, abs=1e-5)
        assert abs(found[0] @ found[1]) < 2e-3


def test_tangents_follow_the_uv_transform_of_the_normal_map(graphics: GraphicsContext) -> None:
    # u of the normal map runs up the sheet, v from right to left: turned by 90 degrees.
    plane = PlaneTexture(0, maps=("normal",), uv_transform=(0.0, -1.0, 0.0, 1.0, 0.0, 0.0))
    scene, bumps = sheet(PLACES["straight"], None, None), texture()
    bumps = as_set(bumps, ("normal",), {"normal": bumps.pixels[..., :2]})
    scene = replace(scene, materials=(replace(scene.materials[0], surface=plane),), textures=(bumps,))
    normal, tangent, handedness = seen(graphics, scene)
    np.testing.assert_allclose(normal, [0.0, 0.0, 1.0], atol=1e-3)
    np.testing.assert_allclose(tangent, [0.0, 1.0, 0.0], atol=2e-3)
    assert handedness == 1.0
