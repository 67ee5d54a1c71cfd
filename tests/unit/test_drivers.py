"""Other drivers to test with: where they are missing, a line says what would bring them."""

import os
from pathlib import Path

import pytest

from tests.drivers import drivers
from tests.drivers.drivers import FOLDER_VARIABLE, Driver, mesa_folder, other_drivers, write_python


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


def test_the_folder_is_what_the_environment_says(tmp_path: Path) -> None:
    assert mesa_folder({FOLDER_VARIABLE: str(tmp_path)}) == tmp_path
    assert mesa_folder({}) == drivers.DEFAULT_FOLDER


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
