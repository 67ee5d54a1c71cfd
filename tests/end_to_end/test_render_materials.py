"""`ntc-viewer render` of whole materials: views, light, AOVs, and the error of each decoded map."""

import json
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest

from viewer import cli
from viewer.scene.images import read_image

SIZE = ["--size", "96x64"]
BALLS = ["--eye", "0", "1.2", "5", "--target", "0", "0.8", "0", *SIZE]


@pytest.fixture(scope="module")
def gallery_pack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built-in gallery with all maps, small."""
    path = tmp_path_factory.mktemp("gallery") / "gallery.ntc"
    arguments = ["encode", "gallery", "--out", str(path), "--grouping", "single", "--bits", "3", "--texture-size", "64"]
    assert cli.main(arguments) == 0
    return path


def rendered(out: Path, *arguments: str) -> dict:
    assert cli.main(["render", "gallery", "--out", str(out), *BALLS, *arguments]) == 0
    return json.loads((out / "stats.json").read_text())


def channels_of(path: Path) -> dict[str, np.ndarray]:
    """[H, W] float32 by channel of an EXR file."""
    image = OpenImageIO.ImageBuf(str(path))
    pixels = np.asarray(image.get_pixels("float"))
    return {name: pixels[..., place] for place, name in enumerate(image.spec().channelnames)}


@pytest.mark.parametrize("view", ["lit", "orm", "emissive"])
def test_every_view_has_its_picture_and_its_quality(gallery_pack: Path, tmp_path: Path, view: str) -> None:
    stats = rendered(tmp_path, "--pack", str(gallery_pack), "--grouping", "single", "--view", view)
    assert stats["view"] == view
    assert (stats["lighting"] is None) == (view != "lit")
    picture = read_image(tmp_path / "color.png")
    covered = np.load(tmp_path / "texture_id.npy") >= 0
    assert covered.any()
    if view == "lit":
        assert picture[~covered].any(), "the sky is behind"
    if view != "emissive":
        assert picture[covered].std() > 5.0
        assert 20.0 < stats["psnr_db"] < 80.0
    assert stats["skipped"]["planes_not_drawn"] == {"lit": 0, "orm": 1, "emissive": 2}[view]


def test_aovs_hold_the_maps(tmp_path: Path) -> None:
    rendered(tmp_path, "--grouping", "reference", "--view", "lit", "--aovs")
    found = channels_of(tmp_path / "aovs.exr")
    assert {"R", "G", "B", "A", "roughness", "metalness", "normal.X", "normal.Y", "normal.Z"} <= set(found)
    length = np.sqrt(found["normal.X"] ** 2 + found["normal.Y"] ** 2 + found["normal.Z"] ** 2)
    np.testing.assert_allclose(length, 1.0, atol=1e-5)
    assert (found["A"] > 0).sum() == json.loads((tmp_path / "stats.json").read_text())["pixels"]["covered"]


def test_the_error_of_each_map(gallery_pack: Path, tmp_path: Path) -> None:
    arguments = ("--pack", str(gallery_pack), "--grouping", "single", "--view", "lit", "--error-by-map")
    stats = rendered(tmp_path, *arguments)
    found = stats["error_by_map"]
    assert {"base", "normal", "roughness", "all"} <= set(found)
    assert found["all"]["psnr_db"] == pytest.approx(stats["psnr_db"], abs=0.01)
    assert found["all"]["mean_squared_error"] > max(
        found[name]["mean_squared_error"] for name in ("normal", "roughness")
    )
    for name, figures in found.items():
        picture = read_image(tmp_path / f"error.{name}.png")
        assert picture.any() == (figures["mean_squared_error"] > 0.0)
        assert figures["worst_texture"] or figures["psnr_db"] is None
