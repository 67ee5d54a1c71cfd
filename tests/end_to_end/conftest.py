"""A small scene on disk with packs encoded for it."""

from pathlib import Path

import numpy as np
import pytest

from tests.support.gltf_builder import GltfBuilder, png
from viewer import cli

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
SQUARE_UVS = np.array([[0, 1], [1, 1], [1, 0], [0, 1], [1, 0], [0, 0]], np.float32)


def two_squares(seed: int = 5, count: int = 2) -> GltfBuilder:
    """`count` textured unit squares side by side, facing +Z, around the origin."""
    builder = GltfBuilder()
    random = np.random.default_rng(seed)
    primitives = []
    for number in range(count):
        ramp = np.linspace(40, 200, 32)[:, None, None] + np.array([10.0, 40.0 * number, 20.0])
        pixels = np.clip(ramp + random.normal(0, 12, (32, 32, 3)), 0, 255).astype(np.uint8)
        material = builder.material(builder.image(png(pixels), name=f"picture {number}"))
        primitives.append(
            builder.triangle(
                material, POSITION=SQUARE + np.array([number - count // 2, -0.5, 0], np.float32), TEXCOORD_0=SQUARE_UVS
            )
        )
    return builder.drawn(*primitives)


@pytest.fixture(scope="session")
def encoded_scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Path of scene.glb, with scene.single.ntc and scene.baseline.ntc beside it."""
    folder = tmp_path_factory.mktemp("scene")
    path = two_squares().write(folder / "scene.glb")
    for grouping in ("single", "baseline"):
        out = ("--out", str(folder / f"scene.{grouping}.ntc"))
        assert cli.main(["encode", str(path), *out, "--grouping", grouping, "--bits", "6"]) == 0
    return path
