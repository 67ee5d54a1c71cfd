"""Scenes in zip archives open like the same files in a folder; hostile archives are refused and leave nothing behind."""

import gc
import struct
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest

from ntc.errors import InputError
from tests.end_to_end.conftest import two_squares
from tests.support.gltf_builder import GltfBuilder, noise, png
from viewer.scene.archives import FREE_BYTES
from viewer.scene.load import load_scene


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
