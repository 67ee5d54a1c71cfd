"""Lit pictures against the float64 twin, maps as they are stored, mixtures of two sets of planes."""

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.maps import MAPS, PLANE_COMPONENTS, PLANE_OF_MAP, MapName
from ntc.codec.mips import linear_to_srgb
from tests.support.lit_studio import LitStudio, Planes, sphere_grid
from viewer.gl.context import GraphicsContext
from viewer.lighting.prefilter import SKY_SIZE, PrefilteredEnvironment, prefilter
from viewer.lighting.sky import sky_radiance
from viewer.render.resources.scene_buffers import COMPONENTS_OF_MAP
from viewer.scene.model import Light, Scene, SurfaceFactors
from viewer.state.view_state import Lighting, ToneMap

SIZE = (96, 72)
ELEVATION = 35.0
LIGHTING = Lighting(sun_azimuth=150.0, sun_elevation=ELEVATION)
LIGHTS = (
    Light("point", (0.8, 0.2, 0.1), (0.0, 0.5, 1.2), reach=6.0),
    Light("spot", (0.1, 0.9, 2.0), (-2.0, 2.0, 2.0), (0.5, -0.6, -0.6), inner_cone=0.2, outer_cone=0.6),
    Light("directional", (0.3, 0.3, 0.2), direction=(0.0, -1.0, -0.2)),
)


@lru_cache(maxsize=1)
def sky() -> PrefilteredEnvironment:
    return prefilter(sky_radiance(ELEVATION), SKY_SIZE)


def any_factors(seed: int) -> list[list[SurfaceFactors]]:
    """3 x 4 materials of all kinds: mirrors, glass, coats, glow, odd indices."""
    random = np.random.default_rng(seed)

    def one() -> SurfaceFactors:
        pick = random.choice([0.0, 1.0, -1.0], 8)
        value = np.where(pick < 0.0, random.uniform(size=8), pick).tolist()
        return SurfaceFactors(
            roughness=value[0],
            metalness=value[1],
            normal_scale=float(random.choice([1.0, 0.0, 2.5, -1.0])),
            occlusion_strength=value[2],
            emissive=tuple((0.4 * random.uniform(size=3)).tolist()),
            ior=float(random.choice([1.0, 1.5, 2.4, 0.0])),
            specular=value[3],
            specular_color=tuple(random.uniform(size=3).tolist()),
            clearcoat=value[4],
            clearcoat_roughness=value[5],
            transmission=value[6],
        )

    return [[one() for _ in range(4)] for _ in range(3)]


def scene_of_spheres(seed: int = 0, lights: tuple[Light, ...] = ()) -> tuple[Scene, LitStudio | None]:
    spheres = sphere_grid(any_factors(seed))
    unlit = replace(spheres.scene.materials[5], unlit=True)
    materials = (*spheres.scene.materials[:5], unlit, *spheres.scene.materials[6:])
    return replace(spheres.scene, materials=materials, lights=lights), None


@pytest.fixture(scope="module")
def studio(graphics: GraphicsContext) -> Iterator[LitStudio]:
    scene, _ = scene_of_spheres()
    made = LitStudio(graphics, scene, sphere_grid(any_factors(0)).camera, SIZE)
    yield made
    made.release()


def random_planes(seed: int, studio: LitStudio, smooth: bool = True) -> Planes:
    """Planes of 8-bit values; hostile ones have any normals, mirrors and blacks from pixel to pixel."""
    random = np.random.default_rng(seed)
    shape = (SIZE[1], SIZE[0])
    base = random.integers(0, 256, (*shape, 4)) / 255.0
    surface = random.integers(0, 256, (*shape, 4)) / 255.0
    emission = random.integers(0, 256, (*shape, 4)) / 255.0
    if smooth:
        surface[..., :2] = 0.5 + 0.4 * (surface[..., :2] - 0.5)
    else:
        surface[::2] = np.round(surface[::2])
        emission[1::2] = np.round(emission[1::2])
    covered = (studio.materials() >= 0)[..., None]
    return {
        name: np.where(covered, pixels, 0.0).astype(np.float32)
        for name, pixels in (("base", base), ("surface", surface), ("emission", emission))
    }


def steps_apart(found: NDArray[np.floating], expected: NDArray[np.floating]) -> NDArray[np.float64]:
    """[H, W] largest difference of sRGB values in steps of 8 bits."""
    pictures = [linear_to_srgb(np.asarray(picture, np.float64)) for picture in (found, expected)]
    return np.abs(pictures[0] - pictures[1]).max(axis=-1) * 255.0


def assert_agrees(found: NDArray[np.float32], expected: NDArray[np.float64], studio: LitStudio) -> None:
    assert np.isfinite(found).all()
    apart = steps_apart(found, expected)
    covered = studio.materials() >= 0
    assert (apart[covered] <= 2.0).mean() >= 0.99
    assert (apart[~covered] <= 2.0).mean() >= 0.99


@pytest.mark.parametrize("tone_map", ["neutral", "agx", "none"])
def test_lit_pictures_are_those_of_the_twin(studio: LitStudio, tone_map: ToneMap) -> None:
    lighting = replace(LIGHTING, tone_map=tone_map, exposure=-0.7)
    light = replace(studio.light_drawer.prepare(lighting), shadow=None)
    planes = random_planes(1, studio)
    found = studio.draw(studio.planes(planes), light=light)
    assert_agrees(found, studio.expected(planes, sky(), sky_radiance(ELEVATION), lighting, light), studio)


def test_hostile_maps_are_shaded_as_by_the_twin(studio: LitStudio) -> None:
    light = replace(studio.light_drawer.prepare(LIGHTING), shadow=None)
    planes = random_planes(2, studio, smooth=False)
    found = studio.draw(studio.planes(planes), light=light)
    assert_agrees(found, studio.expected(planes, sky(), sky_radiance(ELEVATION), LIGHTING, light), studio)


def test_planes_that_are_not_given_are_neutral(studio: LitStudio) -> None:
    light = replace(studio.light_drawer.prepare(LIGHTING), shadow=None)
    planes = {"base": studio.factor_base()}
    found = studio.draw(studio.planes(planes), light=light)
    assert_agrees(found, studio.expected(planes, sky(), sky_radiance(ELEVATION), LIGHTING, light), studio)


def test_lights_of_the_scene_shine_as_by_the_twin(graphics: GraphicsContext) -> None:
    scene, _ = scene_of_spheres(3, LIGHTS)
    lighting = replace(LIGHTING, sun_strength=0.0, exposure=-1.0)
    made = LitStudio(graphics, scene, sphere_grid(any_factors(3)).camera, SIZE)
    light = made.light_drawer.prepare(lighting)
    planes = random_planes(4, made)
    found = made.draw(made.planes(planes), light=light)
    expected = made.expected(planes, sky(), sky_radiance(ELEVATION), lighting, light, LIGHTS)
    dark = made.draw(made.planes(planes), light=replace(light, lights=()))
    assert steps_apart(found, dark).max() > 20.0
    assert_agrees(found, expected, made)
    made.release()


def test_views_of_maps_show_the_stored_bytes(studio: LitStudio) -> None:
    planes = random_planes(5, studio, smooth=False)
    targets = studio.planes(planes)
    covered = studio.materials() >= 0
    normal = linear_to_srgb(studio.draw(targets, "normal").astype(np.float64)) * 255.0
    np.testing.assert_allclose(normal[covered][:, :2], planes["surface"][covered][:, :2] * 255.0, atol=0.02)
    xy = planes["surface"][covered][:, :2].astype(np.float64) * 2.0 - 1.0
    z = np.sqrt(np.maximum(1.0 - (xy**2).sum(axis=1), 0.0)) * 0.5 + 0.5
    np.testing.assert_allclose(normal[covered][:, 2], z * 255.0, atol=0.05)
    orm = linear_to_srgb(studio.draw(targets, "orm").astype(np.float64)) * 255.0
    stored = np.concatenate([planes["emission"][..., 3:], planes["surface"][..., 2:]], axis=-1)
    np.testing.assert_allclose(orm[covered], stored[covered] * 255.0, atol=0.02)
    emissive = studio.draw(targets, "emissive")
    factors = np.array([material.factors.emissive for material in studio.scene.materials])[studio.materials()]
    np.testing.assert_allclose(emissive[covered], (planes["emission"][..., :3] * factors)[covered], atol=1e-5)
    for picture in (normal, orm, emissive):
        assert not picture[~covered].any()


@pytest.mark.parametrize("name", MAPS)
def test_single_maps_come_from_the_other_planes(studio: LitStudio, name: MapName) -> None:
    light = replace(studio.light_drawer.prepare(LIGHTING), shadow=None)
    first, second = random_planes(6, studio), random_planes(7, studio)
    plane = PLANE_OF_MAP[name]
    start = PLANE_COMPONENTS[plane][name]
    swapped = {key: pixels.copy() for key, pixels in first.items()}
    part = slice(start, start + COMPONENTS_OF_MAP[name])
    swapped[plane][..., part] = second[plane][..., part]
    expected = studio.draw(studio.planes(swapped), light=light)
    found = studio.draw(
        studio.planes(first), light=light, other=studio.planes(second, "b"), other_maps=frozenset({name})
    )
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert np.abs(found - studio.draw(studio.planes(first), light=light)).max() > 0.01


def test_nothing_is_lit_anew_at_rest(studio: LitStudio) -> None:
    planes = studio.planes({"base": studio.factor_base()})
    studio.draw(planes, light=studio.light_drawer.prepare(LIGHTING))
    studio.scheduler.take_skipped()
    studio.scheduler.timer.take()
    studio.draw(planes, light=studio.light_drawer.prepare(LIGHTING))
    assert not {"prefilter", "shadow", "shade", "visibility"} & set(studio.scheduler.timer.take())
    assert studio.scheduler.take_skipped()["passes"] >= 4
    studio.draw(planes, light=studio.light_drawer.prepare(replace(LIGHTING, exposure=1.0)))
    assert set(studio.scheduler.timer.take()) >= {"shade"}
    studio.draw(planes, light=studio.light_drawer.prepare(replace(LIGHTING, sun_azimuth=20.0)))
    # Skies turn with their sun: only the shadow is drawn anew.
    assert {"prefilter", "shadow"} & set(studio.scheduler.timer.take()) == {"shadow"}
