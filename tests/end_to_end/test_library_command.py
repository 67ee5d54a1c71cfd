"""`ntc-viewer library`, and a scene that is drawn with what a library holds of it."""

import json
from pathlib import Path

import pytest

from ntc.pack.file import read_pack
from tests.end_to_end.export.material_scene import materials_scene, waves
from tests.support.gltf_builder import png
from viewer import cli
from viewer.locations import builtin_scene_path
from viewer.scene.images import read_image


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """scene.glb, with the pack apart.ntc in a folder of its own."""
    path = materials_scene().write(tmp_path_factory.mktemp("scene") / "scene.glb")
    pack = path.parent / "packs" / "apart.ntc"
    pack.parent.mkdir()
    assert cli.main(["encode", str(path), "--out", str(pack), "--grouping", "baseline", "--bits", "8"]) == 0
    return path


@pytest.fixture
def library(scene: Path, tmp_path: Path) -> Path:
    """That pack, and one of the built-in scene."""
    folder = tmp_path / "library"
    packs = [scene.parent / "packs" / "apart.ntc", builtin_scene_path().with_suffix(".clustered.ntc")]
    assert cli.main(["library", "add", str(folder), *map(str, packs)]) == 0
    return folder


def test_a_scene_is_drawn_the_same_with_its_pack_and_with_a_library(scene: Path, library: Path, tmp_path: Path) -> None:
    pictures = []
    for name, pack in (("pack", scene.parent / "packs" / "apart.ntc"), ("library", library)):
        out = tmp_path / name
        command = ["render", str(scene), "--out", str(out), "--pack", str(pack), "--grouping", "baseline"]
        assert cli.main([*command, "--size", "96x64"]) == 0
        pictures.append(read_image(out / "color.png"))
    assert (pictures[0] == pictures[1]).all()
    assert pictures[0].std() > 5.0


def test_it_is_listed_verified_and_taken_out(
    scene: Path, library: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    for command in (["library", "list", str(library)], ["info", str(library)]):
        assert cli.main([*command, "--json"]) == 0
        rows = json.loads(capsys.readouterr().out)
        assert len(rows) == 3 + 55
        assert {row["grouping"] for row in rows} == {"baseline", "clustered"}
    assert cli.main(["library", "verify", str(library)]) == 0
    pack = sorted(library.glob("*.ntc"))[0]
    data = bytearray(pack.read_bytes())
    data[len(data) // 2] ^= 4
    pack.write_bytes(bytes(data))
    capsys.readouterr()
    assert cli.main(["library", "verify", str(library)]) == 1
    assert pack.name in capsys.readouterr().out
    data[len(data) // 2] ^= 4
    pack.write_bytes(bytes(data))
    out = tmp_path / "out.ntc"
    assert cli.main(["library", "extract", str(library), str(scene), "--out", str(out)]) == 0
    own = read_pack(scene.parent / "packs" / "apart.ntc")
    assert {each.pixel_hash for each in read_pack(out).textures} == {each.pixel_hash for each in own.textures}


def test_new_textures_take_decoders_of_a_pack(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    images, known, out = tmp_path / "images", scene.parent / "packs" / "apart.ntc", tmp_path / "new.ntc"
    images.mkdir()
    for number in range(3):
        (images / f"{number}.png").write_bytes(png(waves(20 + number)))
    command = ["encode", str(images), "--out", str(out), "--decoders", str(known), "--workers", "1"]
    assert cli.main(command) == 0
    assert "3 textures: 3 encoded" in capsys.readouterr().out
    new, old = read_pack(out), read_pack(known)
    assert [each.name for each in new.textures] == ["0", "1", "2"]
    assert new.config == old.config
    assert 1 <= len(new.decoders) <= len(old.decoders)
