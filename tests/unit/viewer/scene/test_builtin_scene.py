"""What the built-in scene promises."""

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.maps import PLANES
from ntc.pack.file import read_pack
from viewer.locations import builtin_scene_path
from viewer.scene.cameras_file import read_cameras
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.state.pack_files import match_scene, packs_beside

CATEGORIES = {
    "aerial",
    "brick",
    "concrete",
    "fabric",
    "floor",
    "metal",
    "plaster",
    "rock",
    "roofing",
    "terrain",
    "wood",
}
LARGEST_FOLDER = 60e6


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene(builtin_scene_path())


def test_five_textures_in_each_category(scene: Scene) -> None:
    assert Counter(texture.category for texture in scene.textures) == dict.fromkeys(CATEGORIES, 5)
    assert {texture.pixels.shape for texture in scene.textures} == {(512, 512, 3)}
    assert min(float(texture.pixels.std()) for texture in scene.textures) > 5.0


def test_it_uses_what_the_renderer_has_to_show(scene: Scene) -> None:
    materials = scene.materials
    assert {material.alpha_mode for material in materials} == {"opaque", "mask"}
    assert any(material.double_sided for material in materials)
    assert {material.sampler.wrap for material in materials} == {("repeat", "repeat"), ("clamp", "clamp")}
    assert scene.geometry.colors is not None
    assert (np.linalg.det(scene.instances.transform[:, :3, :3]) < 0).any()
    assert max(Counter(scene.instances.primitive.tolist()).values()) > 1
    assert any("KHR_texture_transform" in line for line in scene.report.honoured)
    assert not scene.report.missing


def test_materials_are_whole(scene: Scene) -> None:
    for texture in scene.textures:
        expected = {"base", "normal", "roughness", "occlusion"}
        if texture.category == "metal" or texture.name == "roofing_corrugated":
            expected |= {"metalness"}
        if texture.name == "metal_sign":
            expected |= {"emissive"}
        assert set(texture.maps) == expected, texture.name
        assert all(pixels.std() > 0.5 for pixels in texture.further_maps.values()), texture.name
        xy = texture.further_maps["normal"] / 127.5 - 1
        # Bumps lean no way on the whole, but for tiles that overlap, and few stand steeper than 60 degrees.
        assert texture.category == "roofing" or np.abs(xy.mean(axis=(0, 1))).max() < 0.03, texture.name
        assert (np.square(xy).sum(axis=2) > 0.75).mean() < 0.15, texture.name
    used = [material for material in scene.materials if material.name != "glass"]
    assert all(material.surface is not None and material.emission is not None for material in used)
    for material in used:
        assert {material.plane_texture(plane) for plane in PLANES} == {material.texture_id}, material.name
    assert max(material.factors.emissive[0] for material in used) > 1.0


def test_normals_follow_the_triangles(scene: Scene) -> None:
    geometry = scene.geometry
    assert geometry.normals is not None
    for primitive in scene.primitives:
        rows = geometry.indices[primitive.first_index : primitive.first_index + primitive.index_count].astype(int)
        corners = geometry.positions[rows + primitive.base_vertex].reshape(-1, 3, 3).astype(np.float64)
        own = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        own /= np.linalg.norm(own, axis=1, keepdims=True)
        normals = geometry.normals[rows + primitive.base_vertex].reshape(-1, 3, 3)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=2), 1.0, atol=1e-5)
        assert np.einsum("tck,tk->tc", normals, own).min() > 0.75, primitive.name


def test_named_cameras_are_in_both_files(scene: Scene) -> None:
    listed = read_cameras(builtin_scene_path().with_name("courtyard.cameras.json"))
    assert [camera.name for camera in scene.cameras] == [camera.name for camera in listed]
    assert len(listed) >= 6
    for own, other in zip(scene.cameras, listed, strict=True):
        np.testing.assert_allclose(own.eye, other.eye, atol=1e-5)
        assert own.fov_degrees == pytest.approx(other.fov_degrees)
        ways = [np.subtract(camera.target, camera.eye) for camera in (own, other)]
        ways = [way / np.linalg.norm(way) for way in ways]
        np.testing.assert_allclose(ways[0], ways[1], atol=1e-5)


@pytest.mark.parametrize("grouping", ["baseline", "single", "random", "clustered"])
def test_packs_hold_every_texture(scene: Scene, grouping: str) -> None:
    (path,) = [path for path in packs_beside(builtin_scene_path()) if path.name == f"courtyard.{grouping}.ntc"]
    pack = read_pack(path)
    assert match_scene(pack, scene).matched == 55
    assert [texture.maps for texture in pack.textures] == [texture.maps for texture in scene.textures]
    assert pack.grouping.name == grouping
    assert len(pack.decoders) == {"baseline": 55, "single": 1}.get(grouping, 10)
    assert all(texture.psnr_db is not None and texture.psnr_db > 15.0 for texture in pack.textures)


def test_random_has_the_group_sizes_of_clustered() -> None:
    folder = builtin_scene_path().parent
    sizes = [
        sorted(Counter(read_pack(folder / f"courtyard.{name}.ntc").grouping.groups).values())
        for name in ("random", "clustered")
    ]
    assert sizes[0] == sizes[1]


def test_the_folder_stays_small() -> None:
    folder: Path = builtin_scene_path().parent
    assert sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) < LARGEST_FOLDER


def test_the_cameras_file_is_plain_json() -> None:
    entries = json.loads(builtin_scene_path().with_name("courtyard.cameras.json").read_text())
    assert set(entries[0]) == {"name", "eye", "target", "fov"}
