"""Real scenes in a window of 1280x720, with packs of 4 bits beside them: what rests is what the command `render` writes."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.support.rest.detailed_scenes import encode
from tests.support.rest.records import Rest, share_equal
from tests.support.rest.truth import BESIDE_DIVIDER, LEAST_SHARE
from tests.ui.rest.conftest import Check, Start
from viewer import cli
from viewer.scene.images import read_image

pytestmark = [pytest.mark.process, pytest.mark.slow, pytest.mark.nightly]

SIZE = (1280, 720)
SCENES = {"dutch_ship": "dutch_ship/dutch_ship_medium_1k.gltf", "portal": "portal/portal.glb"}


def with_pack(data_folder: Path, name: str, folder: Path) -> Path:
    """The scene in a copy of its folder, with a pack beside it."""
    source = data_folder / "scenes" / SCENES[name]
    if not source.is_file():
        pytest.skip(f"no {source}")
    copy = folder / "copy"
    for file in source.parent.rglob("*"):
        if file.is_file():
            target = copy / file.relative_to(source.parent)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, target)
    scene = copy / source.name
    encode(scene, scene.with_suffix(".clustered.ntc"), "--texture-size", "512", "--grouping", "clustered")
    return scene


@pytest.mark.parametrize("name", SCENES)
def test_a_real_scene(start: Start, check: Check, data_folder: Path, tmp_path: Path, name: str) -> None:
    scene = with_pack(data_folder, name, tmp_path)
    rest = start(str(scene), size=SIZE).of("start")
    assert (rest.view.slot_a.source, rest.view.slot_a.path, rest.view.compare) == ("clustered", "deferred", "wipe")
    assert rest.view.size == SIZE
    shown, rendered = rest.image, by_command(scene, rest, tmp_path / "rendered")
    left = round(rest.view.wipe_position * SIZE[0]) - BESIDE_DIVIDER
    share = share_equal(shown[:, :left], rendered[:, :left])
    stats = json.loads((tmp_path / "rendered" / "stats.json").read_text())
    told = f"{name}: {100 * share:.2f} % of slot A's pixels are those of `render`, which has {stats['psnr_db']:.2f} dB"
    check(rest)
    assert share >= LEAST_SHARE, told


def by_command(scene: Path, rest: Rest, out: Path) -> np.ndarray:
    """[H, W, 3] uint8: what `ntc-viewer render` writes of slot A with the window's camera."""
    camera, view = rest.view.camera, rest.view
    numbers = {"--eye": camera.eye, "--target": camera.target, "--fov": (camera.fov_degrees,)}
    where = [text for option, values in numbers.items() for text in (option, *map(repr, values))]
    how = ["--size", f"{SIZE[0]}x{SIZE[1]}", "--view", view.material_view, "--grouping", view.slot_a.source]
    assert cli.main(["render", str(scene), "--out", str(out), *how, *where]) == 0
    return read_image(out / "color.png")
