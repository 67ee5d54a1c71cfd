"""Accepting a training: the pack on disk is replaced only where it is the one that was opened."""

import errno
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from ntc import io as files
from ntc.pack.file import read_pack, write_pack
from tests.support.spoilt_files import (
    Spoil,
    accept,
    emptied,
    errors,
    finished,
    garbage,
    open_session,
    pack_of,
    settle,
    truncated,
    write_scene,
)
from viewer.state.actions import OpenFile, RunCommand
from viewer.state.session import Session


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write_scene(tmp_path)


@pytest.fixture
def session(path: Path) -> Session:
    return open_session(path)


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
