"""`ntc-viewer export`: a scene with its pack is written, read back and drawn the same; other programs show its images."""

import contextlib
import csv
import json
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc.codec.grid.model import GridConfig
from ntc.codec.maps import map_slices
from ntc.codec.mips import to_8bit, to_linear
from ntc.codec.quality import psnr_db
from ntc.codec.reference import decode_image
from ntc.errors import InputError
from ntc.pack.file import read_pack
from tests.end_to_end.export.material_scene import materials_scene
from tests.support.meshopt_twins import meshopt_twin
from viewer import cli
from viewer.export.gltf import export as gltf_writing
from viewer.export.gltf.document import GltfDocument, read_document
from viewer.export.gltf.export import write_gltf
from viewer.export.gltf.options import PackedTextureOption
from viewer.export.textures import DecodedImage, level_decoder
from viewer.scene.gltf.buffers import Buffers
from viewer.scene.images import read_image
from viewer.scene.load import load_scene, open_container
from viewer.scene.report import report_lines
from viewer.state.pack_files import match_scene, packs_of

FALLBACKS = ("original", "jpeg", "ktx2", "none")


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """scene.glb, with scene.baseline.ntc beside it."""
    path = materials_scene().write(tmp_path_factory.mktemp("scene") / "scene.glb")
    pack = path.with_name("scene.baseline.ntc")
    assert cli.main(["encode", str(path), "--out", str(pack), "--grouping", "baseline", "--bits", "8"]) == 0
    return path


def export(scene: Path, out: Path, *options: str) -> int:
    return cli.main(
        ["export", str(scene), "--pack", str(scene.with_name("scene.baseline.ntc")), "--out", str(out), *options]
    )


@pytest.mark.parametrize("fallback", FALLBACKS)
@pytest.mark.parametrize("suffix", [".gltf", ".glb"])
def test_what_is_exported_decodes_to_the_same_texels(scene: Path, tmp_path: Path, suffix: str, fallback: str) -> None:
    out = tmp_path / f"other{suffix}"
    assert export(scene, out, "--fallback", fallback) == 0
    before, after = load_scene(scene), load_scene(out)
    (path,) = packs_of(after)
    assert path == out.with_name("other.baseline.ntc")
    pack = read_pack(path)
    assert not after.report.missing
    assert [texture.maps for texture in after.textures] == [texture.maps for texture in before.textures]
    assert match_scene(pack, after).texture_index == match_scene(pack, before).texture_index
    assert all(texture.packed_hash for texture in after.textures)
    if fallback == "none":
        # The last one's coverage is in its image alone.
        layer = match_scene(pack, after).texture_index[0]
        assert np.array_equal(after.textures[0].pixels, decode_image(pack, layer, 0)[..., :3])
        assert np.array_equal(after.textures[2].pixels, before.textures[2].pixels)


def test_the_picture_is_the_same(scene: Path, tmp_path: Path) -> None:
    def picture(path: Path, *options: str) -> np.ndarray:
        out = tmp_path / f"picture of {path.stem}"
        given = ["--grouping", "baseline", "--view", "lit", "--size", "160x120", *options]
        assert cli.main(["render", str(path), "--out", str(out), *given]) == 0
        return read_image(out / "color.png")

    expected = picture(scene)
    for fallback in FALLBACKS:
        out = tmp_path / f"{fallback}.glb"
        assert export(scene, out, "--fallback", fallback) == 0
        assert np.array_equal(picture(out), expected), fallback


def test_layers_and_channels_are_where_the_extension_says(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "other.gltf"
    assert export(scene, out) == 0
    content = json.loads(out.read_text())
    assert content["extensionsUsed"] == ["NV_texture_swizzle"]
    assert "extensionsRequired" not in content
    pack = read_pack(out.with_name("other.baseline.ntc"))
    images, textures = content["images"], content["textures"]
    for number, expected in ((0, [0, 1, 2, -1]), (1, [7, 5, 6, -1]), (2, [3, 4, -1, -1])):
        (option,) = textures[number]["extensions"]["NV_texture_swizzle"]["options"]
        assert images[option["source"]] == {
            "uri": "other.baseline.ntc",
            "mimeType": "image/vnd.ntc-viewer.pack",
            "name": "baseline",
        }
        texture = pack.textures[option["arrayLayer"]]
        assert texture.pixel_hash == option["extras"]["pixelHash"]
        if texture.maps == ("base", "normal", "roughness", "metalness", "occlusion"):
            assert option["channels"] == expected


def test_a_scene_without_images_is_not_opened_where_the_extension_is_unknown(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "other.gltf"
    assert export(scene, out, "--fallback", "none") == 0
    content = json.loads(out.read_text())
    assert content["extensionsRequired"] == ["NV_texture_swizzle"]
    # What has coverage keeps its image.
    assert [image.get("uri", "").endswith(".ntc") for image in content["images"]] == [False, True]


def test_compressed_geometry_passes_through(scene: Path, tmp_path: Path) -> None:
    twin = tmp_path / "twin.glb"
    twin.write_bytes(meshopt_twin(scene.read_bytes()))
    for name in ("a.gltf", "b.glb"):
        out = tmp_path / name
        pack = str(scene.with_name("scene.baseline.ntc"))
        assert cli.main(["export", str(twin), "--pack", pack, "--out", str(out), "--fallback", "jpeg"]) == 0
        before, after = load_scene(twin).geometry, load_scene(out).geometry
        assert np.array_equal(before.positions, after.positions)
        assert np.array_equal(before.indices, after.indices)


@pytest.mark.parametrize("fallback", FALLBACKS)
def test_an_export_is_exported_again(scene: Path, tmp_path: Path, fallback: str) -> None:
    first, second = tmp_path / "first.gltf", tmp_path / "second.glb"
    assert export(scene, first, "--fallback", fallback) == 0
    again = ["export", str(first), "--pack", str(scene.with_name("scene.baseline.ntc")), "--out", str(second)]
    assert cli.main(again) == 0
    after = load_scene(second)
    assert not after.report.missing
    assert packs_of(after) == (second.with_name("second.baseline.ntc"),)
    assert match_scene(read_pack(second.with_name("second.baseline.ntc")), after).matched == 3


@pytest.mark.parametrize("suffix", [".gltf", ".glb"])
def test_nothing_stays_of_an_export_that_fails_midway(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    def fail(_document: GltfDocument) -> bytes:
        raise InputError("full")

    monkeypatch.setattr(gltf_writing, "_json_bytes", fail)
    assert export(scene, tmp_path / f"other{suffix}") == 2
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("error", [OSError("full"), KeyboardInterrupt()])
def test_an_earlier_export_stays_where_the_next_one_fails(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    out = tmp_path / "other.gltf"
    assert export(scene, out, "--fallback", "jpeg") == 0
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    def fail(_self: Path, _target: Path) -> Path:
        raise error

    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", fail)
        with contextlib.suppress(InputError, KeyboardInterrupt):
            file = open_container(scene)
            write_gltf(out, read_document(file, Buffers(file)))
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
    assert not load_scene(out).report.missing


def spoil_uri(content: dict[str, Any]) -> None:
    content["images"][-1]["uri"] = "../elsewhere.ntc"


def spoil_data(content: dict[str, Any]) -> None:
    content["images"][-1]["uri"] = "data:;base64,AAAA"


def spoil_absent(content: dict[str, Any]) -> None:
    content["images"][-1]["uri"] = "gone.ntc"


@pytest.mark.parametrize("spoil", [spoil_uri, spoil_data, spoil_absent])
@pytest.mark.parametrize("fallback", ["original", "none"])
def test_packs_that_are_not_to_be_had_are_told(
    scene: Path, tmp_path: Path, spoil: Callable[[dict[str, Any]], None], fallback: str
) -> None:
    out = tmp_path / "other.gltf"
    assert export(scene, out, "--fallback", fallback) == 0
    content = json.loads(out.read_text())
    spoil(content)
    out.write_text(json.dumps(content))
    read = load_scene(out)
    assert not read.packs
    assert any("images[" in line for line in read.report.missing)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("source", 99),
        ("source", None),
        ("arrayLayer", -1),
        ("arrayLayer", 1e9),
        ("channels", [0, 1, 2]),
        ("channels", "rgba"),
        ("channels", [0, 1, 2, -2]),
    ],
)
def test_broken_options_are_refused_by_name(scene: Path, tmp_path: Path, field: str, value: object) -> None:
    out = tmp_path / "other.gltf"
    assert export(scene, out) == 0
    content = json.loads(out.read_text())
    content["textures"][0]["extensions"]["NV_texture_swizzle"]["options"][0][field] = value
    out.write_text(json.dumps(content))
    with pytest.raises(InputError, match=f"NV_texture_swizzle.*{field}"):
        load_scene(out)


def test_options_of_others_are_named(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "other.gltf"
    assert export(scene, out) == 0
    content = json.loads(out.read_text())
    content["images"][-1] = {"uri": "material.ntc", "mimeType": "image/vnd-nvidia.ntc"}
    out.write_text(json.dumps(content))
    read = load_scene(out)
    assert any("NVIDIA" in line for line in read.report.ignored)
    assert read.packs == ()
    assert any("NVIDIA" in line for line in report_lines(read))


def stored_images(path: Path) -> dict[str, np.ndarray]:
    """By name: the pixels of the image files of an exported .gltf."""
    folder = path.with_name(f"{path.stem}.files")
    return {file.stem: read_image(file) for file in folder.iterdir() if file.suffix != ".bin"}


@pytest.mark.parametrize(
    ("image_format", "least_db"), [("png", math.inf), ("ktx2", 32.9), ("bc7", 33.0), ("bc1", 28.0), ("astc", 28.0)]
)
def test_decoded_images_are_stored_with_their_losses(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], image_format: str, least_db: float
) -> None:
    if image_format == "ktx2":
        pytest.importorskip("alktx2")
    out = tmp_path / "other.gltf"
    assert export(scene, out, "--as", image_format) == 0
    assert "PSNR of the mean square error" in capsys.readouterr().out
    pack = read_pack(scene.with_name("scene.baseline.ntc"))
    before, after = load_scene(scene), load_scene(out)
    assert not after.report.missing
    assert [texture.maps for texture in after.textures] == [texture.maps for texture in before.textures]
    assert not after.packs
    layers = match_scene(pack, before).texture_index
    for texture, original, layer in zip(after.textures, before.textures, layers, strict=True):
        decoded = decode_image(pack, layer, 0)
        assert psnr_db(texture.pixels, decoded[..., :3]) >= least_db
        for name, place in map_slices(pack.textures[layer].maps, decoded.shape[2]).items():
            if name == "alpha":
                assert texture.alpha is not None
                assert psnr_db(texture.alpha[..., None], decoded[..., place]) >= min(least_db, 50.0)
            elif name != "base":
                assert psnr_db(texture.further_maps[name], decoded[..., place]) >= min(least_db, 50.0)
        assert texture.has_alpha == original.has_alpha
    rows = list(csv.DictReader((tmp_path / "other.losses.csv").read_text().splitlines()))
    assert [row["name"] for row in rows] == ["base 0", "bumps", "orm", "base 1", "base 2"]
    assert all(float(row["both_db"]) <= float(row["decoded_db"]) + 1.5 for row in rows)
    assert all(float(row["stored_db"]) >= least_db for row in rows), "the format's own loss is that of decoded texels"


def test_a_pack_of_one_level_is_stored_with_all_mips() -> None:
    pack = random_pack(((32, 16),), (0,), config=GridConfig(levels=1))
    option = PackedTextureOption(0, 0, [0, 1, 2, -1], [(0, "base")])
    image = DecodedImage(pack, option, lambda: None)
    mips = image.mips(level_decoder(pack), None, all_levels=True)
    assert [mip.shape[1::-1] for mip in mips] == [(32, 16), (16, 8), (8, 4), (4, 2), (2, 1), (1, 1)]
    np.testing.assert_array_equal(mips[0], decode_image(pack, 0, 0)[..., :3])
    mean = to_8bit(to_linear(mips[0], "srgb").mean((0, 1), keepdims=True), "srgb")
    assert np.abs(mips[-1].astype(int) - mean).max() <= 1


def test_an_export_of_a_scene_without_images_has_them_again(scene: Path, tmp_path: Path) -> None:
    bare, out = tmp_path / "bare.gltf", tmp_path / "whole.gltf"
    assert export(scene, bare, "--fallback", "none") == 0
    pack = str(scene.with_name("scene.baseline.ntc"))
    assert cli.main(["export", str(bare), "--pack", pack, "--out", str(out), "--as", "png"]) == 0
    assert np.array_equal(load_scene(out).textures[0].pixels, load_scene(bare).textures[0].pixels)
    assert set(stored_images(out)) >= {"bumps"} or len(stored_images(out)) == 5


def test_nothing_stays_of_images_that_cannot_be_stored(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "alktx2", None)
    assert export(scene, tmp_path / "other.gltf", "--as", "ktx2") == 2
    assert "pip install" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
