"""Scripts of steps and expectations, played in a window's content over a small scene with two packs. FOLDER is the current folder."""

import shutil
from pathlib import Path

import pytest

from tests.support.driven_app import DrivenApp
from tests.ui.conftest import write_scene
from viewer.scene.cameras_file import cameras_json
from viewer.scene.model import Camera
from viewer.script.script import parse_script

SCRIPTS = Path(__file__).with_name("scripts")
PATH = tuple(Camera(f"p{x}", (float(x), 0.0, 5.0), (0.0, 0.0, 0.0)) for x in range(3))


@pytest.fixture
def folder(scene_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with all files that scripts name."""
    for name, seed in (("other", 8), ("town", 9), ("half", 10), ("empty", 0)):
        (tmp_path / name).mkdir()
        if seed:
            write_scene(tmp_path / name, seed)
    for name in ("other", "town"):
        camera = Camera(name, (0.0, 1.0, 5.0), (0.0, 1.0, 0.0))
        (tmp_path / name / "cameras.json").write_text(cameras_json((camera,)))
    (tmp_path / "half" / "scene.clustered.ntc").write_bytes(b"")
    (tmp_path / "half" / "cameras.json").write_text("[{}]")
    (tmp_path / "path.json").write_text(cameras_json(PATH))
    shutil.copy(scene_path.with_name("scene.single.ntc"), tmp_path / "mine.ntc")
    for name in ("broken.glb", "broken.ntc", "words.txt"):
        (tmp_path / name).write_bytes(b"nothing that could be opened")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("script", sorted(SCRIPTS.glob("*.script")), ids=lambda path: path.stem)
def test_a_script_finds_what_it_expects(app: DrivenApp, folder: Path, script: Path) -> None:
    app.play(parse_script(script.read_text().replace("FOLDER", str(folder)), script.name))
    assert app.screenshot().std() > 5.0
