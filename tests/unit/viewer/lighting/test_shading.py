"""The float64 twin of shading: energy, lights, layers and tone maps."""

import math
from dataclasses import replace

import numpy as np
import pytest

from viewer.lighting.brdf import (
    Reflection,
    brdf_table,
    half_vectors,
    hammersley,
    light_response,
    normalized,
    reflection_of,
    table_lookup,
)
from viewer.lighting.directions import Array
from viewer.lighting.prefilter import PrefilteredEnvironment, PrefilterSize, prefilter
from viewer.lighting.shading import LightSources, SurfaceSamples, light_at, shade, shading_normals
from viewer.lighting.sky import sky_radiance
from viewer.lighting.tone_maps import TONE_MAPS, tone_mapped
from viewer.scene.model import DEFAULT_FACTORS, Light, SurfaceFactors
from viewer.state.view_state import ToneMap

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


def white(metalness: float, roughness: Array, base: float = 1.0) -> Reflection:
    ones = np.ones((len(roughness), 1))
    color = np.ones((len(roughness), 3))
    rough = roughness[:, None]
    return reflection_of(color * base, ones * metalness, rough, ones * 1.5, ones, color, ones * 0.0)


def sent_by_lights_all_around(surface: Reflection, roughness: float, cosine: float, samples: int = 4096) -> float:
    """What a surface sends back when single lights of radiance 1 stand everywhere: drawn half by GGX, half by the cosine."""
    view = np.array([[np.sqrt(1.0 - cosine**2), 0.0, cosine]])
    alpha = np.array(max(roughness, 0.045) ** 2)
    points = hammersley(samples)
    half = half_vectors(points, alpha)
    mirrored = 2.0 * np.sum(view * half, axis=1, keepdims=True) * half - view
    flat = np.sqrt(points[:, 0])
    turn = 2.0 * np.pi * points[:, 1]
    spread = np.stack([flat * np.cos(turn), flat * np.sin(turn), np.sqrt(1.0 - points[:, 0])], axis=-1)
    lights = np.concatenate([mirrored, spread])
    lights = lights[lights[:, 2] > 1e-6]
    halves = normalized(lights + view)
    spreading = halves[:, 2] ** 2 * (alpha**2 - 1.0) + 1.0
    by_half = alpha**2 / (np.pi * spreading**2) * halves[:, 2] / (4.0 * np.sum(halves * view, axis=1))
    density = (by_half + lights[:, 2] / np.pi) * samples
    normal = np.array([[0.0, 0.0, 1.0]])
    table = table_lookup(brdf_table(), np.array([[cosine]]), np.array([[roughness]]))
    response = light_response(surface, table, normal, view, lights)
    return float(np.sum(response[:, 0] / density))


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("cosine", [0.2, 0.5, 0.9])
def test_single_lights_everywhere_equal_a_white_environment(roughness: float, cosine: float) -> None:
    metal = white(1.0, np.array([roughness]))
    assert sent_by_lights_all_around(metal, roughness, cosine) == pytest.approx(1.0, abs=0.05)
    plastic = white(0.0, np.array([roughness]))
    # Appendix B takes from the diffuse layer what is mirrored at half the angle to the light: too little at grazing angles.
    assert 0.8 < sent_by_lights_all_around(plastic, roughness, cosine) < (1.1 if cosine > 0.2 else 1.35)


def test_what_is_transmitted_is_left_out() -> None:
    one, color = np.ones((1, 1)), np.ones((1, 3))
    glass = reflection_of(color, one * 0.0, one * 0.2, one * 1.5, one, color, one)
    assert not glass.diffuse.any()
    np.testing.assert_allclose(glass.dielectric, 0.04)


def test_ior_and_specular_set_the_reflectance_of_dielectrics_alone() -> None:
    one, color = np.ones((2, 1)), np.full((2, 3), 0.5)
    tint = np.array([[1.0, 0.5, 0.0]] * 2)
    found = reflection_of(color, np.array([[0.0], [1.0]]), one, one * 2.0, one * 0.5, tint, one * 0.0)
    np.testing.assert_allclose(found.dielectric, [[1 / 18, 1 / 36, 0.0]] * 2)
    np.testing.assert_allclose(found.dielectric_grazing, 0.5)
    np.testing.assert_allclose(found.metal, 0.5)


COLORS = np.concatenate(
    [
        np.random.default_rng(0).uniform(0.0, 1.0, (50, 3)),
        np.exp(np.random.default_rng(1).uniform(-9.0, 6.0, (50, 3))),
        [[0.0, 0.0, 0.0], [0.76, 0.76, 0.76], [0.8, 0.8, 0.8], [1e4, 0.0, 0.0], [0.08, 0.5, 0.08]],
    ]
)


def neutral(color: list[float]) -> list[float]:
    """KhronosGroup/ToneMapping, PBR_Neutral/README.md."""
    start, desaturation = 0.8 - 0.04, 0.15
    x = min(color)
    offset = x - 6.25 * x * x if x < 0.08 else 0.04
    color = [channel - offset for channel in color]
    peak = max(color)
    if peak < start:
        return color
    d = 1.0 - start
    new_peak = 1.0 - d * d / (peak + d - start)
    color = [channel * new_peak / peak for channel in color]
    g = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0)
    return [channel * (1.0 - g) + new_peak * g for channel in color]


def test_neutral_is_khronos_pbr_neutral() -> None:
    expected = [neutral(color) for color in COLORS.tolist()]
    np.testing.assert_allclose(TONE_MAPS["neutral"](COLORS), expected, atol=1e-12)


def agx_grey(value: float) -> float:
    """AgX of a grey, whose matrices have rows that sum to 1: the fitted curve alone."""
    x = (min(max(math.log2(value), -12.47393), 4.026069) + 12.47393) / (4.026069 + 12.47393)
    powers = (-0.00232, 0.1191, 0.4298, -6.868, 31.96, -40.14, 15.5)
    return max(0.0, min(1.0, sum(factor * x**power for power, factor in enumerate(powers)))) ** 2.2


def test_agx_of_greys_is_the_published_curve() -> None:
    values = np.exp2(np.linspace(-13.0, 5.0, 30))
    found = TONE_MAPS["agx"](np.repeat(values[:, None], 3, axis=1))
    np.testing.assert_allclose(found, [[agx_grey(value)] * 3 for value in values.tolist()], atol=1e-3)


@pytest.mark.parametrize("tone_map", ["neutral", "agx", "none"])
def test_results_are_pictures_and_grow_with_light(tone_map: ToneMap) -> None:
    mapped: Array = tone_mapped(COLORS, 0.0, tone_map)
    assert np.isfinite(mapped).all()
    assert mapped.min() >= 0.0
    assert mapped.max() <= 1.0
    greys = tone_mapped(np.repeat(np.geomspace(1e-3, 100.0, 200)[:, None], 3, axis=1), 0.0, tone_map)
    assert (np.diff(greys[:, 0]) > -2e-3).all()


def test_exposure_is_in_stops_and_negative_light_is_none() -> None:
    np.testing.assert_allclose(tone_mapped(np.array([[0.1, 0.2, 0.3]]), 1.0, "none"), [[0.2, 0.4, 0.6]])
    assert not tone_mapped(np.array([[-1.0, 0.0, 0.0]]), 0.0, "neutral").any()
