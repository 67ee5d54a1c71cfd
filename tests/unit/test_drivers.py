"""Other drivers to test with: where they are missing a line says what would bring them, and none writes lines of its own."""

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.drivers.drivers import FOLDER_VARIABLE, Driver, other_drivers, write_python
from tests.drivers.messages import RUNTIME_VARIABLE, SHADERS_VARIABLE, error_line


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """As an unpacked suite lies."""
    libraries = tmp_path / "usr/lib/x86_64-linux-gnu"
    icd = tmp_path / "usr/share/vulkan/icd.d"
    libraries.mkdir(parents=True)
    icd.mkdir(parents=True)
    (libraries / "ld-linux-x86-64.so.2").touch()
    (icd / "lvp_icd.json").touch()
    return tmp_path


def test_the_python_of_a_folder_is_a_command_of_its_own(folder: Path) -> None:
    command = write_python(folder)
    assert os.access(command, os.X_OK)
    lines = command.read_text().splitlines()
    assert lines[0] == "#!/bin/sh"
    assert f"--argv0 {command}" in lines[-1]
    assert f"export MESA_SHADER_CACHE_DIR={folder / 'shader-cache'}" in lines
    assert (folder / "pyvenv.cfg").read_text().startswith("home = ")
    assert write_python(folder) == command


def test_missing_drivers_say_what_brings_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "absent"))
    monkeypatch.setattr(Driver, "description", lambda _: None)
    found = list(other_drivers())
    assert [driver for driver, _ in found] == [None, None, None]
    texts = [text for _, text in found]
    assert texts[0] == f"newer llvmpipe: python3 -m tests.drivers.newer_mesa {tmp_path / 'absent'}"
    assert "apt-get install mesa-vulkan-drivers" in texts[1]
    assert texts[2].startswith("OpenGL 4.1: ")


def test_a_driver_that_does_not_start_is_none(tmp_path: Path) -> None:
    fails = tmp_path / "python"
    fails.write_text("#!/bin/sh\nexit 1\n")
    fails.chmod(0o755)
    assert Driver("broken", fails, {}, "").description() is None
    other = tmp_path / "other"
    other.write_text('#!/bin/sh\necho \'["softpipe", "4.5"]\'\n')
    other.chmod(0o755)
    assert Driver("zink", other, {}, "zink").description() is None
    assert Driver("any", other, {}, "pipe").description() == "softpipe, OpenGL 4.5"


ASKS_FOR_WAYLAND = "import ctypes; ctypes.CDLL('libwayland-client.so.0').wl_display_connect(None)"


def test_this_run_has_a_private_folder() -> None:
    folder = Path(os.environ[RUNTIME_VARIABLE])
    assert folder.is_absolute()
    assert folder.stat().st_uid == os.getuid()
    assert folder.stat().st_mode & 0o777 == 0o700
    assert Path(os.environ[SHADERS_VARIABLE]).is_absolute()


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
