"""Tests have session folders of their own, so that drivers write no lines on stderr of folders that are missing."""

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.drivers import messages
from tests.drivers.messages import RUNTIME_VARIABLE, SHADERS_VARIABLE, error_line, own_session_folders

CACHE_VARIABLE = "XDG_CACHE_HOME"
ASKS_FOR_WAYLAND = "import ctypes; ctypes.CDLL('libwayland-client.so.0').wl_display_connect(None)"


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """An environment as a fresh machine has it, which is put back after the test."""
    for name in (RUNTIME_VARIABLE, SHADERS_VARIABLE, CACHE_VARIABLE, "HOME"):
        # Noted first, so that it is put back even where nothing was set.
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    return monkeypatch


def test_this_run_has_a_private_folder() -> None:
    folder = Path(os.environ[RUNTIME_VARIABLE])
    assert folder.is_absolute()
    assert folder.stat().st_uid == os.getuid()
    assert folder.stat().st_mode & 0o777 == 0o700
    assert Path(os.environ[SHADERS_VARIABLE]).is_absolute()


def test_the_users_own_folder_is_not_taken(fresh: pytest.MonkeyPatch, tmp_path: Path) -> None:
    fresh.setenv(RUNTIME_VARIABLE, str(tmp_path))
    with own_session_folders():
        folder = Path(os.environ[RUNTIME_VARIABLE])
        assert folder != tmp_path
        assert folder.stat().st_mode & 0o777 == 0o700
    assert not folder.exists()
    assert tmp_path.is_dir()


@pytest.mark.parametrize("has_folder", [False, True])
@pytest.mark.parametrize("variable", ["HOME", CACHE_VARIABLE])
def test_shaders_are_cached_where_the_user_has_them(
    variable: str, has_folder: bool, fresh: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    folder = tmp_path / ".cache"
    if has_folder:
        folder.mkdir()
        (folder / "kept").touch()
    fresh.setenv("HOME", "/dev/null")
    fresh.setenv(variable, str(tmp_path if variable == "HOME" else folder))
    with own_session_folders():
        assert os.environ[SHADERS_VARIABLE] == str(folder)
    assert [path.name for path in folder.iterdir()] == ["kept"] * has_folder


@pytest.mark.parametrize("home", ["/dev/null", "/proc", "absent", "relative"])
def test_shaders_are_cached_in_the_repository_without_a_home(
    home: str, fresh: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    fresh.setenv("HOME", str(tmp_path / home) if home == "absent" else home)
    fresh.setattr(messages, "OWN_CACHE", tmp_path / "own")
    with own_session_folders():
        assert os.environ[SHADERS_VARIABLE] == str(tmp_path / "own")
    assert (tmp_path / "own").is_dir()


def test_shaders_are_cached_privately_where_nothing_else_can_be_written(fresh: pytest.MonkeyPatch) -> None:
    fresh.setenv("HOME", "/dev/null")
    fresh.setattr(messages, "OWN_CACHE", Path("/dev/null/own"))
    with own_session_folders():
        assert os.environ[SHADERS_VARIABLE] == os.environ[RUNTIME_VARIABLE]


def test_a_cache_folder_that_is_given_stays(fresh: pytest.MonkeyPatch, tmp_path: Path) -> None:
    fresh.setenv(SHADERS_VARIABLE, str(tmp_path))
    with own_session_folders():
        assert os.environ[SHADERS_VARIABLE] == str(tmp_path)
    assert tmp_path.is_dir()


@pytest.mark.process
def test_a_driver_that_asks_for_wayland_says_nothing() -> None:
    try:
        ctypes.CDLL("libwayland-client.so.0")
    except OSError as error:
        pytest.skip(f"there is no libwayland: apt-get install libwayland-client0 ({error})")
    ran = subprocess.run([sys.executable, "-c", ASKS_FOR_WAYLAND], capture_output=True, text=True, check=True)
    assert ran.stderr == ""


def test_the_one_line_of_error_is_found_among_those_of_drivers() -> None:
    assert error_line("libEGL warning: no screen\nerror: a.glb: is no scene\n") == "error: a.glb: is no scene"
    for wrong in ("", "libEGL warning: error: no screen", "error: a\nerror: b", "Traceback (most recent\nerror: a"):
        with pytest.raises(AssertionError):
            error_line(wrong)
