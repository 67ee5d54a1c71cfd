"""Accepting a training: the pack on disk is replaced only where it is the one that was opened."""

import errno
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.grid.model import grid_parts
from ntc.pack.file import read_pack, write_pack
from tests.support.spoilt_files import (
    Spoil,
    accept,
    emptied,
    errors,
    finished,
    garbage,
    open_context,
    pack_of,
    settle,
    truncated,
    write_scene,
)
from viewer.commands import run_or_notify
from viewer.commands.command import Context


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write_scene(tmp_path)


@pytest.fixture
def context(path: Path) -> Context:
    return open_context(path)


def test_a_pack_that_is_as_it_was_opened_is_replaced(context: Context, path: Path) -> None:
    pack, file = finished(context), path.with_name("scene.single.ntc")
    accept(context, file)
    assert errors(context) == []
    np.testing.assert_array_equal(grid_parts(read_pack(file)).textures[0].latents, grid_parts(pack).textures[0].latents)
    assert context.training.log.undecided is None
    # What was written last is known too.
    finished(context, 8)
    accept(context, file)
    assert errors(context) == []


@pytest.mark.parametrize("spoil", [emptied, garbage, truncated], ids=lambda spoil: spoil.__name__)
def test_a_pack_that_others_have_changed_is_not_replaced(context: Context, path: Path, spoil: Spoil) -> None:
    pack, file = finished(context), path.with_name("scene.single.ntc")
    spoil(file)
    changed = file.read_bytes()
    accept(context, file)
    assert len(errors(context)) == 1
    assert "has changed since it was opened" in errors(context)[0]
    assert file.read_bytes() == changed
    assert context.training.log.undecided == 1
    accept(context)
    written = path.with_name("scene.random.ntc")
    assert len(errors(context)) == 1
    np.testing.assert_array_equal(
        grid_parts(read_pack(written)).textures[0].latents, grid_parts(pack).textures[0].latents
    )


def test_another_pack_in_its_place_is_not_replaced(context: Context, path: Path) -> None:
    finished(context)
    file = path.with_name("scene.single.ntc")
    write_pack(file, pack_of(path, 3))
    changed = file.read_bytes()
    accept(context, file)
    assert "has changed since it was opened" in errors(context)[0]
    assert file.read_bytes() == changed
    # Opened again, it is what the user knows.
    run_or_notify(context, "file.open", file)
    accept(context, file)
    assert len(errors(context)) == 1
    assert file.read_bytes() != changed


def test_a_pack_that_is_gone_is_written_anew(context: Context, path: Path) -> None:
    finished(context)
    file = path.with_name("scene.single.ntc")
    file.unlink()
    accept(context, file)
    assert errors(context) == []
    assert read_pack(file).textures


def test_a_name_that_was_taken_meanwhile_is_not_replaced(context: Context, path: Path) -> None:
    finished(context)
    written = path.with_name("scene.random.ntc")
    run_or_notify(context, "training.accept")
    settle(context)
    assert written.is_file()
    finished(context, 9)
    accept(context)
    assert path.with_name("scene.random-2.ntc").is_file()


def test_the_scene_folder_is_gone(context: Context, path: Path, tmp_path: Path) -> None:
    finished(context)
    scene_folder = path.parent
    shutil.rmtree(scene_folder)
    scene_folder.write_text("a file")
    accept(context)
    assert len(errors(context)) == 1
    assert context.training.log.undecided == 1
    scene_folder.unlink()
    accept(context, tmp_path / "other" / "pack.ntc")
    assert (tmp_path / "other" / "pack.ntc").is_file()


def test_accepting_onto_a_full_disk(context: Context, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    finished(context)
    fsync = os.fsync

    def full(_handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    before = sorted(path.parent.iterdir())
    accept(context)
    assert len(errors(context)) == 1
    assert "No space left on device" in errors(context)[0]
    assert sorted(path.parent.iterdir()) == before
    assert context.training.log.undecided == 1
    assert context.training.log[1].pack is not None
    monkeypatch.setattr(os, "fsync", fsync)
    accept(context, path.with_name("elsewhere.ntc"))
    assert read_pack(path.with_name("elsewhere.ntc")).textures
    assert context.training.log.undecided is None
