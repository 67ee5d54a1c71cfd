"""Commands that encode and decode codec `block` never import torch, which takes a second or two."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.support.textures import waves

SCRIPT = """
import sys
from viewer.cli import main
if __name__ == "__main__":
    status = main(sys.argv[1:])
    assert "torch" not in sys.modules, "torch was imported"
    sys.exit(status)
"""


def run(folder: Path, *arguments: str) -> None:
    """Run one command in a process of its own, which fails where torch was imported."""
    script = folder / "command.py"
    script.write_text(SCRIPT)
    done = subprocess.run([sys.executable, str(script), *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.process
@pytest.mark.gl
@pytest.mark.slow
def test_commands_never_import_torch(tmp_path: Path) -> None:
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
