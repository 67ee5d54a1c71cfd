"""Where images lie in texture arrays: within a budget, each in one place, those in sight as large as there is room for."""

import numpy as np
import pytest

from tests.support.picture_scenes import WHITE, scene_of, texture
from viewer.render.resources.image_places import ImagePlaces, image_bytes, plane_bytes
from viewer.render.resources.scene_buffers import material_records
from viewer.scene.model import Material, Sampler, Scene

SIDES = (8, 16, 32, 64)


def scene_of_textures(count: int) -> Scene:
    textures = [texture(SIDES[number % 4], SIDES[number // 4 % 4], number) for number in range(count)]
    nearest = Sampler(magnify_linear=False)
    materials = [
        Material(f"{number}", number, WHITE, sampler=nearest if number % 5 == 0 else Sampler())
        for number in range(count)
    ]
    # One texture that two materials share.
    return scene_of([], [*materials, Material("again", 1, WHITE), Material("plain", -1, WHITE)], textures)


def checked(places: ImagePlaces, scene: Scene, most_bytes: int) -> None:
    """What always holds."""
    assert places._bytes <= most_bytes
    for place, own in places.content.items():
        plan, (width, height) = places.plans[place.array], scene.textures[own.texture].size
        assert 0 <= place.layer < plan.layers
        assert plan.size == (max(1, width >> own.level), max(1, height >> own.level))
    total = sum(image_bytes(places.plans[place.array].size) for place in places.content)
    assert total == places._bytes
    assert {place.array for place in places.content} == set(places.plans)


def test_images_that_fit_have_their_places_for_good() -> None:
    scene = scene_of_textures(40)
    places = ImagePlaces(scene, "base")
    assert not places.is_bounded
    assert len(places.of(range(42))) == 40
    assert not places.pending
    before = dict(places.content)
    places.want([3])
    assert places.content == before
    assert all(own.level == 0 for own in before.values())


@pytest.mark.parametrize("seed", range(4))
def test_random_views_stay_within_the_budget(seed: int) -> None:
    scene, rng = scene_of_textures(60), np.random.default_rng(seed)
    most_bytes = plane_bytes(scene, "base") // int(rng.integers(3, 20))
    places = ImagePlaces(scene, "base", most_bytes)
    records = material_records(scene)
    for _ in range(60):
        visible = rng.choice(62, int(rng.integers(0, 62)), replace=False).tolist()
        places.want(visible)
        checked(places, scene, most_bytes)
        pending = list(places.pending)
        places.arrived(pending[: int(rng.integers(0, len(pending) + 1))])
        checked(places, scene, most_bytes)
        if rng.random() < 0.7:
            places.arrived(places.pending)
            there = places.of(visible)
            assert len(there) == len({(1 if number == 60 else number) for number in visible if number < 61})
            for place in there:
                whole = max(scene.textures[places.content[place].texture].size)
                assert max(places.plans[place.array].size) >= min(whole, places.side)
        places.write(records)
        arrays = records["planes"][:62, 0]["image_array"]
        assert set(arrays.tolist()) <= {-1, *places.plans}


def test_what_is_seen_alone_is_whole() -> None:
    scene = scene_of_textures(60)
    places = ImagePlaces(scene, "base", plane_bytes(scene, "base") // 4)
    places.want(range(60))
    places.arrived(places.pending)
    assert places.side < 64
    places.want([15])
    assert [own.level for own in places.pending.values()] == [0]
    coarse = next(iter(places.of([15])))
    assert places.content[coarse].level > 0
    places.arrived(places.pending)
    assert [places.content[place].level for place in places.of([15])] == [0]
    assert coarse not in places.content
