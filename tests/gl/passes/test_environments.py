"""Prefiltered environments, the furnace that they make, and shadows of the sun."""

import threading
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import OpenImageIO
import pytest

from ntc.errors import InputError
from tests.support.lit_studio import LitStudio, sphere_grid
from viewer.gl.context import GraphicsContext
from viewer.lighting.prefilter import PANORAMA_SIZE, SKY_SIZE, PrefilterSize, irradiance_map, prefilter
from viewer.lighting.sky import sky_radiance
from viewer.locations import cache_folder
from viewer.render.pass_scheduler import Budget, Step
from viewer.render.passes.prefilter import PrefilterInputs, PrefilterPass
from viewer.render.resources.light import EnvironmentMaps
from viewer.render.resources.pack_buffers import scene_programs
from viewer.scene.model import Material, SurfaceFactors
from viewer.state.view_state import Lighting

SIZE = (120, 60)
ROUGHNESSES = (0.0, 0.25, 0.5, 0.75, 1.0)


def panorama_file(path: Path, pixels: np.ndarray) -> str:
    height, width, _ = pixels.shape
    output = OpenImageIO.ImageOutput.create(str(path))
    assert output is not None
    assert output.open(str(path), OpenImageIO.ImageSpec(width, height, 3, "float"))
    assert output.write_image(np.ascontiguousarray(pixels, np.float32))
    output.close()
    return str(path)


def maps_of(environment: EnvironmentMaps, size: PrefilterSize) -> np.ndarray:
    width, height = size.texture_size
    return np.frombuffer(environment.maps.read(), np.float32).reshape(height, width, 4)[..., :3]


def grid_studio(graphics: GraphicsContext) -> LitStudio:
    factors = [[SurfaceFactors(roughness=r, metalness=m) for r in ROUGHNESSES] for m in (0.0, 1.0)]
    spheres = sphere_grid(factors)
    return LitStudio(graphics, spheres.scene, spheres.camera, SIZE)


def test_the_sky_is_prefiltered_as_by_the_twin(graphics: GraphicsContext) -> None:
    studio = grid_studio(graphics)
    for elevation in (50.0, 3.0):
        light = studio.light_drawer.prepare(Lighting(sun_elevation=elevation))
        twin = prefilter(sky_radiance(elevation), SKY_SIZE)
        np.testing.assert_allclose(maps_of(light.environment, SKY_SIZE), twin.maps, rtol=2e-3, atol=1e-3)
    studio.release()


def test_panoramas_are_prefiltered_once_and_kept(graphics: GraphicsContext, tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    pixels = random.gamma(0.3, 2.0, (64, 128, 3))
    lighting = Lighting(panorama_file(tmp_path / "a.exr", pixels), environment_turn=40.0)
    studio = grid_studio(graphics)
    before = set(cache_folder("environments").glob("*"))
    found = maps_of(studio.light_drawer.prepare(lighting).environment, PANORAMA_SIZE)
    kept = set(cache_folder("environments").glob("*")) - before
    assert len(kept) == 1
    studio.release()
    # Blurred maps have the mean of what they blur.
    side, top, first = PANORAMA_SIZE.sides[-1], PANORAMA_SIZE.tops[-2], PANORAMA_SIZE.sides[0]
    rough, sharp = found[top + 1 : top + 1 + side, 1 : 1 + side], found[1 : 1 + first, 1 : 1 + first]
    assert rough.mean() == pytest.approx(sharp.mean(), rel=0.1)
    assert rough.std() < 0.2 * sharp.std()

    again = grid_studio(graphics)
    np.testing.assert_array_equal(maps_of(again.light_drawer.prepare(lighting).environment, PANORAMA_SIZE), found)
    again.release()
    path = kept.pop()
    path.write_bytes(path.read_bytes()[:-1] + b"?")
    spoilt = grid_studio(graphics)
    np.testing.assert_array_equal(maps_of(spoilt.light_drawer.prepare(lighting).environment, PANORAMA_SIZE), found)
    spoilt.release()


def test_a_frame_that_waits_finishes_what_a_thread_filters(graphics: GraphicsContext) -> None:
    inputs = PrefilterInputs("white", np.ones((32, 64, 3), np.float32), is_cached=True)
    output = EnvironmentMaps(graphics, PANORAMA_SIZE, 64)
    prefiltering = PrefilterPass(replace(graphics, waits=False), scene_programs(graphics))
    started, may_end = threading.Event(), threading.Event()

    def slow_irradiance(panorama: np.ndarray, side: int) -> np.ndarray:
        started.set()
        assert may_end.wait(60.0)
        return irradiance_map(panorama, side)

    with patch("viewer.render.passes.prefilter.irradiance_map", slow_irradiance):
        assert prefiltering.advance(inputs, output, Step(Budget.SHARE, is_same_view=False, is_stale=False)).pending
        assert started.wait(60.0)
        threading.Timer(0.1, may_end.set).start()
        assert not prefiltering.advance(inputs, output, Step(Budget.WHOLE, is_same_view=True, is_stale=False)).pending
    white = maps_of(output, PANORAMA_SIZE)[PANORAMA_SIZE.tops[-1] + 1, 1 : 1 + PANORAMA_SIZE.irradiance_side]
    np.testing.assert_allclose(white, 1.0, atol=0.05)
    prefiltering.release()
    output.release()


def test_panoramas_turn_from_north_to_east(graphics: GraphicsContext, tmp_path: Path) -> None:
    pixels = np.zeros((32, 64, 3), np.float32)
    pixels[:, 24:40] = 0.5
    path = panorama_file(tmp_path / "north.exr", pixels)
    studio = grid_studio(graphics)
    studio.camera = replace(studio.camera, eye=(0.0, 20.0, 0.0), target=(1.0, 20.0, 0.0))
    planes = studio.planes({"base": studio.factor_base()})
    for turn, bright in ((0.0, False), (90.0, True), (180.0, False)):
        light = studio.light_drawer.prepare(Lighting(path, environment_turn=turn, sun_strength=0.0, tone_map="none"))
        picture = studio.draw(planes, light=light)
        assert (picture[10, SIZE[0] // 2, 0] > 0.4) == bright
    # Maps of other sizes take the place of these.
    wide = panorama_file(tmp_path / "wide.exr", np.full((64, 128, 3), 0.5, np.float32))
    studio.light_drawer.prepare(Lighting())
    light = studio.light_drawer.prepare(Lighting(wide, sun_strength=0.0, tone_map="none"))
    np.testing.assert_allclose(maps_of(light.environment, PANORAMA_SIZE)[1:33, 1:33], 0.5, atol=0.01)
    studio.release()


def test_files_that_are_no_panoramas_are_one_line(graphics: GraphicsContext, tmp_path: Path) -> None:
    studio = grid_studio(graphics)
    good = studio.light_drawer.prepare(Lighting())
    with pytest.raises(InputError, match=r"missing\.hdr: cannot be read"):
        studio.light_drawer.prepare(Lighting(str(tmp_path / "missing.hdr")))
    assert studio.light_drawer.prepare_or_sky(Lighting(str(tmp_path / "missing.hdr"))) == good
    assert "the sky is shown instead of missing.hdr" in studio.light_drawer.problem
    assert (studio.light_drawer.prepare_or_sky(Lighting()), studio.light_drawer.problem) == (good, "")
    studio.release()


def sun_shares(studio: LitStudio, lighting: Lighting) -> tuple[np.ndarray, np.ndarray]:
    """([H, W] share of the sun that each pixel sees, [H, W] whether its surface faces the sun)."""
    lighting = replace(lighting, exposure=-3.0, tone_map="none")
    planes = studio.planes({"base": studio.factor_base()})
    shaded = studio.light_drawer.prepare(lighting)
    pictures = [
        studio.draw(planes, light=light).sum(axis=-1)
        for light in (
            shaded,
            replace(shaded, shadow=None),
            studio.light_drawer.prepare(replace(lighting, sun_strength=0.0)),
        )
    ]
    full = pictures[1] - pictures[2]
    faces = full > 0.02
    return np.where(faces, (pictures[0] - pictures[2]) / np.where(faces, full, 1.0), 0.0), faces & (
        studio.materials() >= 0
    )


@pytest.mark.parametrize(("azimuth", "elevation"), [(130.0, 35.0), (205.0, 25.0)])
def test_spheres_shade_the_floor_and_one_another(graphics: GraphicsContext, azimuth: float, elevation: float) -> None:
    factors = [[SurfaceFactors(metalness=0.0)] * 4] * 2
    spheres = sphere_grid(factors, (0.6, 0.6, 0.6), steps=48)
    studio = LitStudio(graphics, spheres.scene, spheres.camera, (160, 100))
    lighting = Lighting(sun_azimuth=azimuth, sun_elevation=elevation)
    shares, faces = sun_shares(studio, lighting)
    places = studio.places()
    sun = np.array(studio.light_drawer.prepare(lighting).sun.direction)
    hidden = np.zeros(faces.shape, bool)
    for transform in spheres.scene.instances.transform[:8]:
        towards = transform[:3, 3] - places
        along = towards @ sun
        distance = np.linalg.norm(towards - along[..., None] * sun, axis=-1)
        hidden |= (along > 0.05) & (distance < 0.449)
    agrees = (shares > 0.5) == ~hidden
    assert hidden[faces].sum() > 50
    assert agrees[faces].mean() > 0.97
    studio.release()


def test_holes_of_masked_materials_let_the_sun_through(graphics: GraphicsContext) -> None:
    spheres = sphere_grid([[SurfaceFactors(metalness=0.0)]], (0.6, 0.6, 0.6))
    shares = []
    for alpha in (1.0, 0.2):
        own = replace(spheres.scene.materials[0], alpha_mode="mask", factor=(0.6, 0.6, 0.6, alpha))
        scene = replace(spheres.scene, materials=(own, spheres.scene.materials[1]))
        studio = LitStudio(graphics, scene, spheres.camera, (80, 60))
        share, faces = sun_shares(studio, Lighting(sun_azimuth=150.0, sun_elevation=50.0))
        floor = faces & (studio.materials() == 1)
        shares.append(float(share[floor].mean()))
        studio.release()
    assert shares[0] < 0.95
    assert shares[1] > 0.99
    assert Material("m", -1, (1.0, 1.0, 1.0, 1.0)).alpha_mode == "opaque"
