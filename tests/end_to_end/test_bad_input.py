"""Bad input gives one clear line, exit status 2, and leaves nothing half-written."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc.codec.grid.model import grid_parts
from ntc.pack.file import read_pack, write_pack
from tests.drivers.messages import error_line
from tests.end_to_end.conftest import two_squares
from tests.support.gltf_builder import GltfBuilder
from viewer import cli

Maker = Callable[[Path], Path]


def missing(folder: Path) -> Path:
    return folder / "nowhere.glb"


def not_json(folder: Path) -> Path:
    path = folder / "wrong.gltf"
    path.write_text('{"asset": {"version": "2.0"}, "nodes": [')
    return path


def truncated(folder: Path) -> Path:
    path = folder / "truncated.glb"
    path.write_bytes(two_squares().glb()[:-700])
    return path


def accessor_out_of_range(folder: Path) -> Path:
    builder = two_squares()
    builder.json["accessors"][0]["count"] = 10**9
    return builder.write(folder / "accessor.glb")


def unsupported_extension(folder: Path) -> Path:
    builder: GltfBuilder = two_squares()
    builder.json["extensionsRequired"] = builder.json["extensionsUsed"] = ["VENDOR_unheard_of"]
    return builder.write(folder / "extension.glb")


def empty_file(folder: Path) -> Path:
    path = folder / "empty.glb"
    path.write_bytes(b"")
    return path


def one_line(capsys: pytest.CaptureFixture[str], *words: str) -> None:
    line = error_line(capsys.readouterr().err)
    assert all(word in line for word in words), line


@pytest.mark.parametrize("command", ["render", "info", "encode"])
@pytest.mark.parametrize(
    "maker",
    [missing, not_json, truncated, accessor_out_of_range, unsupported_extension, empty_file],
    ids=lambda m: m.__name__,
)
def test_bad_scenes(maker: Maker, command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = maker(tmp_path)
    out = {"render": tmp_path / "o", "encode": tmp_path / "o.ntc", "info": None}[command]
    arguments = [command, str(path)] + ([] if out is None else ["--out", str(out)])
    assert cli.main(arguments) == 2
    one_line(capsys, path.name)
    assert out is None or not out.exists()


def test_the_extension_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["info", str(unsupported_extension(tmp_path))]) == 2
    one_line(capsys, "VENDOR_unheard_of")


def test_an_image_that_does_not_decode_is_reported_and_replaced(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    builder = two_squares()
    builder.json["images"][0] = {
        "bufferView": builder.view(b"this is no image"),
        "mimeType": "image/png",
        "name": "torn",
    }
    path = builder.write(tmp_path / "torn.glb")
    assert cli.main(["info", str(path), "--json"]) == 0
    information = json.loads(capsys.readouterr().out)
    assert any("torn" in line for line in information["missing"])
    assert len(information["textures"]) == 1


def packs(folder: Path, good: Path) -> dict[str, Path]:
    content = good.read_bytes()
    bad = {
        "empty": b"",
        "truncated": content[:-100],
        "header": content[:20],
        "text": b"not a pack at all, only words" * 3,
    }
    paths = {name: folder / f"{name}.ntc" for name in bad}
    for name, data in bad.items():
        paths[name].write_bytes(data)
    pack = random_pack(((32, 32),), (0,))
    grid_parts(pack).decoders[0].weights[1][3, 3] = np.nan
    paths["nan"] = folder / "nan.ntc"
    write_pack(paths["nan"], pack)
    return paths


@pytest.mark.parametrize("kind", ["empty", "truncated", "header", "nan", "text"])
def test_bad_packs(kind: str, encoded_scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = packs(tmp_path, encoded_scene.with_name("scene.single.ntc"))[kind]
    out = tmp_path / "o"
    for arguments in (
        ["render", str(encoded_scene), "--pack", str(path), "--out", str(out)],
        ["decode", str(path), "--out", str(out)],
        ["info", str(path)],
    ):
        capsys.readouterr()
        assert cli.main(arguments) == 2
        one_line(capsys, path.name)
        assert not out.exists()


def test_a_pack_of_another_scene_says_what_matches(
    encoded_scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = two_squares(seed=99).write(tmp_path / "other.glb")
    pack = encoded_scene.with_name("scene.single.ntc")
    capsys.readouterr()
    assert cli.main(["render", str(other), "--pack", str(pack), "--out", str(tmp_path / "o")]) == 2
    one_line(capsys, "0 of 2 textures match", "same name but other pixels", "picture 0")
    assert not (tmp_path / "o").exists()


def test_a_pack_that_holds_a_part_is_used_and_noted(
    encoded_scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = read_pack(encoded_scene.with_name("scene.baseline.ntc"))
    hashes = [whole.textures[0].pixel_hash, "f" * 32]
    path = tmp_path / "part.ntc"
    write_pack(path, random_pack(((32, 32), (32, 32)), (0, 1), hashes=hashes))
    arguments = ["render", str(encoded_scene), "--pack", str(path), "--size", "48x32", "--out", str(tmp_path / "o")]
    assert cli.main(arguments) == 0
    assert "1 of 2 textures match" in capsys.readouterr().err
    stats = json.loads((tmp_path / "o" / "stats.json").read_text())
    assert 0 < stats["pixels"]["decoded"] < stats["pixels"]["covered"]


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--camera", "nowhere"], "nowhere"),
        (["--grouping", "clustered"], "clustered"),
        (["--eye", "0", "0", "1"], "--target"),
        (["--size", "0x10"], "0x10"),
        (["--fov", "400", "--eye", "0", "0", "1", "--target", "0", "0", "0"], "fov"),
        (["--require-gpu"], "llvmpipe"),
    ],
)
def test_bad_arguments(
    arguments: list[str], word: str, encoded_scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if "--require-gpu" in arguments:
        from viewer.gl.context import create_headless_context

        if not create_headless_context().info.is_software:
            pytest.skip("this renderer is a GPU")
    capsys.readouterr()
    assert cli.main(["render", str(encoded_scene), "--out", str(tmp_path / "o"), *arguments]) == 2
    one_line(capsys, word)
    assert not (tmp_path / "o").exists()


def test_an_output_that_cannot_be_written(
    encoded_scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.write_text("here already")
    assert cli.main(["render", str(encoded_scene), "--out", str(file)]) == 2
    one_line(capsys, "file")
    assert file.read_text() == "here already"
