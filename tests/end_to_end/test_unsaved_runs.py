"""An autosaved run is no pack of its scene: every command takes the pack that the user kept, and none where none was kept."""

import shutil
from pathlib import Path

import pytest

from ntc.pack.file import read_pack
from tests.end_to_end.conftest import two_squares
from viewer import cli
from viewer.locations import DATA_FOLDER_VARIABLE, unsaved_runs_folder
from viewer.scene.load import load_scene
from viewer.training.run_store import UnsavedRuns


@pytest.fixture(scope="module")
def encoded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with scene.glb and its packs `single`, of 6 bits, and `baseline`, of 2 bits, apart from it."""
    folder = tmp_path_factory.mktemp("encoded")
    scene = two_squares().write(folder / "scene.glb")
    for grouping, bits in (("single", "6"), ("baseline", "2")):
        out = ("--out", str(folder / f"{grouping}.ntc"))
        assert cli.main(["encode", str(scene), *out, "--grouping", grouping, "--bits", bits]) == 0
    return folder


@pytest.fixture
def scene(encoded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scene with an autosaved run in grouping `baseline`, newer than all else."""
    monkeypatch.setenv(DATA_FOLDER_VARIABLE, str(tmp_path / "data"))
    monkeypatch.setenv("NTC_VIEWER_CACHE_DIR", str(tmp_path / "cache"))
    path = Path(shutil.copy(encoded / "scene.glb", tmp_path / "scene.glb"))
    unsaved, pack, loaded = UnsavedRuns(unsaved_runs_folder()), read_pack(encoded / "baseline.ntc"), load_scene(path)
    unsaved.write(unsaved.new_file(loaded, pack), pack)
    assert len(unsaved.of(loaded)) == 1
    return path


@pytest.fixture
def kept(scene: Path, encoded: Path) -> Path:
    """The same scene with a kept pack in grouping `single`."""
    shutil.copy(encoded / "single.ntc", scene.with_name("scene.single.ntc"))
    return scene


def test_render_draws_the_kept_pack(kept: Path, encoded: Path) -> None:
    pictures = []
    for name, options in (("beside", ()), ("named", ("--pack", str(encoded / "single.ntc")))):
        out = kept.parent / name
        assert cli.main(["render", str(kept), "--out", str(out), "--size", "96x64", *options]) == 0
        pictures.append((out / "color.png").read_bytes())
    assert pictures[0] == pictures[1]


def test_export_writes_the_kept_pack(kept: Path) -> None:
    out = kept.parent / "export" / "scene.gltf"
    out.parent.mkdir()
    assert cli.main(["export", str(kept), "--out", str(out)]) == 0
    (pack,) = out.parent.glob("*.ntc")
    assert read_pack(pack).grouping.name == "single"
