"""Files that vanish or change while they are open: one clear line, never other data than what is shown."""

import errno
import io
import os
import shutil
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc import io as files
from ntc.codec.config import GroupingConfig
from ntc.errors import InputError
from ntc.pack.file import read_pack, write_pack
from ntc.pack.model import Pack
from ntc.reading import read_file
from tests.support.gltf_builder import GltfBuilder, png
from viewer import cli
from viewer.cli import encode as encode_command
from viewer.cli.info_all import files_below
from viewer.commands import run_command
from viewer.scene.images import folder_textures
from viewer.scene.load import load_scene
from viewer.scene.source_textures import source_textures
from viewer.state.actions import OpenFile, RunCommand
from viewer.state.pack_files import open_packs, packs_beside
from viewer.state.session import FirstLook, Session
from viewer.state.settings import ViewerSettings, load_settings, save_settings
from viewer.training.grouping_process import GroupingJob, grouping_inputs
from viewer.training.run_log import Run

Spoil = Callable[[Path], None]
SECONDS = 20.0


def deleted(path: Path) -> None:
    path.unlink()


def emptied(path: Path) -> None:
    path.write_bytes(b"")


def garbage(path: Path) -> None:
    path.write_bytes(np.random.default_rng(1).bytes(path.stat().st_size))


def truncated(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])


def folder_instead(path: Path) -> None:
    path.unlink()
    path.mkdir()


def pipe_instead(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def ring_of_links(path: Path) -> None:
    path.unlink()
    path.symlink_to(path)


def unreadable(path: Path) -> None:
    if os.geteuid() == 0:
        pytest.skip("root may read anything")
    path.chmod(0)


every_way = pytest.mark.parametrize(
    "spoil",
    [deleted, emptied, garbage, truncated, folder_instead, pipe_instead, ring_of_links, unreadable],
    ids=lambda spoil: spoil.__name__,
)


def write_scene(folder: Path, seed: int = 0) -> Path:
    """scene.gltf with scene.bin and two images beside it, and a pack."""
    builder, random = GltfBuilder(), np.random.default_rng(seed)
    primitives = []
    for number in range(2):
        (folder / f"picture{number}.png").write_bytes(png(random.integers(0, 256, (16, 16, 3), np.uint8)))
        image = builder.add("images", uri=f"picture{number}.png")
        primitives.append(builder.triangle(builder.material(image)))
    path = builder.drawn(*primitives).write(folder / "scene.gltf", uri="scene.bin")
    write_pack(folder / "scene.single.ntc", pack_of(path))
    return path


def pack_of(path: Path, seed: int = 0) -> Pack:
    hashes = [texture.pixel_hash for texture in load_scene(path).textures]
    return random_pack(((16, 16), (16, 16)), (0, 1), hashes=hashes, seed=seed)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write_scene(tmp_path)


@pytest.fixture
def session(path: Path) -> Session:
    made = Session(load_scene(path), open_packs(packs_beside(path)), ViewerSettings(), FirstLook())
    made.use_commands(run_command)
    made.pictures_folder = path.parent / "pictures"
    return made


def errors(session: Session) -> list[str]:
    lines = [entry.text for entry in session.log if entry.kind == "error"]
    assert all("\n" not in line and "Traceback" not in line for line in lines)
    return lines


@every_way
@pytest.mark.parametrize("name", ["scene.gltf", "scene.bin", "picture0.png", "scene.single.ntc"])
def test_opening_again_what_was_spoilt(session: Session, path: Path, name: str, spoil: Spoil) -> None:
    scene, packs = session.scene, session.packs
    spoil(path.with_name(name))
    session.apply(OpenFile(path))
    if name in ("scene.gltf", "scene.bin") and not (name == "scene.bin" and spoil is garbage):
        assert session.scene is scene
        assert session.packs is packs
        assert len(errors(session)) == 1
        assert "scene" in errors(session)[0]
    elif name == "picture0.png":
        # A scene is shown without its image, and says so.
        assert session.scene.report.missing
    elif name == "scene.single.ntc":
        assert session.packs == {}
        assert len(errors(session)) == (1 if path.with_name(name).is_file() else 0)


@every_way
def test_a_spoilt_pack_leaves_the_one_that_is_open(session: Session, path: Path, spoil: Spoil) -> None:
    packs, view = session.packs, session.view
    pack = path.with_name("scene.single.ntc")
    spoil(pack)
    session.apply(OpenFile(pack))
    assert session.packs is packs
    assert session.view == view
    assert len(errors(session)) == 1
    assert str(pack) in errors(session)[0]


@every_way
def test_loading_a_spoilt_view(session: Session, tmp_path: Path, spoil: Spoil) -> None:
    session.apply(RunCommand("view.save", ("look.json",)))
    view = session.view
    spoil(session.pictures_folder / "look.json")
    session.apply(RunCommand("view.load", ("look.json",)))
    assert session.view == view
    assert len(errors(session)) == 1
    assert "look.json" in errors(session)[0]


@pytest.mark.parametrize("name", ["x" * 300, "a\0b", "~", "/dev/null/x", "."])
@pytest.mark.parametrize("command", ["view.load", "view.save", "training.accept"])
def test_names_that_no_file_can_have(
    session: Session, command: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    finished(session)
    session.apply(RunCommand(command, (name if command != "training.accept" else f"{name}.ntc",)))
    settle(session)
    if name != "." and not (command != "view.load" and name == "~"):
        assert len(errors(session)) == 1


def test_the_folder_of_pictures_is_made_again(session: Session) -> None:
    session.apply(RunCommand("view.save", ("look.json",)))
    shutil.rmtree(session.pictures_folder)
    session.apply(RunCommand("view.save", ("look.json",)))
    assert (session.pictures_folder / "look.json").is_file()
    shutil.rmtree(session.pictures_folder)
    session.pictures_folder.write_text("a file")
    session.apply(RunCommand("view.save", ("look.json",)))
    assert len(errors(session)) == 1
    assert "cannot be written" in errors(session)[0]


def test_a_folder_that_cannot_be_listed_has_no_packs(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_path: Path) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "iterdir", refuse)
    assert packs_beside(path) == ()


def finished(session: Session, seed: int = 7) -> Pack:
    """A training has ended, and waits to be accepted."""
    assert session.scene.path is not None
    hashes = [texture.pixel_hash for texture in session.scene.textures]
    pack = random_pack(((16, 16), (16, 16)), (0, 1), hashes=hashes, seed=seed)
    run = Run(1, "retrain group 0", "quick", 2, "done", 1.0, None, pack=pack)
    session.training.log.add(run)
    session.packs = {**session.packs, run.name: pack}
    return pack


def settle(session: Session) -> None:
    began = time.monotonic()
    while session.training.saving:
        session.training.tick(session.scene, frozenset())
        assert time.monotonic() - began < SECONDS
        time.sleep(0.005)


def accept(session: Session, *path: Path) -> None:
    session.apply(RunCommand("training.accept", tuple(map(str, path))))
    settle(session)


def test_a_pack_that_is_as_it_was_opened_is_replaced(session: Session, path: Path) -> None:
    pack, file = finished(session), path.with_name("scene.single.ntc")
    accept(session, file)
    assert errors(session) == []
    np.testing.assert_array_equal(read_pack(file).textures[0].latents, pack.textures[0].latents)
    assert session.training.log.undecided is None
    # What was written last is known too.
    finished(session, 8)
    accept(session, file)
    assert errors(session) == []


@pytest.mark.parametrize("spoil", [emptied, garbage, truncated], ids=lambda spoil: spoil.__name__)
def test_a_pack_that_others_have_changed_is_not_replaced(session: Session, path: Path, spoil: Spoil) -> None:
    pack, file = finished(session), path.with_name("scene.single.ntc")
    spoil(file)
    changed = file.read_bytes()
    accept(session, file)
    assert len(errors(session)) == 1
    assert "has changed since it was opened" in errors(session)[0]
    assert file.read_bytes() == changed
    assert session.training.log.undecided == 1
    accept(session)
    written = path.with_name("scene.random.ntc")
    assert len(errors(session)) == 1
    np.testing.assert_array_equal(read_pack(written).textures[0].latents, pack.textures[0].latents)


def test_another_pack_in_its_place_is_not_replaced(session: Session, path: Path) -> None:
    finished(session)
    file = path.with_name("scene.single.ntc")
    write_pack(file, pack_of(path, 3))
    changed = file.read_bytes()
    accept(session, file)
    assert "has changed since it was opened" in errors(session)[0]
    assert file.read_bytes() == changed
    # Opened again, it is what the user knows.
    session.apply(OpenFile(file))
    accept(session, file)
    assert len(errors(session)) == 1
    assert file.read_bytes() != changed


def test_a_pack_that_is_gone_is_written_anew(session: Session, path: Path) -> None:
    finished(session)
    file = path.with_name("scene.single.ntc")
    file.unlink()
    accept(session, file)
    assert errors(session) == []
    assert read_pack(file).textures


def test_a_name_that_was_taken_meanwhile_is_not_replaced(session: Session, path: Path) -> None:
    finished(session)
    written = path.with_name("scene.random.ntc")
    session.apply(RunCommand("training.accept", ()))
    settle(session)
    assert written.is_file()
    finished(session, 9)
    accept(session)
    assert path.with_name("scene.random-2.ntc").is_file()


def test_the_scene_folder_is_gone(session: Session, path: Path, tmp_path: Path) -> None:
    finished(session)
    scene_folder = path.parent
    shutil.rmtree(scene_folder)
    scene_folder.write_text("a file")
    accept(session)
    assert len(errors(session)) == 1
    assert session.training.log.undecided == 1
    scene_folder.unlink()
    accept(session, tmp_path / "other" / "pack.ntc")
    assert (tmp_path / "other" / "pack.ntc").is_file()


def test_accepting_onto_a_full_disk(session: Session, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    finished(session)
    fsync = os.fsync

    def full(_handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(files.os, "fsync", full)
    before = sorted(path.parent.iterdir())
    accept(session)
    assert len(errors(session)) == 1
    assert "No space left on device" in errors(session)[0]
    assert sorted(path.parent.iterdir()) == before
    assert session.training.log.undecided == 1
    assert session.training.log[1].pack is not None
    monkeypatch.setattr(files.os, "fsync", fsync)
    accept(session, path.with_name("elsewhere.ntc"))
    assert read_pack(path.with_name("elsewhere.ntc")).textures
    assert session.training.log.undecided is None


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

        def read(self, size: int = -1) -> bytes:
            change()
            return super().read(size)

    monkeypatch.setattr("ntc.reading.os.fdopen", lambda handle, _mode: Changing(handle))
    changes = (lambda: os.utime(file, ns=(1, 1)), lambda: os.truncate(file, 100))
    for change in changes:  # noqa: B007 - the file calls it
        with pytest.raises(InputError, match=r"scene\.single\.ntc: cannot be read \(it changed while it was read\)"):
            read_pack(file)
    monkeypatch.setattr("ntc.reading.os.fdopen", fdopen)
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
    monkeypatch.setattr("viewer.cli.info_all.files_below", lambda _: found)
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

    def spoilt(paths: object) -> list[Path]:
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
    np.testing.assert_array_equal(read_pack(kept).textures[0].latents, pack.textures[0].latents)
