"""Every exporter, given damaged scenes and packs: it writes all of an export or nothing, and tells what is wrong in a line."""

from pathlib import Path

import numpy as np
import pytest

from tests.drivers.messages import error_line
from tests.end_to_end.export.material_scene import materials_scene
from viewer import cli

EXPORTERS = {
    "glTF": ["--out", "{out}/scene.glb"],
    "fallback jpeg": ["--out", "{out}/scene.gltf", "--fallback", "jpeg"],
    "as png": ["--out", "{out}/scene.gltf", "--as", "png"],
    "page": ["--web", "{out}/page"],
    "shader": ["--shader", "wgsl", "--out", "{out}/decoder"],
}
ROUNDS = 3
"""Spoilt scenes, and as many packs, for each exporter."""

pytestmark = pytest.mark.guards("exports")


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, bytes]:
    """A scene (.glb) and a pack of it."""
    folder = tmp_path_factory.mktemp("good")
    scene = materials_scene().write(folder / "scene.glb")
    pack = folder / "scene.baseline.ntc"
    assert cli.main(["encode", str(scene), "--out", str(pack), "--grouping", "baseline", "--bits", "8"]) == 0
    return scene.read_bytes(), pack.read_bytes()


def spoilt(data: bytes, random: np.random.Generator) -> bytes:
    """`data` cut short, with bytes changed in its header, or with a run of it in another place."""
    changed = bytearray(data)
    match random.integers(0, 3):
        case 0:
            return data[: random.integers(0, len(data))]
        case 1:
            for place in random.integers(0, min(len(data), 3000), random.integers(1, 6)):
                changed[place] = random.integers(0, 256)
        case _:
            start, target = random.integers(0, len(data), 2)
            run = data[start : start + 40]
            changed[target : target + len(run)] = run
    return bytes(changed)


@pytest.mark.parametrize("exporter", list(EXPORTERS))
def test_damaged_files_are_told_in_a_line(
    good: tuple[bytes, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str], exporter: str
) -> None:
    random = np.random.default_rng(11)
    refused = 0
    for number in range(2 * ROUNDS):
        folder, out = tmp_path / f"in{number}", tmp_path / f"out{number}"
        folder.mkdir()
        out.mkdir()
        scene, pack = folder / "scene.glb", folder / "scene.baseline.ntc"
        scene.write_bytes(good[0] if number % 2 else spoilt(good[0], random))
        pack.write_bytes(spoilt(good[1], random) if number % 2 else good[1])
        options = [option.format(out=out) for option in EXPORTERS[exporter]]
        status = cli.main(["export", str(scene), "--pack", str(pack), *options])
        error = capsys.readouterr().err
        assert status in (0, 2), error
        if status == 2:
            assert error_line(error)
            assert list(out.iterdir()) == [], error
            refused += 1
    assert refused >= 2
