"""Skies, suns and panoramas: directions, radiance, and files that are wrong."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
import pytest

from ntc.errors import InputError
from viewer.export.web.light import SIDES, sky_cube
from viewer.lighting import panorama
from viewer.lighting.directions import (
    cube_coordinates,
    cube_directions,
    direction_towards,
    octahedral_coordinates,
    octahedral_directions,
    panorama_coordinates,
    panorama_directions,
    panorama_solid_angles,
    turned,
)
from viewer.lighting.panorama import LARGEST_RADIANCE, load_panorama, reduced
from viewer.lighting.prefilter import PrefilteredEnvironment, PrefilterSize, irradiance_map, sample_panorama
from viewer.lighting.sky import environment_turn, sky_radiance, sun_irradiance, sun_of
from viewer.lighting.studio import METERED, studio_radiance
from viewer.state.view_state import Lighting


def some_directions(count: int = 500) -> np.ndarray:
    vectors = np.random.default_rng(3).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def irradiance(panorama: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """[N, 3] irradiance over pi, read as the shading reads it."""
    size = PrefilterSize(1, (1, 1), 1, 16)
    width, height = size.texture_size
    maps = np.zeros((height, width, 3))
    maps[size.tops[-1] :] = irradiance_map(panorama, 16).reshape(18, width, 3)
    return PrefilteredEnvironment(size, maps).irradiance(normals)


def test_azimuth_runs_from_north_to_east() -> None:
    np.testing.assert_allclose(direction_towards(0.0, 0.0), (0.0, 0.0, -1.0), atol=1e-12)
    np.testing.assert_allclose(direction_towards(90.0, 0.0), (1.0, 0.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(direction_towards(90.0, 90.0), (0.0, 1.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(turned(np.array([[0.0, 0.3, -1.0]]), 90.0), [[1.0, 0.3, 0.0]], atol=1e-12)


def test_maps_have_one_place_for_each_direction() -> None:
    directions = some_directions()
    np.testing.assert_allclose(octahedral_directions(octahedral_coordinates(directions)), directions, atol=1e-12)
    height = 16
    u, v = np.moveaxis(panorama_coordinates(panorama_directions(height)), -1, 0)
    np.testing.assert_allclose(u[0], (np.arange(2 * height) + 0.5) / (2 * height))
    np.testing.assert_allclose(v[:, 0], (np.arange(height) + 0.5) / height)
    assert panorama_solid_angles(height).sum() * 2 * height == pytest.approx(4.0 * np.pi)


def test_cubes_have_one_place_for_each_direction_and_go_on_beyond_their_faces() -> None:
    side = 5
    directions = cube_directions(side)
    faces, places = cube_coordinates(directions[1:-1, :, 1:-1])
    assert (faces == np.arange(6)[:, None]).all()
    centres = (np.arange(side) + 0.5) / side
    np.testing.assert_allclose(places[:, :, :, 0], np.broadcast_to(centres, (side, 6, side)), atol=1e-12)
    np.testing.assert_allclose(places[:, 2, 3, 1], centres, atol=1e-12)
    # Beyond +X along +Y lies the face +Y.
    assert cube_coordinates(directions[3, 0, side + 1])[0] == 1
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1.0)


@pytest.mark.parametrize("elevation", [-90.0, -12.0, -0.1, 0.0, 3.0, 40.0, 89.9, 90.0])
def test_skies_are_radiance_at_every_elevation(elevation: float) -> None:
    sky = sky_radiance(elevation, 32)
    assert sky.shape == (32, 64, 3)
    assert sky.dtype == np.float32
    assert np.isfinite(sky).all()
    assert sky.min() >= 0.0


def test_the_sun_reddens_towards_the_horizon_and_sets() -> None:
    high, low = sun_irradiance(60.0), sun_irradiance(3.0)
    assert low[2] / low[0] < 0.5 * high[2] / high[0]
    assert sun_irradiance(-0.3) == (0.0, 0.0, 0.0)
    assert not sun_of(Lighting(sun_elevation=-5.0)).shines
    assert not sun_of(Lighting(sun_strength=0.0)).shines
    # Skies turn with their sun, and panoramas as they are told.
    skies = Lighting(sun_azimuth=30.0, environment_turn=5.0)
    turns = [environment_turn(skies), environment_turn(replace(skies, environment="a.hdr"))]
    assert turns == [30.0, 5.0]
    assert sun_of(Lighting(sun_azimuth=90.0, sun_elevation=0.0)).direction == pytest.approx((1.0, 0.0, 0.0))


def test_irradiance_of_simple_environments_is_known() -> None:
    normals = some_directions()
    np.testing.assert_allclose(irradiance(np.ones((128, 256, 3), np.float32), normals), 1.0, atol=5e-3)
    # Radiance 1 + y has irradiance pi (1 + 2/3 ny).
    up = panorama_directions(128)[..., 1:2]
    slope = irradiance(np.repeat(1.0 + up, 3, axis=2).astype(np.float32), normals)
    np.testing.assert_allclose(slope[:, 0], 1.0 + 2.0 / 3.0 * normals[:, 1], atol=1e-2)


@pytest.mark.parametrize("height", [64, 101, 200])
def test_small_suns_light_what_faces_them(height: int) -> None:
    panorama = np.zeros((height, 2 * height, 3), np.float32)
    row, column = height // 4, height // 3
    panorama[row, column] = 1e4
    sun = panorama_directions(height)[row, column]
    normals = some_directions()
    expected = np.maximum(normals @ sun, 0.0) * 1e4 * panorama_solid_angles(height)[row] / np.pi
    np.testing.assert_allclose(irradiance(panorama, normals)[:, 1], expected, atol=0.05 * expected.max())


def write(path: Path, pixels: np.ndarray, kind: str = "float", whole: tuple[int, int] | None = None) -> Path:
    height, width, channels = pixels.shape
    output: Any = OpenImageIO.ImageOutput.create(str(path))
    spec = OpenImageIO.ImageSpec(width, height, channels, kind)
    if whole is not None:
        spec.x, spec.y, spec.full_width, spec.full_height = 10, 4, *whole
    assert output.open(str(path), spec)
    assert output.write_image(pixels)
    output.close()
    return path


def radiance(height: int = 8, channels: int = 3) -> np.ndarray:
    return np.random.default_rng(0).gamma(0.5, 2.0, (height, 2 * height, channels)).astype(np.float32)


def test_exr_and_hdr_are_read(tmp_path: Path) -> None:
    pixels = radiance()
    found = load_panorama(write(tmp_path / "a.exr", pixels))
    np.testing.assert_array_equal(found.pixels, pixels)
    rgbe = load_panorama(write(tmp_path / "a.hdr", pixels))
    # Eight bits under the exponent of the largest channel.
    np.testing.assert_allclose(rgbe.pixels, pixels, atol=float(pixels.max()) / 128)
    assert found.digest != rgbe.digest
    assert load_panorama(tmp_path / "a.exr").digest == found.digest


def test_grey_becomes_rgb_alpha_is_left_out_and_suns_are_clamped(tmp_path: Path) -> None:
    pixels = radiance(channels=4)
    pixels[0, 0, 0], pixels[0, 1, 0] = 1e7, -1e-7
    found = load_panorama(write(tmp_path / "a.exr", pixels)).pixels
    assert found.shape == (8, 16, 3)
    assert found[0, 0, 0] == LARGEST_RADIANCE
    assert found[0, 1, 0] == 0.0
    grey = load_panorama(write(tmp_path / "grey.exr", radiance(channels=1))).pixels
    np.testing.assert_array_equal(grey[..., 0], grey[..., 2])


def test_large_panoramas_are_reduced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(panorama, "USED_WIDTH", 8)
    pixels = radiance(16)
    found = load_panorama(write(tmp_path / "a.exr", pixels)).pixels
    assert found.shape == (4, 8, 3)
    np.testing.assert_allclose(found[0, 0], pixels[:4, :4].mean(axis=(0, 1)), rtol=1e-5)
    assert reduced(pixels, 64) is pixels


TEXELS = {"nan": np.nan, "infinite": np.inf, "negative": -5.0}
CONTENTS = {
    "text": b"#?RADIANCE\nno picture",
    "empty": b"",
    "liar": b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4096 +X 8192\n" + bytes(64),
}


def broken(folder: Path, fault: str) -> Path:
    path, pixels = folder / f"broken.{'hdr' if fault == 'liar' else 'exr'}", radiance(64)
    if fault in CONTENTS:
        path.write_bytes(CONTENTS[fault])
        return path
    if fault in ("missing", "folder"):
        return folder / ("none.hdr" if fault == "missing" else "")
    if fault == "part":
        return write(path, radiance(32), whole=(128, 64))
    if fault == "square":
        return write(path, pixels[:, :64])
    if fault == "too wide":
        return write(path, np.zeros((1 << 13, 1 << 14, 1), np.float16), "half")
    if fault == "colours":
        return write(folder / "broken.png", (pixels.clip(0, 1) * 255).astype(np.uint8), "uint8")
    pixels[3, 4, 1] = TEXELS.get(fault, pixels[3, 4, 1])
    write(path, pixels)
    if fault == "truncated":
        path.write_bytes(path.read_bytes()[:-3000])
    return path


FAULTS = {
    "missing": "cannot be read",
    "folder": "cannot be read",
    "text": "not an image|does not decode",
    "empty": "not an image",
    "square": "64 x 64 texels; an equirectangular panorama is twice as wide as high",
    "too wide": "at most 8192 across",
    "colours": "no radiance; give a panorama as HDR or EXR",
    "nan": "1 texels are infinite or no number",
    "infinite": "1 texels are infinite or no number",
    "negative": "negative radiance, down to -5",
    "truncated": "does not decode|not an image",
    "part": "holds a part of a picture",
    "liar": r"8192 x 4096 texels in .* bytes; the file is broken",
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faulty_files_are_one_line(tmp_path: Path, fault: str) -> None:
    path = broken(tmp_path, fault)
    with pytest.raises(InputError, match=FAULTS[fault]) as caught:
        load_panorama(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_the_studio_is_metered_and_has_edges_to_reflect() -> None:
    made = studio_radiance(64)
    normals = np.array([direction_towards(*METERED)])
    assert irradiance(made, normals).mean() == pytest.approx(1.0, abs=0.03)
    assert made.max() > 20.0 * np.median(made)


def test_the_pages_sky_is_the_windows_mirrored_as_three_reads_it() -> None:
    lighting = Lighting()
    found = np.frombuffer(sky_cube(lighting), "<f2").reshape(6, -1, 4)
    first = found[:, : SIDES[0] ** 2, :3].reshape(6, SIDES[0], SIDES[0], 3).astype(np.float64)
    panorama = sky_radiance(lighting.sun_elevation, azimuth=lighting.sun_azimuth).astype(np.float64)
    for face, direction in ((0, (-1.0, 0.3, 0.0)), (1, (1.0, 0.3, 0.0)), (4, (0.0, 0.3, 1.0)), (5, (0.0, 0.3, -1.0))):
        row = round((1.0 - 0.3) / 2.0 * SIDES[0] - 0.5)
        expected = sample_panorama(panorama, np.array([direction]) / np.linalg.norm(direction))[0]
        np.testing.assert_allclose(first[face, row, SIDES[0] // 2], expected, rtol=0.08)
    assert first[2].mean() > first[3].mean()
