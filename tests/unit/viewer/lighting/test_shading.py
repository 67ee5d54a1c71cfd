"""The float64 twin: normals that are never broken, lights, layers."""

from dataclasses import replace

import numpy as np
import pytest

from viewer.lighting.directions import Array
from viewer.lighting.prefilter import PrefilteredEnvironment, PrefilterSize, prefilter
from viewer.lighting.shading import LightSources, SurfaceSamples, light_at, shade, shading_normals
from viewer.lighting.sky import sky_radiance
from viewer.scene.model import DEFAULT_FACTORS, Light, SurfaceFactors

SMALL = PrefilterSize(16, (16, 16, 8, 8), 16, 8)


def constant(radiance: float) -> PrefilteredEnvironment:
    return prefilter(np.full((16, 32, 3), radiance, np.float32), SMALL)


def flat(count: int, factors: SurfaceFactors = DEFAULT_FACTORS, unlit: bool = False) -> SurfaceSamples:
    """White, neutral surfaces that face up, seen from above at random."""
    random = np.random.default_rng(5)
    views = random.normal(size=(count, 3))
    views[:, 1] = np.abs(views[:, 1]) + 0.2
    ones = np.ones((count, 4))
    return SurfaceSamples(
        [factors] * count,
        ones[:, :3],
        ones * [0.5, 0.5, 1.0, 1.0],
        ones,
        ones[:, :3] * [0.0, 1.0, 0.0],
        ones * [1.0, 0.0, 0.0, 1.0],
        np.zeros((count, 3)),
        views / np.linalg.norm(views, axis=1, keepdims=True),
        [unlit] * count,
    )


@pytest.mark.parametrize("metalness", [0.0, 1.0])
@pytest.mark.parametrize("roughness", [0.0, 0.3, 0.7, 1.0])
def test_white_surfaces_disappear_in_a_white_furnace(metalness: float, roughness: float) -> None:
    samples = flat(50, SurfaceFactors(roughness=roughness, metalness=metalness))
    np.testing.assert_allclose(shade(samples, LightSources(constant(1.0))), 1.0, atol=0.05)


def hostile_normals() -> tuple[Array, Array, Array, Array]:
    random = np.random.default_rng(6)
    normals = random.normal(size=(200, 3))
    tangents = np.concatenate([random.normal(size=(200, 3)), random.choice([-1.0, 0.0, 1.0], (200, 1))], axis=1)
    tangents[:50, :3] = 0.0
    tangents[50:80, :3] = normals[50:80]
    normals[80:90] = 0.0
    stored = random.choice([0.0, 0.5, 1.0, 128 / 255], (200, 2))
    scale = random.choice([0.0, 1.0, -2.0, 1e6], (200, 1))
    return normals, tangents, stored, scale


def test_normals_have_length_one_whatever_is_given() -> None:
    found = shading_normals(*hostile_normals())
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-6)


def test_a_neutral_normal_is_the_surfaces_own_and_x_leans_along_the_tangent() -> None:
    normals, tangents = np.array([[0.0, 0.0, 2.0]]), np.array([[3.0, 0.0, 0.5, -1.0]])
    one = np.ones((1, 1))
    np.testing.assert_allclose(shading_normals(normals, tangents, one * [0.5, 0.5], one), [[0, 0, 1]], atol=1e-12)
    leaning = shading_normals(normals, tangents, one * [0.8, 0.5], one)
    np.testing.assert_allclose(leaning, [[0.6, 0.0, 0.8]], atol=1e-12)
    # glTF: y is up in the picture, along the bitangent, whose sign is that of the tangent.
    below = shading_normals(normals, tangents, one * [0.5, 0.8], one)
    np.testing.assert_allclose(below, [[0.0, -0.6, 0.8]], atol=1e-12)


def test_lights_fall_off_as_khr_lights_punctual_says() -> None:
    place = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    point = Light("point", (8.0, 4.0, 0.0), (0.0, 2.0, 0.0), reach=4.0)
    towards, received = light_at(point, place)
    np.testing.assert_allclose(towards[0], [0.0, 1.0, 0.0])
    np.testing.assert_allclose(received[0], np.array([8.0, 4.0, 0.0]) / 4.0 * (1.0 - 0.5**4))
    spot = Light("spot", (1.0, 1.0, 1.0), (0.0, 2.0, 0.0), (0.0, -1.0, 0.0), inner_cone=0.1, outer_cone=0.4)
    np.testing.assert_allclose(light_at(spot, place)[1][0], 0.25)
    assert not light_at(spot, place)[1][1].any()
    distant = Light("directional", (2.0, 2.0, 2.0), direction=(0.0, 0.0, -3.0))
    np.testing.assert_allclose(light_at(distant, place)[0], [[0.0, 0.0, 1.0]] * 2)


def test_emission_adds_occlusion_takes_of_the_environment_alone() -> None:
    glowing = SurfaceFactors(emissive=(0.0, 2.0, 0.0), metalness=0.0)
    samples, sources = flat(10, glowing), LightSources(constant(1.0), sun_irradiance=(1.0, 1.0, 1.0))
    dark = replace(samples, emission=samples.emission * [1.0, 1.0, 1.0, 0.0])
    lit, occluded = shade(samples, sources), shade(dark, sources)
    np.testing.assert_allclose(lit[:, 1] - lit[:, 0], 2.0)
    np.testing.assert_allclose(lit - occluded, 1.0, atol=0.05)
    half = replace(dark, factors=[replace(glowing, occlusion_strength=0.5)] * 10)
    np.testing.assert_allclose(shade(half, sources), (lit + occluded) / 2.0)


def test_unlit_materials_show_their_base_colour() -> None:
    samples = flat(3, SurfaceFactors(emissive=(1.0, 1.0, 1.0)), unlit=True)
    np.testing.assert_array_equal(shade(samples, LightSources(constant(3.0))), 1.0)


def test_a_clear_coat_reflects_on_top_and_keeps_energy() -> None:
    rough = SurfaceFactors(metalness=0.0)
    coated = replace(rough, clearcoat=1.0, clearcoat_roughness=0.1)
    # Seen in a furnace it changes nothing but by what the coat itself scatters; under a light it shines.
    np.testing.assert_allclose(shade(flat(50, coated), LightSources(constant(1.0))), 1.0, atol=0.05)
    above = LightSources(constant(0.0), sun_direction=(0.0, 1.0, 0.0), sun_irradiance=(1.0, 1.0, 1.0))
    samples = replace(flat(1, coated), views=np.array([[0.0, 1.0, 0.0]]))
    assert (shade(samples, above) > 3.0 * shade(replace(samples, factors=[rough]), above)).all()


def test_shade_is_finite_for_hostile_surfaces() -> None:
    normals, tangents, stored, scale = hostile_normals()
    random = np.random.default_rng(7)
    samples = flat(len(normals))
    factors = [
        SurfaceFactors(roughness=float(r), metalness=float(m), normal_scale=float(s), clearcoat=float(c), ior=float(i))
        for r, m, s, c, i in zip(
            *random.choice([0.0, 1.0], (2, 200)), scale[:, 0], *random.choice([0.0, 1.0], (2, 200)), strict=True
        )
    ]
    samples = replace(
        samples,
        factors=factors,
        normals=normals,
        tangents=tangents,
        surface=np.concatenate([stored, random.choice([0.0, 1.0], (200, 2))], axis=1),
    )
    sky = prefilter(sky_radiance(20.0, 16), SMALL)
    lights = (Light("point", (1.0, 1.0, 1.0)), Light("spot", (1.0, 1.0, 1.0), inner_cone=0.5, outer_cone=0.5))
    found = shade(samples, LightSources(sky, 30.0, (0.0, 1.0, 0.0), (3.0, 3.0, 3.0), lights))
    assert np.isfinite(found).all()
    assert found.min() >= 0.0
