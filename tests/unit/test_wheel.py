"""The wheel holds shaders and assets, and works from another folder."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from ntc.c.library import library_path

pytestmark = pytest.mark.process

PROGRAM = "import sys, viewer, viewer.cli; print(viewer.__file__); sys.exit(viewer.cli.main())"
LARGEST_WHEEL = 25_000_000
"""In bytes. Another pack or picture that does not fit is encoded or made on request."""
REPOSITORY = Path(__file__).resolve().parents[2]


def test_wheel_draws_the_built_in_scene_from_another_folder(tmp_path: Path) -> None:
    wheels, site, elsewhere = tmp_path / "wheels", tmp_path / "site", tmp_path / "elsewhere"
    elsewhere.mkdir()
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    subprocess.run([*pip, "wheel", "--no-deps", "--wheel-dir", str(wheels), str(REPOSITORY)], check=True)
    (wheel,) = wheels.glob("*.whl")
    assert wheel.stat().st_size <= LARGEST_WHEEL
    names = zipfile.ZipFile(wheel).namelist()
    assert any(name.endswith("courtyard.glb") for name in names)
    # What pages are made of needs neither npm nor a compiler.
    assert any(name.endswith("three/generated/ntc.wasm") for name in names)
    assert any(name.endswith("vendor/three.js") for name in names)
    assert not any("/build/" in name or name.startswith("tests/") for name in names)
    subprocess.run([*pip, "install", "--no-deps", "--target", str(site), str(wheel)], check=True)
    result = subprocess.run(
        [sys.executable, "-c", PROGRAM, "render", "--out", "o", "--size", "96x54"],
        cwd=elsewhere,
        env={**os.environ, "PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    assert str(site) in result.stdout
    assert (elsewhere / "o" / "color.png").is_file()
    if shutil.which("cc") is not None:
        assert "-none-any" not in wheel.name
        assert library_path().name in {Path(name).name for name in names}
