"""Scenes compressed in every way that is read show the picture of the plain scene, within what their quantisation allows."""

from pathlib import Path

import numpy as np
import pytest

from lab.benchmarks.twins.comparison import Bound, outside
from tests.support.gltf_builder import GltfBuilder, noise, png
from viewer.gl.context import GraphicsContext
from viewer.locations import builtin_scene_path

pytest.importorskip("alktx2", reason="alktx2 has no wheel for this system")
pytest.importorskip("etcpak", reason="etcpak is not installed")

from lab.benchmarks.twins.measure import TWINS, compare_twins

pytestmark = pytest.mark.once
SIZE = (160, 90)
PLACES = 12
GEOMETRY = ("meshopt, filters", "KHR_mesh_quantization", "KHR_draco_mesh_compression")


def hand_made() -> GltfBuilder:
    """Two bent sheets with every attribute that twins encode, one of them turned, scaled and coloured by vertex."""
    builder = GltfBuilder()
    smooth = np.add.outer(np.arange(32), np.arange(32))
    pictures = (np.dstack([smooth * 3, 250 - smooth * 3, smooth * 2 + 60]).astype(np.uint8), noise(20, 28))
    random = np.random.default_rng(7)
    u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, PLACES), np.linspace(0, 1, PLACES)))
    corners = np.arange((PLACES - 1) * PLACES).reshape(PLACES - 1, PLACES)[:, :-1].reshape(-1, 1)
    indices = (corners + np.array([0, 1, PLACES + 1, 0, PLACES + 1, PLACES])).reshape(-1).astype(np.uint16)
    normals = np.dstack([np.cos(5 * u) * 0.3, 0 * u, 1 + 0 * u])[0]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    tangents = np.c_[normals[:, 2], 0 * u, -normals[:, 0], np.ones_like(u)]
    for number, picture in enumerate(pictures):
        positions = np.c_[u * 2 - 1, v - 0.5, 0.2 * np.sin(5 * u)] + random.normal(0, 0.003, (len(u), 3))
        attributes = {"POSITION": positions, "NORMAL": normals, "TANGENT": tangents, "TEXCOORD_0": np.c_[u, v]}
        if number:
            attributes["COLOR_0"] = np.c_[random.uniform(0.9, 1.0, (len(u), 3)), np.ones_like(u)]
        material = builder.material(builder.image(png(picture)), doubleSided=True)
        arrays = {name: np.asarray(values, np.float32) for name, values in attributes.items()}
        primitive = builder.triangle(material, **arrays)
        primitive["indices"] = builder.accessor(indices)
        mesh = builder.mesh(primitive)
        builder.add("nodes", mesh=mesh, translation=[0, number - 0.5, 0])
        if number:
            builder.json["nodes"][-1] |= {"rotation": [0.0, 0.1736, 0.0, 0.9848], "scale": [1.2, -1.1, 1.0]}
    return builder


@pytest.mark.parametrize("name", [name for name in TWINS if "its own" not in name])
def test_a_twin_of_a_hand_made_scene_shows_its_picture(graphics: GraphicsContext, tmp_path: Path, name: str) -> None:
    path = hand_made().write(tmp_path / "plain.glb")
    (row,), pictures = compare_twins(graphics, path, None, (name,), SIZE)
    assert len(np.unique(pictures[0][1].reshape(-1, 3), axis=0)) > 500
    assert row["outside"] == 0
    assert row.get("other", 0) == 0
    if row["values"] == 0:
        assert row["largest"] == 0


@pytest.mark.parametrize("name", GEOMETRY)
def test_a_twin_of_a_built_in_scene_shows_its_picture(graphics: GraphicsContext, name: str) -> None:
    (row,), _ = compare_twins(graphics, builtin_scene_path("gallery"), None, (name,), SIZE)
    assert 0.0 < row["moved"] < 1.0
    assert row["outside"] == 0


def test_another_picture_is_outside_of_the_bound() -> None:
    plain = np.repeat(np.repeat(noise(9, 16), 10, axis=0), 10, axis=1)
    fine = np.repeat(np.repeat(plain, 3, axis=0), 3, axis=1)
    # What comes round from the other side is left out.
    assert not outside(plain, fine, np.roll(plain, 1, axis=1), Bound(0.5, 0))[:, 1:].any()
    assert outside(plain, fine, np.roll(plain, 2, axis=1), Bound(0.5, 0))[:, 2:].any()
    assert outside(plain, fine, np.clip(plain.astype(int) + 3, 0, 255).astype(np.uint8), Bound(0.5, 2)).any()
    assert not outside(plain, fine, np.clip(plain.astype(int) + 3, 0, 255).astype(np.uint8), Bound(0.0, 3)).any()
