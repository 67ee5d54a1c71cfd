"""Quality map by map, and the angle between normals."""

from dataclasses import replace

import numpy as np
import pytest

from lab.bench.random_pack import random_block_pack
from ntc.codec.block.config import BlockConfig
from ntc.codec.maps import MapName
from ntc.codec.quality import map_psnr_db, measured_texture, normal_angles
from ntc.metrics.metrics import psnr_table

MAPS: tuple[MapName, ...] = ("base", "normal", "roughness")


def coded(x: float, y: float) -> np.ndarray:
    """[1, 1, 2] uint8: a normal as a picture holds it."""
    return np.rint(np.array([[[x, y]]]) * 127.5 + 127.5).astype(np.uint8)


@pytest.mark.parametrize("degrees", [0.0, 5.0, 30.0, 80.0])
def test_angles_are_those_between_the_vectors(degrees: float) -> None:
    tilted = coded(np.sin(np.radians(degrees)), 0.0)
    assert float(normal_angles(coded(0.0, 0.0), tilted)[0, 0]) == pytest.approx(degrees, abs=1.5)
    assert float(normal_angles(tilted, tilted)[0, 0]) == 0.0


def test_normals_that_are_too_long_have_an_angle() -> None:
    found = normal_angles(np.array([[[255, 255]]], np.uint8), np.array([[[0, 0]]], np.uint8))
    assert float(found[0, 0]) == pytest.approx(180.0)
    assert np.isfinite(normal_angles(np.zeros((3, 5, 2), np.uint8), np.full((3, 5, 2), 128, np.uint8))).all()


def test_each_map_has_its_own_psnr_and_the_table_shows_them() -> None:
    config = BlockConfig(coefficients=8, modes=2, output_channels=6, maps=MAPS)
    pack = random_block_pack(((8, 8),), (0,), config)
    pixels = np.full((8, 8, 6), 100, np.uint8)
    decoded = pixels.copy()
    decoded[..., 3:5] += 10
    assert map_psnr_db(MAPS, decoded, pixels) == (np.inf, pytest.approx(28.13, abs=0.01), np.inf)
    found = measured_texture(pack.textures[0], decoded, pixels)
    assert found.normal_degrees is not None
    assert found.normal_degrees[0] == pytest.approx(found.normal_degrees[1])
    table = psnr_table(replace(pack, textures=(found,)))
    assert "base exact, normal 28.13 dB (" in table.lines()[2]
    assert table.json()["textures"][0]["map_psnr_db"] == {
        "base": None,
        "normal": found.map_psnr_db[1],
        "roughness": None,
    }
    # Of a texture that is no set one number says all.
    plain = random_block_pack(((8, 8),), (0,)).textures[0]
    assert measured_texture(plain, decoded[..., :3], pixels[..., :3]).map_psnr_db == ()
