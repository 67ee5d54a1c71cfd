"""Whole files: containers, other formats, real scenes."""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh

from ntc.errors import InputError
from tests.support.gltf_builder import GltfBuilder, noise, png
from tests.support.scenes import sorted_triangles, world_triangles
from viewer.scene.load import load_scene


def simple() -> GltfBuilder:
    builder = GltfBuilder()
    return builder.drawn(builder.triangle(builder.material(builder.image(png(noise())))))


def test_glb_and_gltf_are_the_same_scene(tmp_path: Path) -> None:
    scenes = [load_scene(simple().write(tmp_path / name)) for name in ("a.glb", "a.gltf")]
    assert scenes[0].textures[0].pixel_hash == scenes[1].textures[0].pixel_hash
    np.testing.assert_array_equal(world_triangles(scenes[0]), world_triangles(scenes[1]))
    assert (scenes[0].name, scenes[0].path) == ("a", tmp_path / "a.glb")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "empty"),
        (b"{", "not valid JSON"),
        (b"[]", "not a glTF file"),
        (b'{"asset": {"version": "1.0"}}', "only glTF 2.0"),
        (b'{"asset": {"version": "2.0", "minVersion": "2.1"}}', "minVersion"),
        (b"{}", "only glTF 2.0"),
        (b'{"asset": {"version": "2.0"}, "nodes": {}}', "nodes: must be an array"),
        (b'{"asset": {"version": "2.0"}, "nodes": [3]}', r"nodes\[0\]: must be an object"),
        (b'{"asset": {"version": "2.0"}}', "no triangles"),
        (b"\xff\xfe\x00", "not valid JSON"),
        (b"[" * 100000, "not valid JSON"),
        (b"glTF\x02\x00\x00\x00", "truncated GLB"),
        (b"glTF\x01\x00\x00\x00" + bytes(20), "GLB version 1"),
        (simple().glb()[:-10], "truncated GLB"),
        (simple().glb()[:12] + b"\xff\xff\xff\x7f" + simple().glb()[16:], "GLB chunk"),
    ],
)
def test_broken_containers(tmp_path: Path, data: bytes, message: str) -> None:
    path = tmp_path / "broken.gltf"
    path.write_bytes(data)
    with pytest.raises(InputError, match=message) as caught:
        load_scene(path)
    assert "broken.gltf" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_file_and_folder(tmp_path: Path) -> None:
    for path in (tmp_path / "none.glb", tmp_path / "none.obj", tmp_path / "none"):
        with pytest.raises(InputError, match="cannot be read"):
            load_scene(path)
    with pytest.raises(InputError, match="holds no scene"):
        load_scene(tmp_path)


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".off"])
def test_other_formats(tmp_path: Path, suffix: str) -> None:
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    path = tmp_path / f"box{suffix}"
    box.export(path)
    scene = load_scene(path)
    np.testing.assert_allclose(sorted_triangles(world_triangles(scene)), sorted_triangles(box.triangles), atol=1e-4)
    path.write_bytes(b"\x00garbage")
    with pytest.raises(InputError, match="box"):
        load_scene(path)


def test_obj_texture_stands_upright(tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    (tmp_path / "a.png").write_bytes(png(noise()))
    (tmp_path / "a.mtl").write_text("newmtl m\nKd 1 1 1\nmap_Kd a.png\n")
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"
    )
    scene = load_scene(tmp_path / "a.obj")
    np.testing.assert_array_equal(scene.textures[0].pixels, noise())
    # OBJ counts v from the bottom, glTF from the top.
    highest = int(np.argmax(scene.geometry.positions[:, 1]))
    assert scene.geometry.uvs[highest, 1] == pytest.approx(0.0)


@pytest.mark.process
def test_readers_of_other_formats_are_not_imported_for_plain_gltf(tmp_path: Path) -> None:
    path = simple().write(tmp_path / "a.glb")
    code = (
        "import sys; from pathlib import Path; from viewer.scene.load import load_scene; load_scene(Path(sys.argv[1]));"
        "assert not {'trimesh', 'DracoPy', 'meshopt', 'torch', 'PIL'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code, str(path)], check=True)


@pytest.mark.timing
def test_bistro(data_folder: Path) -> None:
    path = data_folder / "scenes/bistro/bistro.gltf"
    started = time.perf_counter()
    scene = load_scene(path)
    assert time.perf_counter() - started < 6.0
    used = scene.report.used
    assert (used["meshes"], used["materials"], used["images"], used["textures"]) == (741, 81, 70, 55)
    assert used["triangles"] == 1814231
    assert "constant images became factors (15)" in scene.report.notes
    assert scene.report.missing == ()
    entries = json.loads(path.read_text())
    for material, entry in zip(scene.materials, entries["materials"], strict=False):
        info = entry.get("pbrMetallicRoughness", {}).get("baseColorTexture")
        if info is not None and material.texture_id >= 0:
            image = entries["images"][entries["textures"][info["index"]]["source"]]
            assert scene.textures[material.texture_id].origin == image["uri"]


@pytest.mark.parametrize(
    ("name", "textures", "missing"),
    [
        ("jungle/scene.gltf", 13, ""),
        ("polyhaven_props/living_room.gltf", 2, "wood_table_worn_nor_gl_1k.png: cannot be read"),
        ("polyhaven_props/sofa_03_1k.gltf", 1, ""),
        ("polyhaven_props/tea_set_01_1k.gltf", 1, ""),
        ("lantern/glTF/Lantern.gltf", 1, "Lantern_baseColor.png: cannot be read"),
        ("lantern/glTF-Quantized/Lantern.gltf", 0, "Lantern_baseColor.png: cannot be read"),
        ("scifi_helmet/SciFiHelmet.gltf", 1, "SciFiHelmet_BaseColor.png: cannot be read"),
    ],
)
def test_real_scenes(data_folder: Path, name: str, textures: int, missing: str) -> None:
    scene = load_scene(data_folder / "scenes" / name)
    assert len(scene.textures) == textures
    assert np.isfinite(scene.bounds).all()
    lines = "\n".join(scene.report.missing)
    assert missing in lines
    assert bool(lines) == bool(missing)


def test_a_scene_without_its_buffer_is_refused_by_the_buffers_name(data_folder: Path) -> None:
    with pytest.raises(InputError, match=r"buffers\[0\].uri: scene.bin: cannot be read"):
        load_scene(data_folder / "scenes/interior_meshopt/scene.gltf")
