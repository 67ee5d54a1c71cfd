"""`ntc-viewer render` from the command line to the files it writes."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from ntc.metrics.block_compression import INSTALL_HINT
from ntc.metrics.divergence import divergence_map
from viewer import cli
from viewer.scene.images import read_image

VIEW = ["--eye", "0", "0", "1.2", "--target", "0", "0", "0", "--fov", "60", "--size", "100x60"]


def rendered(scene: Path, out: Path, *arguments: str) -> dict:
    assert cli.main(["render", str(scene), "--out", str(out), *VIEW, *arguments]) == 0
    return json.loads((out / "stats.json").read_text())


@pytest.mark.parametrize("path", ["deferred", "forward", "binned"])
@pytest.mark.parametrize("grouping", ["single", "baseline"])
def test_files_and_statistics(encoded_scene: Path, tmp_path: Path, path: str, grouping: str) -> None:
    stats = rendered(encoded_scene, tmp_path, "--grouping", grouping, "--path", path, "--overlay", "divergence")
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


def test_the_stochastic_filter_gathers_samples(encoded_scene: Path, tmp_path: Path) -> None:
    exact = rendered(encoded_scene, tmp_path / "exact", "--grouping", "single")
    assert (exact["filter"], exact["samples"]) == ("exact", 1)
    stats = rendered(encoded_scene, tmp_path / "a", "--grouping", "single", "--filter", "stochastic")
    assert (stats["filter"], stats["samples"]) == ("stochastic", 16)
    assert abs(stats["psnr_db"] - exact["psnr_db"]) < 3.0
    rendered(encoded_scene, tmp_path / "b", "--grouping", "single", "--filter", "stochastic")
    assert (tmp_path / "a" / "color.png").read_bytes() == (tmp_path / "b" / "color.png").read_bytes()
    # Tiles are filtered by the hardware, whatever is asked for.
    tiles = rendered(
        encoded_scene, tmp_path / "c", "--grouping", "single", "--filter", "stochastic", "--path", "cached"
    )
    assert (tiles["filter"], tiles["samples"]) == ("exact", 1)


def test_the_reference_decodes_nothing(encoded_scene: Path, tmp_path: Path) -> None:
    stats = rendered(encoded_scene, tmp_path, "--grouping", "reference")
    assert stats["psnr_db"] is None
    assert stats["pixels"]["decoded"] == 0
    assert (np.load(tmp_path / "decoder_id.npy") == -1).all()
    assert not np.load(tmp_path / "divergence.npy").any()


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


def test_paths_agree(encoded_scene: Path, tmp_path: Path) -> None:
    pictures = {}
    for path in ("forward", "deferred"):
        rendered(encoded_scene, tmp_path / path, "--grouping", "baseline", "--path", path)
        pictures[path] = read_image(tmp_path / path / "color.png").astype(int)
    difference = np.abs(pictures["forward"] - pictures["deferred"]).max(axis=-1)
    assert (difference > 1).mean() <= 0.001


def test_half_precision_storage_is_close(encoded_scene: Path, tmp_path: Path) -> None:
    for precision in ("fp32", "fp16"):
        rendered(encoded_scene, tmp_path / precision, "--precision", precision)
    pictures = [read_image(tmp_path / precision / "color.png").astype(int) for precision in ("fp32", "fp16")]
    assert np.abs(pictures[0] - pictures[1]).max() <= 3


def test_error_overlay_is_black_for_the_reference(encoded_scene: Path, tmp_path: Path) -> None:
    rendered(encoded_scene, tmp_path, "--grouping", "reference", "--overlay", "error")
    assert not read_image(tmp_path / "overlay.png").any()


def test_cameras_file_and_name(encoded_scene: Path, tmp_path: Path) -> None:
    cameras = tmp_path / "cameras.json"
    cameras.write_text(json.dumps([{"name": "near", "eye": [0, 0, 2], "target": [0, 0, 0], "fov": 40}]))
    arguments = ["render", str(encoded_scene), "--out", str(tmp_path / "o"), "--size", "64x64"]
    assert cli.main([*arguments, "--cameras", str(cameras), "--camera", "near"]) == 0
    assert json.loads((tmp_path / "o" / "stats.json").read_text())["camera"] == "near"
