"""Commands do not import what they do not need: torch takes a second or two, numba with scipy almost one."""

import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from tests.support.textures import waves

SCRIPT = """
import sys
from viewer.cli import main
if __name__ == "__main__":
    status = main(sys.argv[2:])
    imported = set(sys.argv[1].split()) & set(sys.modules)
    assert not imported, f"{imported} imported"
    sys.exit(status)
"""


def run(folder: Path, *arguments: str, unwanted: str = "torch") -> None:
    """Run one command in a process of its own, which fails where a module of `unwanted` was imported."""
    script = folder / "command.py"
    script.write_text(SCRIPT)
    done = subprocess.run(
        [sys.executable, str(script), unwanted, *arguments], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_codec_block_needs_no_torch(tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    Image.fromarray(np.ascontiguousarray(waves(32, 32, 3).pixels)).save(tmp_path / "images" / "waves.png")
    pack, of_images = str(tmp_path / "gallery.ntc"), str(tmp_path / "images.ntc")
    by_jobs = str(tmp_path / "jobs.ntc")
    run(tmp_path, "encode", "gallery", "--texture-size", "16", "--codec", "block", "--out", pack)
    run(tmp_path, "encode", str(tmp_path / "images"), "--codec", "block", "--out", of_images)
    run(tmp_path, "encode", str(tmp_path / "images"), "--codec", "block", "--workers", "1", "--out", by_jobs)
    run(tmp_path, "decode", of_images, "--out", str(tmp_path / "decoded"))
    run(tmp_path, "check", "gallery", "--pack", pack, "--views", "0")
    run(tmp_path, "check", of_images)
    run(tmp_path, "export", "gallery", "--pack", pack, "--as", "png", "--out", str(tmp_path / "gallery.gltf"))


def test_looking_needs_neither_torch_nor_numba(tmp_path: Path) -> None:
    unwanted = "torch numba scipy matplotlib"
    run(tmp_path, "render", "--size", "64x36", "--out", str(tmp_path / "picture"), unwanted=unwanted)
    run(tmp_path, "info", "gallery", unwanted=unwanted)
    script = "wait settled; wait frames 2"
    run(
        tmp_path, "view", "--headless", "--size", "320x180", "--exec", script, "--out", str(tmp_path), unwanted=unwanted
    )
