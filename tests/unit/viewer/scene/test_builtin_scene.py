"""What the built-in scenes promise, and what the scripts that build them make."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from assets.build.courtyard import cameras
from assets.build.gallery import SHOWN
from assets.build.gltf_materials import encode_images
from assets.build.materials import recipes
from ntc.pack.file import read_pack
from viewer.locations import builtin_scene_path, named_scene
from viewer.scene.images import decode_image
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.state.pack_files import match_scene, packs_beside

CATEGORIES = [
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
]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene(builtin_scene_path())


def test_five_textures_in_each_category(scene: Scene) -> None:
    assert Counter(texture.category for texture in scene.textures) == dict.fromkeys(CATEGORIES, 5)
    assert {texture.pixels.shape for texture in scene.textures} == {(512, 512, 3)}
    assert min(float(texture.pixels.std()) for texture in scene.textures) > 5.0


@pytest.mark.parametrize("grouping", ["baseline", "clustered"])
def test_packs_hold_every_texture(scene: Scene, grouping: str) -> None:
    (path,) = [path for path in packs_beside(builtin_scene_path()) if path.name == f"courtyard.{grouping}.ntc"]
    pack = read_pack(path)
    assert match_scene(pack, scene).matched == 55
    assert [texture.maps for texture in pack.textures] == [texture.maps for texture in scene.textures]
    assert pack.grouping.name == grouping
    assert len(pack.decoders) == {"baseline": 55, "clustered": 10}[grouping]
    assert all(texture.psnr_db is not None and texture.psnr_db > 15.0 for texture in pack.textures)


def test_names_of_cameras_and_textures_are_those_of_the_scripts(scene: Scene) -> None:
    assert [camera.name for camera in scene.cameras] == [camera["name"] for camera in cameras()]
    assert all(camera.name.isalpha() and camera.name.islower() for camera in scene.cameras)
    assert scene.cameras[0].name == "entrance"
    assert {texture.name: texture.category for texture in scene.textures} == {r.name: r.category for r in recipes()}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["wood_sign", *(pytest.param(name, marks=pytest.mark.guards("assets")) for name in ("brick_red", "metal_lattice"))],
)
def test_textures_are_those_of_the_scripts(scene: Scene, name: str) -> None:
    number = [recipe.name for recipe in recipes()].index(name)
    made = {kind: decode_image(content, name)[..., :3] for kind, (_, content) in encode_images(number).items()}
    (shipped,) = (texture for texture in scene.textures if texture.name == name)
    pairs = [
        (made["base"], shipped.pixels),
        (made["normal"][..., :2], shipped.further_maps["normal"]),
        (made["packed"][..., :1], shipped.further_maps["occlusion"]),
        (made["packed"][..., 1:2], shipped.further_maps["roughness"]),
    ]
    for expected, found in pairs:
        # Another JPEG library or another sine may round differently.
        assert np.abs(expected.astype(int) - found.astype(int)).mean() < 1.0


def test_gallery_is_small_and_whole() -> None:
    path = builtin_scene_path("gallery")
    assert path.stat().st_size < 1.3e6
    scene = load_scene(path)
    assert not scene.report.missing
    assert not scene.report.ignored
    assert scene.cameras[0].name == "gallery"
    names = {material.name: material.factors for material in scene.materials}
    assert [names[f"metal_{step}"].roughness for step in (0, 3, 6)] == [0.0, 0.5, 1.0]
    assert (names["metal_3"].metalness, names["dielectric_3"].metalness) == (1.0, 0.0)
    assert names["clearcoat"].clearcoat == 1.0
    assert names["emission"].emissive[0] == 4.0
    assert names["transmission"].transmission > 0.0
    sets = [texture for texture in scene.textures if "normal" in texture.maps]
    assert len(sets) == len(scene.textures) == len(SHOWN) + 1
    assert scene.geometry.tangents is not None


def test_built_in_scenes_are_found_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert named_scene(Path("gallery")) == builtin_scene_path("gallery")
    assert named_scene(Path("other")) == Path("other")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gallery").write_bytes(b"a file of that name")
    assert named_scene(Path("gallery")) == Path("gallery")
