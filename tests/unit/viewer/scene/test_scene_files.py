"""What stands for a scene: files of every format, archives, folders, cameras beside it; and what other files are told to be."""

import gc
import json
import os
import struct
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from ntc.errors import InputError
from tests.end_to_end.conftest import two_squares
from tests.support.gltf_builder import GltfBuilder, ktx2, noise, png
from tests.support.scenes import sorted_triangles, world_triangles
from viewer.scene.cameras_file import cameras_beside, with_cameras_beside
from viewer.scene.folder_listing import completed, list_folder, matching
from viewer.scene.images import folder_textures, write_png
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.scene.scene_files import FREE_BYTES, SCENES_NAMED, scene_file


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
    with pytest.raises(InputError, match=r"holds no scene; a scene is a \.gltf"):
        load_scene(tmp_path)


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".off"])
def test_meshes_of_other_formats(tmp_path: Path, suffix: str) -> None:
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


def test_bistro(data_folder: Path) -> None:
    path = data_folder / "scenes/bistro/bistro.gltf"
    scene = load_scene(path)
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


CAMERAS = '[{"name": "street", "eye": [0, 1, 5], "target": [0, 1, 0]}]'


@pytest.mark.parametrize(
    ("name", "data", "what", "remedy"),
    [
        ("picture.png", png(noise()), "is a picture (PNG)", "open the .gltf or .glb"),
        ("notes.txt", b"read me", "is a .txt file, not a scene", "a scene is a .gltf, .glb"),
        ("LICENSE", b"free for all", "is a file without a suffix", "a scene is a .gltf, .glb"),
        ("mine.ntc", b"whatever", "is a pack of encoded textures, not a scene", "mine.ntc"),
        ("cameras.json", b"[]", "holds cameras", "open that"),
        ("city.fbx", b"Kaydara FBX", "FBX is not read", "export the scene as glTF"),
        ("city.usdz", b"PK", "USDZ is not read", "export the scene as glTF"),
        ("part.3mf", b"PK", "3MF is not read", "export the scene as glTF"),
        ("city.dae", b"<?xml", "DAE is not read", "export the scene as glTF"),
        ("city.7z", b"7z", "7Z is not unpacked", "open the folder"),
        ("sky.hdr", b"#?RADIANCE", "is a panorama, which lights a scene", "drop it on the window"),
    ],
)
def test_another_file_is_told_what_it_is_and_what_to_do(
    tmp_path: Path, name: str, data: bytes, what: str, remedy: str
) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError) as caught:
        load_scene(tmp_path / name)
    assert what in str(caught.value)
    assert remedy in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("address", ["https://example.com/a.glb", "http://example.com/a"])
def test_addresses_are_refused(address: str) -> None:
    with pytest.raises(InputError, match="scenes are opened from files; download it"):
        load_scene(Path(address))


def test_a_scene_under_another_name_is_opened(tmp_path: Path) -> None:
    path = two_squares().write(tmp_path / "scene.glb").rename(tmp_path / "scene.bak")
    assert len(load_scene(path).textures) == 2


def test_a_folder_with_one_scene_is_that_scene(tmp_path: Path) -> None:
    path = two_squares().write(tmp_path / "town.glb")
    (tmp_path / "town.obj").write_text("")
    (tmp_path / "._town.glb").write_text("")
    scene = load_scene(tmp_path)
    assert (scene.path, scene.name) == (path, "town")


def test_a_folder_with_several_scenes_names_them(tmp_path: Path) -> None:
    for number in range(SCENES_NAMED + 2):
        (tmp_path / f"{number}.glb").write_bytes(b"")
    with pytest.raises(InputError, match=r"holds 6 scenes, name one of them: 0\.glb, 1\.glb, .* and 2 more"):
        scene_file(tmp_path)


def test_cameras_beside_a_scene_come_before_its_own(tmp_path: Path) -> None:
    scene = load_scene(two_squares().write(tmp_path / "town.glb"))
    assert with_cameras_beside(scene) is scene
    (tmp_path / "cameras.json").write_text(CAMERAS)
    (camera,) = with_cameras_beside(scene).cameras
    assert (camera.name, camera.eye) == ("street", (0.0, 1.0, 5.0))


def test_cameras_of_the_scenes_name_win(tmp_path: Path) -> None:
    for name in ("cameras.json", "town.cameras.json"):
        (tmp_path / name).write_text(CAMERAS)
    assert cameras_beside(tmp_path / "town.glb") == tmp_path / "town.cameras.json"
    assert cameras_beside(tmp_path / "field.glb") == tmp_path / "cameras.json"


def test_a_folder_lists_folders_and_what_can_be_opened(tmp_path: Path) -> None:
    for name in ("b.glb", "A.gltf", "c.ntc", "sky.exr", "notes.txt", ".hidden.glb"):
        (tmp_path / name).write_bytes(b"12")
    (tmp_path / "zoo").mkdir()
    listed = list_folder(tmp_path)
    assert [entry.name for entry in listed] == ["zoo/", "A.gltf", "b.glb", "c.ntc", "sky.exr"]
    assert [(entry.kind, entry.size) for entry in listed[:2]] == [("folder", 0), ("scene", 2)]
    assert [entry.name for entry in matching(listed, "GL b")] == ["b.glb"]
    with pytest.raises(InputError, match="cannot be read"):
        list_folder(tmp_path / "none")


def test_typed_paths_are_completed_as_far_as_they_are_sure(tmp_path: Path) -> None:
    for name in ("town.clustered.ntc", "town.glb"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "woods").mkdir()
    assert completed(f"{tmp_path}/t", tmp_path) == f"{tmp_path}/town."
    assert completed("./to", tmp_path) == "./town."
    assert completed("./wo", tmp_path) == "./woods/"
    assert completed("./x", tmp_path) == "./x"
    assert completed("./none/x", tmp_path) == "./none/x"


def test_names_that_no_text_can_hold_are_left_out(tmp_path: Path) -> None:
    for name in (b"\xff\xfe.glb", b"two\nlines.glb", "caf\u00e9.glb".encode()):
        Path(os.fsdecode(os.path.join(os.fsencode(tmp_path), name))).write_bytes(b"")  # noqa: PTH118
    assert [entry.name for entry in list_folder(tmp_path)] == ["caf\u00e9.glb"]


def archive_of(path: Path, files: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return path


def scene_with_files(folder: Path) -> dict[str, bytes]:
    """A glTF file with its buffer and a picture beside it, by name."""
    builder = GltfBuilder()
    builder.add("images", uri="textures/a.png")
    builder.drawn(builder.triangle(builder.material(0)))
    builder.write(folder / "scene.gltf", uri="scene.bin")
    files = {name: (folder / name).read_bytes() for name in ("scene.gltf", "scene.bin")}
    return {**files, "textures/a.png": png(noise())}


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of temporary files."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.mark.parametrize("inside", ["", "model/source/", "model\\"])
def test_a_scene_in_an_archive_opens_with_its_files(tmp_path: Path, temporary: Path, inside: str) -> None:
    files = {inside + name: data for name, data in scene_with_files(tmp_path).items()}
    files |= {"license.txt": b"free", "__MACOSX/._scene.gltf": b"\0"}
    path = archive_of(tmp_path / "town.zip", files)
    scene = load_scene(path)
    assert (scene.name, scene.path) == ("town", path)
    np.testing.assert_array_equal(scene.textures[0].pixels, noise())
    assert not scene.report.missing
    # The unpacked files stay as long as their pixels may be asked for.
    assert list(temporary.iterdir())
    del scene
    gc.collect()
    assert not list(temporary.iterdir())


def test_what_is_missing_in_an_archive_is_named_by_it(tmp_path: Path) -> None:
    files = scene_with_files(tmp_path)
    del files["scene.bin"]
    path = archive_of(tmp_path / "town.zip", files)
    with pytest.raises(InputError, match=r"town\.zip/scene\.gltf: buffers\[0\]\.uri: scene\.bin: cannot be read"):
        load_scene(path)


def test_meshes_in_an_archive_are_read_where_there_is_no_gltf(tmp_path: Path) -> None:
    mesh = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    assert load_scene(archive_of(tmp_path / "a.zip", {"a.obj": mesh})).report.used["triangles"] == 1
    glb = two_squares().write(tmp_path / "b.glb").read_bytes()
    assert len(load_scene(archive_of(tmp_path / "b.zip", {"a.obj": mesh, "b.glb": glb})).textures) == 2


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("source/model.zip", "holds another archive, source/model.zip; unpack it"),
        ("source/model.fbx", "holds source/model.fbx; FBX is not read: export it as glTF"),
        ("model.7z", "holds another archive, model.7z; unpack it"),
    ],
)
def test_what_an_archive_holds_instead_of_a_scene_is_named(tmp_path: Path, name: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        load_scene(archive_of(tmp_path / "a.zip", {"readme.txt": b"", name: b"?"}))


HOSTILE = ("no archive", "no scene", "several", "outside", "bomb", "broken", "encrypted", "nameless", "not utf-8")


def hostile(folder: Path, kind: str) -> tuple[Path, str]:
    """(an archive, what the refusal says)."""
    path = folder / "bad.zip"
    glb = two_squares().write(folder / "a.glb").read_bytes()
    if kind == "no archive":
        path.write_bytes(b"PK\x03\x04 no archive")
        return path, "cannot be unpacked"
    if kind == "no scene":
        return archive_of(path, {"a.txt": b""}), "the archive holds no scene"
    if kind == "several":
        return archive_of(
            path, {"a.glb": glb, "b.glb": glb}
        ), r"the archive holds 2 scenes, name one of them: a\.glb, b\.glb"
    if kind == "outside":
        return archive_of(path, {"../a.glb": glb}), "leads out of the archive"
    if kind == "bomb":
        return archive_of(path, {"a.glb": bytes(FREE_BYTES + (1 << 27))}), "unpacks to"
    data = bytearray(archive_of(path, {"a.glb": glb}).read_bytes())
    if kind == "broken":
        data[60:90] = bytes(30)
    if kind == "nameless":
        data = data.replace(b"a.glb", b"\0.glb")
    if kind == "not utf-8":
        data = data.replace(b"a.glb", b"\xb0.glb")
        for signature, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
            struct.pack_into("<H", data, data.index(signature) + offset, 1 << 11)
    if kind == "encrypted":
        for signature, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
            struct.pack_into("<H", data, data.index(signature) + offset, 1)
    path.write_bytes(data)
    return path, "cannot be unpacked"


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_archives_are_refused_in_one_line(tmp_path: Path, temporary: Path, kind: str) -> None:
    path, words = hostile(tmp_path, kind)
    with pytest.raises(InputError, match=words) as caught:
        load_scene(path)
    assert "\n" not in str(caught.value)
    assert not list(temporary.iterdir())
    assert not (tmp_path.parent / "a.glb").exists()


FACE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"


def opened(folder: Path, library: str | bytes, first: str | bytes = "mtllib a.mtl\n") -> Scene:
    (folder / "textures").mkdir(exist_ok=True)
    (folder / "textures/a.png").write_bytes(png(noise()))
    (folder / "a.mtl").write_bytes(library if isinstance(library, bytes) else library.encode())
    (folder / "a.obj").write_bytes((first if isinstance(first, bytes) else first.encode()) + FACE.encode())
    return load_scene(folder / "a.obj")


@pytest.mark.parametrize(
    "picture",
    [
        "textures/a.png",
        "textures\\a.png",
        '"textures/a.png"',
        "-bm 1 textures/a.png",
        "-clamp on -mm 0 1 textures/a.png",
    ],
)
def test_pictures_are_found_however_they_are_named(tmp_path: Path, picture: str) -> None:
    scene = opened(tmp_path, f"newmtl m\nKd 1 1 1\nmap_Kd {picture}\n")
    np.testing.assert_array_equal(scene.textures[0].pixels, noise())
    assert not scene.report.missing
    assert "OBJ, converted by trimesh" in scene.report.honoured


def test_what_has_no_effect_is_named(tmp_path: Path) -> None:
    library = "newmtl m\nKd 1 1 1\nd 0.5\nmap_Kd -s 2 2 1 -o 0.5 textures/a.png\nmap_Bump n.png\nmap_d a.png\n"
    scene = opened(tmp_path, library + "newmtl n\nd 1.0\nTr 0\nmap_Bump m.png\n", "mtllib a.mtl\nmtllib b.mtl\n")
    assert len(scene.textures) == 1
    expected = {"MTL d", "MTL map_Kd -s", "MTL map_Kd -o", "MTL map_Bump (2)", "MTL map_d"}
    assert expected | {"OBJ mtllib: further material libraries"} == set(scene.report.ignored)


@pytest.mark.parametrize("picture", ["b.png", "../outside.png", "/etc/passwd", "C:\\pictures\\b.png", "\0.png"])
def test_pictures_that_are_not_there_are_missing(tmp_path: Path, picture: str) -> None:
    (tmp_path / "outside.png").write_bytes(png(noise()))
    (tmp_path / "scene").mkdir()
    scene = opened(tmp_path / "scene", f"newmtl m\nKd 1 0 0\nmap_Kd {picture}\n")
    assert not scene.textures
    assert len(scene.report.missing) == 1
    assert scene.report.missing[0].isprintable()


def test_a_library_that_is_not_there_is_missing(tmp_path: Path) -> None:
    for name in ("none.mtl", "../a.txt", "/etc/passwd"):
        scene = opened(tmp_path, "", f"mtllib {name}\n")
        assert scene.report.missing == (f"{name}: no such file beside the scene [factors are used]",)


def test_absolute_paths_of_another_machine_name_what_lies_beside(tmp_path: Path) -> None:
    (tmp_path / "b.png").write_bytes(png(noise(seed=2)))
    scene = opened(tmp_path, "newmtl m\nKd 1 1 1\nmap_Kd /home/artist/work/b.png\n")
    np.testing.assert_array_equal(scene.textures[0].pixels, noise(seed=2))


def test_texts_in_an_old_encoding_are_read(tmp_path: Path) -> None:
    scene = opened(
        tmp_path, b"# \xe9t\xe9\nnewmtl m\nKd 1 1 1\nmap_Kd textures/a.png\n", b"# \xe9t\xe9\nmtllib a.mtl\n"
    )
    assert len(scene.textures) == 1
    (tmp_path / "a.stl").write_bytes(b"solid \xe9\xff")
    # Where charset_normalizer is installed, as it is with Ray, trimesh guesses an encoding.
    with pytest.raises(InputError, match=r"not a readable STL file \(its text is no UTF-8\)|holds no triangles"):
        load_scene(tmp_path / "a.stl")


def test_a_broken_picture_is_missing_and_one_in_another_format_is_read(tmp_path: Path) -> None:
    (tmp_path / "b.png").write_bytes(png(noise())[:60])
    (tmp_path / "c.ktx2").write_bytes(ktx2(noise(seed=3).tobytes(), (6, 4), 23))
    broken = opened(tmp_path, "newmtl m\nKd 1 0 0\nmap_Kd b.png\n")
    assert len(broken.report.missing) == 1
    assert "b.png" in broken.report.missing[0]
    other = opened(tmp_path, "newmtl m\nKd 1 1 1\nmap_Kd c.ktx2\n")
    np.testing.assert_array_equal(other.textures[0].pixels, noise(seed=3))


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".off"])
def test_surfaces_are_no_metal_and_have_two_sides(tmp_path: Path, suffix: str) -> None:
    trimesh.creation.box().export(tmp_path / f"a{suffix}")
    scene = load_scene(tmp_path / f"a{suffix}")
    assert [(m.factors.metalness, m.double_sided) for m in scene.materials] == [(0.0, True)]
    library = opened(tmp_path, "newmtl m\nKd 1 0 0\n")
    assert [(m.factors.metalness, m.double_sided, m.factor) for m in library.materials] == [(0.0, True, (1, 0, 0, 1))]


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
def test_vertex_colours_become_linear(tmp_path: Path, suffix: str) -> None:
    box = trimesh.creation.box()
    box.visual.vertex_colors = np.tile(np.array([[255, 128, 2, 255]], np.uint8), (len(box.vertices), 1))
    box.export(tmp_path / f"a{suffix}")
    colors = load_scene(tmp_path / f"a{suffix}").geometry.colors
    assert colors is not None
    np.testing.assert_allclose(colors[:, :3], np.tile([[1.0, 0.2158605, 0.000607]], (len(colors), 1)), atol=2e-5)


def test_a_folder_of_images_is_shown_as_it_is_encoded(tmp_path: Path) -> None:
    folder = tmp_path / "wall paper"
    (folder / "brick").mkdir(parents=True)
    clear = np.full((8, 8, 1), 128, np.uint8)
    images = {
        "brick/a ü.png": noise(8, 8),
        "b.png": np.dstack([noise(8, 8, seed=1), clear]),
        "c.png": noise(4, 8, seed=2),
    }
    for name, pixels in images.items():
        write_png(folder / name, pixels)
    write_png(folder / "constant.png", np.full((4, 4, 3), 7, np.uint8))
    scene = load_scene(folder)
    encoded = {(each.name, each.pixel_hash, each.category) for each in folder_textures(folder)}
    assert {(each.name, each.pixel_hash, each.category) for each in scene.textures} == encoded
    assert (scene.path, scene.name, scene.report.missing) == (folder, "wall paper", ())
    assert len(scene.instances.primitive) == 2 * 4
    # Triangles face outwards: panels to the camera, spheres from their middles.
    triangles = world_triangles(scene)
    facing = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])[:, 2].sum()
    assert facing > 0.0
