"""`ntc-viewer render` from the command line to the files it writes."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc.metrics.block_compression import INSTALL_HINT
from ntc.metrics.divergence import divergence_map
from ntc.pack.file import read_pack, write_pack
from tests.drivers.messages import error_line
from tests.end_to_end.conftest import two_squares
from tests.support.gltf_builder import GltfBuilder
from viewer import cli
from viewer.gl.context_loss import LOSE_VARIABLE
from viewer.scene.images import read_image

VIEW = ["--eye", "0", "0", "1.2", "--target", "0", "0", "0", "--fov", "60", "--size", "100x60"]


def rendered(scene: Path, out: Path, *arguments: str) -> dict:
    assert cli.main(["render", str(scene), "--out", str(out), *VIEW, *arguments]) == 0
    return json.loads((out / "stats.json").read_text())


@pytest.mark.parametrize(
    ("path", "grouping", "overlay"),
    [("deferred", "single", "divergence"), ("forward", "baseline", "divergence"), ("binned", "baseline", "error")],
)
def test_files_and_statistics(encoded_scene: Path, tmp_path: Path, path: str, grouping: str, overlay: str) -> None:
    stats = rendered(encoded_scene, tmp_path, "--grouping", grouping, "--path", path, "--overlay", overlay)
    color = read_image(tmp_path / "color.png")
    assert color.shape == (60, 100, 3)
    assert read_image(tmp_path / "overlay.png").shape == (60, 100, 3)
    texture_ids, decoder_ids = (np.load(tmp_path / f"{name}_id.npy") for name in ("texture", "decoder"))
    assert texture_ids.dtype == decoder_ids.dtype == np.int32
    assert texture_ids.shape == (60, 100)
    assert set(np.unique(texture_ids)) == {-1, 0, 1}
    assert (color[texture_ids < 0] == 0).all()
    # The first texture is on the left square.
    assert np.nonzero(texture_ids == 0)[1].max() < np.nonzero(texture_ids == 1)[1].min()
    expected = np.where(texture_ids < 0, -1, texture_ids if grouping == "baseline" else 0)
    np.testing.assert_array_equal(decoder_ids, expected)
    divergence = np.load(tmp_path / "divergence.npy")
    np.testing.assert_array_equal(divergence, divergence_map(decoder_ids))
    assert divergence.shape == (8, 13)
    assert divergence.dtype == np.uint16
    assert stats["divergence"]["max"] == (2 if grouping == "baseline" else 1)
    assert stats["pixels"] == {"covered": int((texture_ids >= 0).sum()), "decoded": int((decoder_ids >= 0).sum())}
    assert stats["psnr_db"] > 20.0
    assert stats["size"] == [100, 60]
    assert f"decode_{path}" in stats["timings_ms"]
    assert stats["renderer"]
    assert "clusters_culled" in stats["skipped"]


@pytest.mark.parametrize(("block_format", "bits"), [("bc1", 4.0), ("bc7", 8.0), ("astc-8x8", 2.0)])
def test_formats_of_graphics_hardware(encoded_scene: Path, tmp_path: Path, block_format: str, bits: float) -> None:
    pytest.importorskip("quicktex")
    pytest.importorskip("astc_encoder")
    stats = rendered(encoded_scene, tmp_path, "--grouping", block_format)
    blocks = stats["block_compression"]
    assert (blocks["format"], blocks["textures"]) == (block_format, 2)
    # Mips smaller than a block take a whole one.
    assert 1.33 * bits <= blocks["bits_per_texel"] < 1.9 * bits
    assert blocks["psnr_db"]["mean_db"] > 20.0
    assert stats["psnr_db"] > 20.0
    assert (stats["path"], stats["precision"]) == (None, None)
    assert stats["pixels"]["decoded"] == 0
    assert block_format in stats["timings_ms"]
    reference = tmp_path / "reference"
    rendered(encoded_scene, reference, "--grouping", "reference")
    assert (read_image(tmp_path / "color.png") != read_image(reference / "color.png")).any()


def test_a_missing_encoder_is_one_line(
    encoded_scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "etcpak", None)
    monkeypatch.setenv("NTC_VIEWER_CACHE_DIR", str(tmp_path / "cache"))
    assert cli.main(["render", str(encoded_scene), "--out", str(tmp_path / "out"), "--grouping", "bc7"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: block compression: the packages are not installed")
    assert line.endswith(INSTALL_HINT)
    assert not (tmp_path / "out").exists()


def test_cameras_file_and_name(encoded_scene: Path, tmp_path: Path) -> None:
    cameras = tmp_path / "cameras.json"
    cameras.write_text(json.dumps([{"name": "near", "eye": [0, 0, 2], "target": [0, 0, 0], "fov": 40}]))
    arguments = ["render", str(encoded_scene), "--out", str(tmp_path / "o"), "--size", "64x64"]
    assert cli.main([*arguments, "--cameras", str(cameras), "--camera", "near"]) == 0
    assert json.loads((tmp_path / "o" / "stats.json").read_text())["camera"] == "near"


def test_an_image_that_does_not_decode_is_reported_and_replaced(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    builder = two_squares()
    view = builder.view(b"this is no image")
    builder.json["images"][0] = {"bufferView": view, "mimeType": "image/png", "name": "torn"}
    path = builder.write(tmp_path / "torn.glb")
    assert cli.main(["info", str(path), "--json"]) == 0
    information = json.loads(capsys.readouterr().out)
    assert any("torn" in line for line in information["missing"])
    assert len(information["textures"]) == 1


def test_a_pack_that_holds_a_part_is_used_and_noted(
    encoded_scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = read_pack(encoded_scene.with_name("scene.baseline.ntc"))
    hashes = [whole.textures[0].pixel_hash, "f" * 32]
    path = tmp_path / "part.ntc"
    write_pack(path, random_pack(((32, 32), (32, 32)), (0, 1), hashes=hashes))
    stats = rendered(encoded_scene, tmp_path / "o", "--pack", str(path))
    assert "1 of 2 textures match" in capsys.readouterr().err
    assert 0 < stats["pixels"]["decoded"] < stats["pixels"]["covered"]


def test_a_scene_without_textures_has_no_psnr(tmp_path: Path) -> None:
    builder = GltfBuilder()
    material = builder.material(pbr={"baseColorFactor": [0.5, 0.2, 0.1, 1.0]})
    scene = builder.drawn(builder.triangle(material)).write(tmp_path / "plain.glb")
    write_pack(tmp_path / "any.ntc", random_pack(((16, 16),), (0,)))
    out = tmp_path / "o"
    assert (
        cli.main(["render", str(scene), "--pack", str(tmp_path / "any.ntc"), "--size", "32x24", "--out", str(out)]) == 0
    )
    stats = json.loads((out / "stats.json").read_text(), parse_constant=lambda name: 1 / 0)
    assert stats["psnr_db"] is None
    assert stats["pixels"]["covered"] > 0
    assert np.load(out / "decoder_id.npy").max() == -1


def test_a_context_that_is_lost_after_all_is_read_back_loses_nothing(
    encoded_scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(LOSE_VARIABLE, "8")
    assert rendered(encoded_scene, tmp_path)["renderer"]


def test_view_headless_keeps_the_pictures_before_a_context_is_lost(
    encoded_scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(LOSE_VARIABLE, "400")
    lines = "wait settled; screenshot a.png; wait frames 600; screenshot b.png"
    command = ["view", str(encoded_scene), "--headless", "--out", str(tmp_path / "out"), "--exec", lines]
    assert cli.main(command) == 2
    assert "the graphics driver was reset" in error_line(capsys.readouterr().err)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["a.png"]
