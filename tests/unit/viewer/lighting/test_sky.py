"""Directions, their two maps, the sky and the sun."""

import numpy as np
import pytest

from viewer.lighting.directions import (
    direction_towards,
    octahedral_coordinates,
    octahedral_directions,
    panorama_coordinates,
    panorama_directions,
    panorama_solid_angles,
    turned,
)
from viewer.lighting.prefilter import irradiance, irradiance_harmonics
from viewer.lighting.sky import sky_radiance, sun_irradiance
from viewer.lighting.sun import environment_turn, sun_of
from viewer.state.view_state import Lighting


def some_directions(count: int = 500) -> np.ndarray:
    vectors = np.random.default_rng(3).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def test_azimuth_runs_from_north_to_east() -> None:
    np.testing.assert_allclose(direction_towards(0.0, 0.0), (0.0, 0.0, -1.0), atol=1e-12)
    np.testing.assert_allclose(direction_towards(90.0, 0.0), (1.0, 0.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(direction_towards(90.0, 90.0), (0.0, 1.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(turned(np.array([[0.0, 0.3, -1.0]]), 90.0), [[1.0, 0.3, 0.0]], atol=1e-12)


def test_both_maps_have_one_place_for_each_direction() -> None:
    directions = some_directions()
    np.testing.assert_allclose(octahedral_directions(octahedral_coordinates(directions)), directions, atol=1e-12)
    height = 16
    u, v = np.moveaxis(panorama_coordinates(panorama_directions(height)), -1, 0)
    np.testing.assert_allclose(u[0], (np.arange(2 * height) + 0.5) / (2 * height))
    np.testing.assert_allclose(v[:, 0], (np.arange(height) + 0.5) / height)
    assert panorama_solid_angles(height).sum() * 2 * height == pytest.approx(4.0 * np.pi)


def test_the_octahedral_map_goes_on_beyond_its_edges() -> None:
    inside = np.array([[0.01, 0.3], [0.7, 0.99], [0.02, 0.02], [0.98, 0.01]])
    outside = np.array([[-0.01, 0.7], [0.3, 1.01], [-0.02, 0.98], [0.02, -0.01]])
    np.testing.assert_allclose(octahedral_directions(outside), octahedral_directions(inside), atol=1e-12)
    np.testing.assert_allclose(
        octahedral_directions(np.array([[-0.02, -0.02]])), octahedral_directions(np.array([[0.98, 0.98]])), atol=1e-12
    )


@pytest.mark.parametrize("elevation", [-90.0, -12.0, -0.1, 0.0, 3.0, 40.0, 89.9, 90.0])
def test_skies_are_radiance_at_every_elevation(elevation: float) -> None:
    sky = sky_radiance(elevation, 32)
    assert sky.shape == (32, 64, 3)
    assert sky.dtype == np.float32
    assert np.isfinite(sky).all()
    assert sky.min() >= 0.0


def test_a_sky_is_brightest_and_bluest_where_it_should_be() -> None:
    sky = sky_radiance(40.0, 64)
    row, column = np.unravel_index(sky[:32].sum(axis=2).argmax(), (32, 128))
    assert abs(row - 64 * 50 / 180) <= 2
    assert abs(column - 63.5) <= 1
    red, _, blue = sky[8, 0]
    assert blue > 1.5 * red
    np.testing.assert_allclose(sky_radiance(40.0, 64, azimuth=90.0), np.roll(sky, 32, axis=1), rtol=1e-4)


def test_noon_lights_a_white_floor_to_about_one_and_night_is_dark() -> None:
    sky = irradiance(irradiance_harmonics(sky_radiance(50.0)), np.array([[0.0, 1.0, 0.0]]))[0]
    sun = np.array(sun_irradiance(50.0)) / np.pi * np.sin(np.radians(50.0))
    assert ((sky + sun > 0.7) & (sky + sun < 1.7)).all()
    assert sky_radiance(-20.0).max() < 1e-3


def test_the_sun_reddens_towards_the_horizon_and_sets() -> None:
    high, low = sun_irradiance(60.0), sun_irradiance(3.0)
    assert low[2] / low[0] < 0.5 * high[2] / high[0]
    assert sun_irradiance(-0.3) == (0.0, 0.0, 0.0)
    assert not sun_of(Lighting(sun_elevation=-5.0)).shines
    assert not sun_of(Lighting(sun_strength=0.0)).shines
    assert sun_of(Lighting(sun_azimuth=90.0, sun_elevation=0.0)).direction == pytest.approx((1.0, 0.0, 0.0))


def test_skies_turn_with_their_sun_and_panoramas_as_they_are_told() -> None:
    assert environment_turn(Lighting(sun_azimuth=30.0, environment_turn=5.0)) == 30.0
    assert environment_turn(Lighting("a.hdr", sun_azimuth=30.0, environment_turn=5.0)) == 5.0


def test_harmonics_give_the_irradiance_of_simple_environments() -> None:
    directions = panorama_directions(32)
    even = irradiance_harmonics(np.ones((32, 64, 3), np.float32))
    np.testing.assert_allclose(irradiance(even, some_directions()), 1.0, atol=2e-3)
    # Radiance 1 + y has irradiance pi (1 + 2/3 ny).
    slope = irradiance_harmonics(np.repeat(1.0 + directions[..., 1:2], 3, axis=2).astype(np.float32))
    normals = some_directions()
    np.testing.assert_allclose(irradiance(slope, normals)[:, 0], 1.0 + 2.0 / 3.0 * normals[:, 1], atol=5e-3)
