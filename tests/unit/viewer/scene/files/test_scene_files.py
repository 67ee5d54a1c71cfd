"""What stands for a scene: files, folders, cameras beside it; and what other files are told to be."""

import os
from pathlib import Path

import pytest

from ntc.errors import InputError
from tests.end_to_end.conftest import two_squares
from tests.support.gltf_builder import noise, png
from viewer.scene.cameras_file import cameras_beside, with_cameras_beside
from viewer.scene.folder_listing import completed, list_folder, matching
from viewer.scene.load import load_scene
from viewer.scene.scene_files import SCENES_NAMED, scene_file

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


def test_a_folder_without_a_scene_says_what_a_scene_is(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"holds no scene; a scene is a \.gltf"):
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
