"""OBJ files with material libraries as exporters write them: what is read, and what the load report says of the rest."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from ntc.errors import InputError
from tests.support.gltf_builder import ktx2, noise, png
from viewer.scene.load import load_scene
from viewer.scene.model import Scene

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
