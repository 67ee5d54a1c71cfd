"""integrations/blender: the add-on encodes, switches images and exports, in Blender without a window."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ntc.pack.file import read_pack
from viewer.scene.load import load_scene
from viewer.state.pack_files import match_scene, packs_of

ROOT = Path(__file__).resolve().parents[3]
ADDON = ROOT / "integrations" / "blender" / "ntc_viewer"

pytestmark = [pytest.mark.process, pytest.mark.guards("blender")]


def test_encode_switch_and_export(tmp_path: Path) -> None:
    blender = os.environ.get("NTC_VIEWER_BLENDER") or shutil.which("blender")
    if blender is None:
        pytest.skip(
            "no Blender is installed (Debian: apt-get install blender python3-numpy), nor named by NTC_VIEWER_BLENDER"
        )
    addons = tmp_path / "scripts" / "addons"
    addons.mkdir(parents=True)
    shutil.copytree(ADDON, addons / "ntc_viewer")
    program = tmp_path / "ntc-viewer"
    program.write_text(f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" -m viewer "$@"\n')
    program.chmod(0o755)
    hidden = ("PYTHONPATH", "VIRTUAL_ENV", "PYTHONHOME")
    environment = {key: value for key, value in os.environ.items() if key not in hidden}
    environment |= {"BLENDER_USER_SCRIPTS": str(addons.parent), "BLENDER_USER_CONFIG": str(tmp_path / "config")}
    script = Path(__file__).with_name("session.py")
    # A Python with the package bpy runs the script itself.
    is_python = Path(blender).name.startswith("python")
    flags = [] if is_python else ["--background", "--factory-startup", "--python-exit-code", "1", "--python"]
    command = [blender, *flags, str(script), "--", str(tmp_path), str(program)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["encode"] == result["export"] == ["FINISHED"]
    ((name, bits, byte_count, psnr_db),) = result["rows"]
    assert name == "plaster"
    assert 1.0 < bits < 12.0
    assert byte_count == pytest.approx(bits * 64 * 64 / 8, abs=1)
    assert psnr_db > 25.0
    for name, error in result["errors"].items():
        # Red is in no map of the pack, alpha in none of the three.
        assert [own > 0.0 for own in error] == [name != "packed", True, True, False], (name, error)
        assert max(error) < 0.2
    assert result["originals"] == {name: name for name in result["errors"]}
    assert all(result["again"].values())
    assert result["colorspaces"] == {"color": "sRGB", "bumps": "Non-Color", "packed": "Non-Color"}
    assert result["reopened"] == ["bumps decoded", "color decoded", "packed decoded"]
    assert result["forgotten"] == ["bumps", "color", "packed"]
    assert "no-such-program" in result["missing"]
    assert result["groups"] == ["base: in the group", "metalness: before it", "roughness: before it"]
    assert {"color", "bumps"} <= {own.split(".")[0] for own in result["imported"]}
    scene = load_scene(tmp_path / "exported.glb")
    (pack,) = packs_of(scene)
    assert all(layer >= 0 for layer in match_scene(read_pack(pack), scene).texture_index)
