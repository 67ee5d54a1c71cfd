"""Files that vanish or change under an open window."""

import shutil
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from ntc.pack.file import read_pack
from tests.support.driven_app import DrivenApp
from tests.ui.conftest import Opener, write_scene
from viewer.commands.effects import PictureKind
from viewer.scene.load import load_scene
from viewer.state.pack_files import open_packs, packs_beside


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A scene that a test may spoil."""
    folder = tmp_path / "scene"
    folder.mkdir()
    return write_scene(folder)


@pytest.fixture
def window(own: Path, open_window: Opener) -> DrivenApp:
    packs = open_packs(packs_beside(own))
    made = open_window(shown=load_scene(own), packs=packs, live_figures=False, column_folded=False)
    made.settle()
    return made


def errors(app: DrivenApp) -> list[str]:
    return [entry.text for entry in app.session.window.log if entry.kind == "error"]


def picture(app: DrivenApp) -> np.ndarray:
    app.session.window.show_panels, app.session.window.toasts = False, ()
    app.settle()
    return app.screenshot()


def test_a_pack_is_replaced_by_half_of_itself(window: DrivenApp, own: Path) -> None:
    before, pack = picture(window), own.with_name("scene.clustered.ntc")
    pack.write_bytes(pack.read_bytes()[:2000])
    window.drop(pack)
    assert len(errors(window)) == 1
    np.testing.assert_array_equal(picture(window), before)
    window.drop(own)
    # The scene is opened without it.
    assert set(window.session.packs) == {"single"}
    assert window.session.window.log[0].repeats == 2
    read_pack(own.with_name("scene.single.ntc"))


def test_pictures_go_to_a_folder_that_is_no_more(window: DrivenApp, tmp_path: Path) -> None:
    pictures = tmp_path / "pictures"
    for spoil in (lambda: None, lambda: shutil.rmtree(pictures)):
        spoil()
        window.run("file.screenshot", "shot.png")
        window.settle()
        assert (pictures / "shot.png").is_file(), errors(window)
    shutil.rmtree(pictures)
    pictures.write_text("a file")
    window.run("file.screenshot", "shot.png")
    window.settle()
    window.run("file.screenshot-picture", get_args(PictureKind)[-1], "other.png")
    window.settle()
    assert ["cannot be written" in line for line in errors(window)] == [True, True]
