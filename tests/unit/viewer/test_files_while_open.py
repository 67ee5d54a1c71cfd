"""Files that vanish or change while they are open: one clear line, never other data than what is shown."""

import errno
import io
import os
import shutil
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc.codec.config import GroupingConfig
from ntc.codec.grid.model import grid_parts
from ntc.errors import InputError
from ntc.io import read_file
from ntc.pack.file import read_pack, write_pack
from tests.support.gltf_builder import png
from tests.support.spoilt_files import (
    Spoil,
    deleted,
    errors,
    every_way,
    finished,
    folder_instead,
    garbage,
    open_context,
    pack_of,
    ring_of_links,
    settle,
    write_scene,
)
from viewer import cli
from viewer.cli import encode as encode_command
from viewer.cli.info import files_below
from viewer.commands import run_or_notify
from viewer.commands.command import Context
from viewer.scene.images import folder_textures
from viewer.scene.load import load_scene
from viewer.scene.source_textures import source_textures
from viewer.state.pack_files import packs_beside
from viewer.state.settings import ViewerSettings, load_settings, save_settings
from viewer.training.grouping_process import GroupingJob, grouping_inputs


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write_scene(tmp_path)


@pytest.fixture
def context(path: Path) -> Context:
    return open_context(path)


@every_way
@pytest.mark.parametrize("name", ["scene.gltf", "scene.bin", "picture0.png", "scene.single.ntc"])
def test_opening_again_what_was_spoilt(context: Context, path: Path, name: str, spoil: Spoil) -> None:
    scene, packs = context.session.scene, context.session.packs
    spoil(path.with_name(name))
    run_or_notify(context, "file.open", path)
    if name in ("scene.gltf", "scene.bin") and not (name == "scene.bin" and spoil is garbage):
        assert context.session.scene is scene
        assert context.session.packs is packs
        assert len(errors(context)) == 1
        assert "scene" in errors(context)[0]
    elif name == "picture0.png":
        # A scene is shown without its image, and says so.
        assert context.session.scene.report.missing
    elif name == "scene.single.ntc":
        assert context.session.packs == {}
        assert len(errors(context)) == (1 if path.with_name(name).is_file() else 0)


@every_way
def test_a_spoilt_pack_leaves_the_one_that_is_open(context: Context, path: Path, spoil: Spoil) -> None:
    packs, view = context.session.packs, context.session.view
    pack = path.with_name("scene.single.ntc")
    spoil(pack)
    run_or_notify(context, "file.open", pack)
    assert context.session.packs is packs
    assert context.session.view == view
    assert len(errors(context)) == 1
    assert str(pack) in errors(context)[0]


@every_way
def test_loading_a_spoilt_view(context: Context, tmp_path: Path, spoil: Spoil) -> None:
    run_or_notify(context, "view.save", "look.json")
    view = context.session.view
    spoil(context.session.pictures_folder / "look.json")
    run_or_notify(context, "view.load", "look.json")
    assert context.session.view == view
    assert len(errors(context)) == 1
    assert "look.json" in errors(context)[0]


@pytest.mark.parametrize("name", ["x" * 300, "a\0b", "~", "/dev/null/x", "."])
@pytest.mark.parametrize("command", ["view.load", "view.save", "training.keep"])
def test_names_that_no_file_can_have(
    context: Context, command: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    finished(context)
    run_or_notify(context, command, name if command != "training.keep" else f"{name}.ntc")
    settle(context)
    if name != "." and not (command != "view.load" and name == "~"):
        assert len(errors(context)) == 1


def test_the_folder_of_pictures_is_made_again(context: Context) -> None:
    run_or_notify(context, "view.save", "look.json")
    shutil.rmtree(context.session.pictures_folder)
    run_or_notify(context, "view.save", "look.json")
    assert (context.session.pictures_folder / "look.json").is_file()
    shutil.rmtree(context.session.pictures_folder)
    context.session.pictures_folder.write_text("a file")
    run_or_notify(context, "view.save", "look.json")
    assert len(errors(context)) == 1
    assert "cannot be written" in errors(context)[0]


def test_a_folder_that_cannot_be_listed_has_no_packs(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_path: Path) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "iterdir", refuse)
    assert packs_beside(path) == ()


def test_grouping_by_what_is_seen_takes_no_other_scene(path: Path) -> None:
    scene = load_scene(path)
    job = GroupingJob(GroupingConfig("covisible"), source_textures(scene, None), path)
    other = path.parent / "other"
    other.mkdir()
    write_scene(other, 5)
    for name in ("picture0.png", "picture1.png"):
        shutil.copy(other / name, path.with_name(name))
    with pytest.raises(InputError, match=r"scene\.gltf: has changed since it was opened; open it again"):
        grouping_inputs(job)
    path.unlink()
    with pytest.raises(InputError, match=r"scene\.gltf"):
        grouping_inputs(job)


def test_what_changes_while_it_is_read_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "scene.single.ntc"
    write_pack(file, random_pack(((16, 16),), (0,)))
    fdopen = os.fdopen

    class Changing(io.FileIO):
        """Changes when it is read."""

        def read(self, size: int | None = -1) -> bytes:
            change()
            return super().read(size)

    monkeypatch.setattr("ntc.io.os.fdopen", lambda handle, _mode: Changing(handle))
    changes = (lambda: os.utime(file, ns=(1, 1)), lambda: os.truncate(file, 100))
    for change in changes:  # noqa: B007 - the file calls it
        with pytest.raises(InputError, match=r"scene\.single\.ntc: cannot be read \(it changed while it was read\)"):
            read_pack(file)
    monkeypatch.setattr("ntc.io.os.fdopen", fdopen)
    assert len(read_file(file)) == 100


@every_way
def test_settings_that_were_spoilt(tmp_path: Path, spoil: Spoil) -> None:
    save_settings(tmp_path, replace(ViewerSettings(), flicker_hz=2.0))
    spoil(tmp_path / "settings.json")
    settings, problem = load_settings(tmp_path)
    assert settings == ViewerSettings()
    assert problem is None or "\n" not in problem
    # A ring of links leads nowhere.
    assert (problem is None) == (spoil in (deleted, ring_of_links))


def test_files_vanish_while_all_are_listed(
    path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = path.parent
    (folder / "sub").mkdir()
    shutil.copy(path, folder / "sub" / "scene.gltf")
    (folder / "zzz").mkdir()
    walk = os.walk

    def vanishing(top: Path, onerror: Callable[[OSError], None]) -> object:
        for number, entry in enumerate(walk(top, onerror=onerror)):
            if number == 0:
                shutil.rmtree(folder / "zzz")
            yield entry

    monkeypatch.setattr(os, "walk", vanishing)
    found = files_below(folder)
    assert [file.name for file in found] == ["scene.gltf", "scene.single.ntc", "scene.gltf"]
    monkeypatch.setattr("viewer.cli.info.files_below", lambda _: found)
    (folder / "scene.single.ntc").unlink()
    folder_instead(folder / "sub" / "scene.gltf")
    assert cli.main(["info", "--all", str(folder)]) == 0
    printed = capsys.readouterr()
    assert printed.out.endswith("3 files: 1 read, 2 refused, 0 crashed\n")
    assert printed.err == ""


@every_way
def test_encode_while_its_images_are_spoilt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], spoil: Spoil
) -> None:
    for number in range(3):
        pixels = np.random.default_rng(number).integers(0, 256, (8, 8, 3), np.uint8)
        (tmp_path / f"{number}.png").write_bytes(png(pixels))
    sort = sorted

    def spoilt(paths: Iterable[Path]) -> list[Path]:
        """Between listing and reading."""
        found = sort(paths)
        if (tmp_path / "1.png") in found:
            spoil(tmp_path / "1.png")
        return found

    monkeypatch.setattr("viewer.scene.images.sorted", spoilt, raising=False)
    with pytest.raises(InputError, match=r"1\.png"):
        folder_textures(tmp_path)


def test_a_pack_that_cannot_be_written_is_not_lost(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pack = pack_of(path)
    spare = tmp_path / "spare"
    spare.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(spare))
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(InputError, match=r"cannot be written .*; the pack is in .*spare") as raised:
        encode_command.write_or_rescue(tmp_path / "file" / "pack.ntc", pack)
    kept = next(spare.glob("*/*.ntc"))
    assert str(kept) in str(raised.value)
    np.testing.assert_array_equal(grid_parts(read_pack(kept)).textures[0].latents, grid_parts(pack).textures[0].latents)
