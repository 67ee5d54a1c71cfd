"""Interiors: level free distances against rays, and where a newcomer stands in a room."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.picture_scenes import WHITE, Part, cube, placed, scene_of, texture
from tests.support.ray_caster import cast_rays
from viewer.scene.model import Material, Scene
from viewer.viewpoints.sampling import CandidateSampler, ViewpointConfig
from viewer.viewpoints.surfaces import DIRECTIONS, Surfaces

WALLS = Material("walls", -1, WHITE, double_sided=True)
BLOCK = Material("block", 0, WHITE)


def box(low: tuple[float, float, float], high: tuple[float, float, float], material: int) -> Part:
    """An upright box between two corners."""
    middle, half = (np.array(low) + high) / 2.0, (np.array(high) - low) / 2.0
    x, y, z = middle.tolist()
    return cube(material, placed(x, y, z, (float(half[0]), float(half[1]), float(half[2]))))


def interior(unit: float = 1.0) -> Scene:
    """A room of 9 x 3 x 4 m with a textured chest in it, which nobody sees from outside; `unit` units to a metre."""
    room = box((0.0, 0.0, 0.0), (9.0 * unit, 3.0 * unit, 4.0 * unit), 0)
    parts = [
        replace(room, indices=room.indices[::-1]),
        box((4.0 * unit, 0.0, 0.0), (5.0 * unit, 0.8 * unit, 1.0 * unit), 1),
    ]
    return scene_of(parts, [WALLS, BLOCK], [texture()])


@pytest.mark.parametrize("double_sided", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_free_distances_are_those_of_rays(seed: int, double_sided: bool) -> None:
    random = np.random.default_rng(seed)
    parts = []
    for _ in range(12):
        matrix = np.eye(4)
        matrix[:3, :3] = np.linalg.qr(random.normal(size=(3, 3)))[0] * random.uniform(0.3, 2.0, 3)
        matrix[:3, 3] = random.uniform(-6.0, 6.0, 3)
        parts.append(cube(0, matrix))
    scene = scene_of(parts, [Material("block", 0, WHITE, double_sided=double_sided)], [texture()])
    solid = scene_of(parts, [Material("block", 0, WHITE, double_sided=True)], [texture()])
    eyes = random.uniform(-6.0, 6.0, (6, 3))
    found = Surfaces(scene).free_distances(eyes, np.ones(6))
    assert found.shape == (6, DIRECTIONS)
    angles = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    directions = np.stack([np.sin(angles), np.zeros(DIRECTIONS), np.cos(angles)], axis=-1)
    rays = eyes.repeat(DIRECTIONS, axis=0), np.tile(directions, (6, 1))
    nearest, front = (cast_rays(own, *rays).distance for own in (solid, scene))
    # A back face that is not drawn is seen through.
    assert found.ravel().tolist() == pytest.approx(np.where(front == nearest, nearest, 0.0).tolist(), rel=1e-5)


@pytest.mark.parametrize("unit", [1.0, 100.0])
def test_a_newcomer_stands_in_a_room_and_looks_along_it(unit: float) -> None:
    sampler = CandidateSampler.of(interior(unit), ViewpointConfig(count=1))
    assert sampler is not None
    found = sampler.indoors(6)
    assert found
    for one in found:
        eye, target = np.array(one.camera.eye) / unit, np.array(one.camera.target) / unit
        for place in (eye, target):
            assert (place > 0.0).all()
            assert (place < [9.0, 3.0, 4.0]).all()
        assert eye[1] == pytest.approx(1.7, abs=1e-3)
        assert abs(target[1] - eye[1]) < 0.2 * np.linalg.norm(target - eye)
    # Along the room, not across it: the middle of the free way.
    eye, target = np.array(found[0].camera.eye) / unit, np.array(found[0].camera.target) / unit
    assert np.linalg.norm(target - eye) > 3.0
    assert abs(target - eye)[0] > abs(target - eye)[2]


SCENES_WITHOUT_ROOMS = {
    "a cupboard": [box((0.0, 0.0, 0.0), (1.0, 1.8, 0.6), 2)],
    "a court": [
        box((-0.1, -0.1, 0.0), (0.0, 3.0, 8.0), 1),
        box((8.0, -0.1, 0.0), (8.1, 3.0, 8.0), 1),
        box((0.0, -0.1, -0.1), (8.0, 3.0, 0.0), 1),
        box((0.0, -0.1, 8.0), (8.0, 3.0, 8.1), 1),
        box((0.0, -0.1, 0.0), (8.0, 0.0, 8.0), 1),
    ],
    "huts in a field": [
        box((-30.0, -1.0, -30.0), (30.0, 0.0, 30.0), 1),
        *(box((x, 0.0, z), (x + 4.0, 3.0, z + 4.0), 2) for x in (-20.0, 10.0) for z in (-20.0, 10.0)),
    ],
    "a block": [box((0.0, 0.0, 0.0), (9.0, 3.0, 4.0), 1)],
}


@pytest.mark.parametrize("name", SCENES_WITHOUT_ROOMS)
def test_what_is_no_interior_has_no_rooms(name: str) -> None:
    materials = [WALLS, BLOCK, Material("hollow", 0, WHITE, double_sided=True)]
    sampler = CandidateSampler.of(
        scene_of(SCENES_WITHOUT_ROOMS[name], materials, [texture()]), ViewpointConfig(count=1)
    )
    assert sampler is not None
    assert sampler.indoors(6) == []
