"""The glTF file of an exported page: three.js reads it without decoders, and it shows what the scene does."""

import json
from pathlib import Path

import DracoPy
import numpy as np
import pytest

from ntc.pack.file import read_pack
from tests.end_to_end.export.material_scene import materials_scene, waves
from tests.support.gltf_builder import GltfBuilder, png
from tests.support.meshopt_twins import meshopt_twin
from viewer import cli
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.state.pack_files import match_scene

pytestmark = pytest.mark.guards("exports")

GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"


def exported(scene: Path, folder: Path, *packs: Path) -> Path:
    """The glTF file of a page of `scene`, without original images that packs hold."""
    command = ["export", str(scene), "--pack", *map(str, packs), "--web", str(folder), "--fallback", "none"]
    assert cli.main(command) == 0
    return folder / "scene.gltf"


def encoded(scene: Path, name: str, *options: str) -> Path:
    pack = scene.with_name(f"{name}.ntc")
    command = ["encode", str(scene), "--out", str(pack), "--codec", "block", "--grouping", "baseline", *options]
    assert cli.main(command) == 0
    return pack


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return materials_scene().write(tmp_path_factory.mktemp("scene") / "scene.glb")


@pytest.fixture(scope="module")
def pack(scene: Path) -> Path:
    return encoded(scene, "scene.baseline")


def assert_same_geometry(first: Scene, second: Scene) -> None:
    assert np.array_equal(first.geometry.positions, second.geometry.positions)
    assert np.array_equal(first.geometry.uvs, second.geometry.uvs)
    assert np.array_equal(first.geometry.indices, second.geometry.indices)


def test_meshoptimizer(scene: Path, pack: Path, tmp_path: Path) -> None:
    twin = tmp_path / "twin.glb"
    twin.write_bytes(meshopt_twin(scene.read_bytes()))
    out = exported(twin, tmp_path / "page", pack)
    assert "meshopt" not in out.read_text()
    assert_same_geometry(load_scene(twin), load_scene(out))


def draco_scene() -> GltfBuilder:
    """materials_scene, its first square compressed."""
    builder = materials_scene()
    primitive = builder.json["meshes"][0]["primitives"][0]
    positions = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    uvs = positions[:, :2].astype(np.float64)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    data = DracoPy.encode(positions, faces, tex_coord=uvs, quantization_bits=14)
    decoded = DracoPy.decode(data)
    numbers = {entry["attribute_type"]: entry["unique_id"] for entry in decoded.attributes}
    names = {"POSITION": numbers[0], "TEXCOORD_0": numbers[3]}
    for name, kind in (("POSITION", "VEC3"), ("TEXCOORD_0", "VEC2")):
        accessor = {"componentType": 5126, "type": kind, "count": 4}
        if name == "POSITION":
            accessor |= {"min": [0, 0, 0], "max": [1, 1, 0]}
        primitive["attributes"][name] = builder.add("accessors", **accessor)
    primitive["indices"] = builder.add("accessors", componentType=5123, type="SCALAR", count=6)
    packed = {"bufferView": builder.view(data), "attributes": names}
    primitive["extensions"] = {"KHR_draco_mesh_compression": packed}
    for key in ("extensionsUsed", "extensionsRequired"):
        builder.json[key] = ["KHR_draco_mesh_compression"]
    return builder


def test_draco(pack: Path, tmp_path: Path) -> None:
    compressed = draco_scene().write(tmp_path / "scene.glb")
    out = exported(compressed, tmp_path / "page", pack)
    assert "draco" not in out.read_text()
    assert_same_geometry(load_scene(compressed), load_scene(out))


def test_specular_and_glossiness(tmp_path: Path) -> None:
    builder = materials_scene()
    material = builder.json["materials"][1]
    texture = material.pop("pbrMetallicRoughness")["baseColorTexture"]
    glossiness = {"diffuseTexture": texture, "diffuseFactor": [1.0, 0.5, 0.25, 1.0], "glossinessFactor": 0.75}
    material["extensions"] = {GLOSSINESS: glossiness}
    builder.json["extensionsUsed"] = [GLOSSINESS]
    glossy = builder.write(tmp_path / "scene.glb")
    out = exported(glossy, tmp_path / "page", encoded(glossy, "glossy"))
    assert GLOSSINESS not in out.read_text()
    before, after = load_scene(glossy).materials[1], load_scene(out).materials[1]
    assert after.factor == pytest.approx(before.factor)
    assert after.factors.roughness == pytest.approx(before.factors.roughness)
    assert after.texture_id == before.texture_id


def test_images_are_files_that_browsers_read(tmp_path: Path) -> None:
    builder = materials_scene()
    webp = builder.json["textures"][0].pop("source")
    builder.json["textures"][0]["extensions"] = {"EXT_texture_webp": {"source": webp}}
    builder.json["textures"].append({"source": builder.image(png(waves(5)), name="nobody reads it")})
    scene = builder.write(tmp_path / "scene.glb")
    pack = encoded(scene, "scene.baseline")
    page = tmp_path / "page"
    assert cli.main(["export", str(scene), "--pack", str(pack), "--web", str(page)]) == 0
    document = json.loads((page / "scene.gltf").read_text())
    images = [image for image in document["images"] if not image["uri"].endswith(".ntc")]
    assert all((page / image["uri"].replace("%20", " ")).is_file() and "bufferView" not in image for image in images)
    assert all(set(texture.get("extensions", {})) <= {"NV_texture_swizzle"} for texture in document["textures"])


def test_several_packs_stand_for_each_texture(scene: Path, pack: Path, tmp_path: Path) -> None:
    """A texture entry that packs share differently names each of them where it can."""
    base = encoded(scene, "base", "--maps", "base")
    out = exported(scene, tmp_path / "page", pack, base)
    document = json.loads(out.read_text())
    names = [image.get("uri") for image in document["images"]]
    assert [name for name in names if name.endswith(".ntc")] == ["scene.baseline.ntc", "scene.baseline.1.ntc"]
    for material in document["materials"]:
        entry = document["textures"][material["pbrMetallicRoughness"]["baseColorTexture"]["index"]]
        options = entry["extensions"]["NV_texture_swizzle"]["options"]
        assert [names[option["source"]] for option in options] == ["scene.baseline.ntc", "scene.baseline.1.ntc"]
    normal = document["textures"][document["materials"][0]["normalTexture"]["index"]]
    options = normal["extensions"]["NV_texture_swizzle"]["options"]
    assert [names[option["source"]] for option in options] == ["scene.baseline.ntc"], "the other has base colours alone"
    for path in (pack, base):
        assert match_scene(read_pack(path), load_scene(out)).matched > 0
