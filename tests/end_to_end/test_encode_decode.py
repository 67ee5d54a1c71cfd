"""`encode`, `decode` and `info` on a small scene and on a folder of images."""

import json
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.grid.model import grid_parts
from ntc.pack.file import read_pack
from viewer import cli
from viewer.scene.images import write_png


def test_the_same_seed_gives_the_same_file(encoded_scene: Path, tmp_path: Path) -> None:
    contents = []
    for name in ("one", "two"):
        out = tmp_path / f"{name}.ntc"
        arguments = ["encode", str(encoded_scene), "--out", str(out), "--grouping", "single", "--steps", "20"]
        assert cli.main([*arguments, "--seed", "3", "--device", "cpu"]) == 0
        pack = read_pack(out)
        contents.append(
            [texture.latents.tobytes() for texture in grid_parts(pack).textures]
            + [grid_parts(pack).decoders[0].weights[1].tobytes()]
        )
    assert contents[0] == contents[1]


def test_covisible_looks_from_the_cameras_of_a_file(encoded_scene: Path, tmp_path: Path) -> None:
    views = tmp_path / "views.json"
    views.write_text(json.dumps([{"name": "front", "eye": [0.03, 0, 1.5], "target": [0.03, 0, 0], "fov": 60}]))
    out = tmp_path / "covisible.ntc"
    arguments = ["encode", str(encoded_scene), "--out", str(out), "--grouping", "covisible", "--clusters", "1"]
    assert cli.main([*arguments, "--views", str(views), "--steps", "5", "--device", "cpu"]) == 0
    grouping = read_pack(out).grouping
    assert grouping.name == "covisible"
    assert grouping.parameters["excess"] == 0.0
    assert grouping.parameters["baseline_excess"] > 0.0


def test_category_takes_the_labels_of_folders(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    random = np.random.default_rng(1)
    for number, category in enumerate(("brick", "wood", "wood")):
        write_png(tmp_path / "in" / category / f"{number}.png", random.integers(0, 256, (16, 16, 3), np.uint8))
    out = tmp_path / "category.ntc"
    arguments = ["encode", str(tmp_path / "in"), "--out", str(out), "--grouping", "category", "--steps", "5"]
    assert cli.main([*arguments, "--device", "cpu"]) == 0
    grouping = read_pack(out).grouping
    assert grouping.groups == (0, 1, 1)
    assert grouping.parameters["own"] == 3
    labels = tmp_path / "labels.csv"
    labels.write_text("texture,category\nbrick/0,stone\n1,stone\n")
    assert cli.main([*arguments, "--device", "cpu", "--labels", str(labels)]) == 0
    grouping = read_pack(out).grouping
    assert grouping.groups == (0, 0, 1)
    assert (grouping.parameters["listed"], grouping.parameters["own"]) == (2, 1)
    labels.write_text("texture,category\nbrick/9,stone\n")
    assert cli.main([*arguments, "--labels", str(labels)]) == 2
    assert "unknown textures: 'brick/9'" in capsys.readouterr().err
