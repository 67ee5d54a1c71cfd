"""`encode`, `decode` and `info` on a small scene and on a folder of images."""

import json
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.grid.model import grid_parts
from ntc.pack.file import read_pack
from viewer import cli
from viewer.scene.images import read_image, write_png


def test_backends_decode_alike(encoded_scene: Path, tmp_path: Path) -> None:
    pack = encoded_scene.with_name("scene.baseline.ntc")
    images = {}
    for backend in ("numpy", "torch", "gl"):
        assert cli.main(["decode", str(pack), "--out", str(tmp_path / backend), "--backend", backend]) == 0
        files = sorted(path.name for path in (tmp_path / backend).iterdir())
        assert files == ["picture 0.png", "picture 1.png"]
        images[backend] = np.stack([read_image(tmp_path / backend / name) for name in files]).astype(int)
    assert np.abs(images["numpy"] - images["torch"]).max() <= 1
    assert np.abs(images["numpy"] - images["gl"]).max() <= 1


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


def test_a_folder_of_images_with_categories(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    random = np.random.default_rng(0)
    for category in ("brick", "wood"):
        for number in range(2):
            write_png(tmp_path / "in" / category / f"{number}.png", random.integers(0, 256, (24, 40, 3), np.uint8))
    out = tmp_path / "folder.ntc"
    arguments = ["encode", str(tmp_path / "in"), "--out", str(out), "--grouping", "clustered", "--clusters", "2"]
    assert cli.main([*arguments, "--steps", "15", "--device", "cpu", "--texture-size", "16"]) == 0
    printed = capsys.readouterr()
    assert "PSNR: mean" in printed.out
    assert "per texel of mip 0" in printed.out
    pack = read_pack(out)
    assert {texture.category for texture in pack.textures} == {"brick", "wood"}
    assert {(texture.width, texture.height) for texture in pack.textures} == {(16, 10)}
    assert len(pack.decoders) == 2
    assert cli.main(["info", str(out), "--json"]) == 0
    information = json.loads(capsys.readouterr().out)
    assert information["grouping"] == "clustered"
    assert len(information["textures"]) == 4


def test_paper_recipe_with_epochs(encoded_scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "paper.ntc"
    arguments = ["encode", str(encoded_scene), "--out", str(out), "--grouping", "baseline", "--recipe", "paper"]
    assert cli.main([*arguments, "--epochs", "40", "--levels", "1", "--device", "cpu"]) == 0
    pack = read_pack(out)
    assert pack.config.levels == 1
    assert grid_parts(pack).config.decoder_inputs == 16
    assert pack.training["recipe"] == "paper"


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
