"""Whole materials through `encode`, `info` and `decode`, and what the window asks its training process for."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ntc.codec.maps import BASE_ALONE
from ntc.pack.file import read_pack
from tests.end_to_end.conftest import SQUARE, SQUARE_UVS
from tests.support.gltf_builder import GltfBuilder, png
from viewer import cli
from viewer.jobs.job import JobReport
from viewer.scene.images import read_image
from viewer.scene.load import load_scene
from viewer.state.pack_files import match_scene
from viewer.training.preparation import EncodeScene, RetrainGroups, prepare
from viewer.training.settings import TrainingSettings

WHOLE = ("base", "normal", "roughness", "metalness")


@pytest.fixture(scope="module")
def scene_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two squares: a whole material, and one of a base colour alone."""
    builder, primitives = GltfBuilder(), []
    y, x = np.mgrid[0:32, 0:32]
    waves = [np.sin(x * 0.3 * (number + 1) + y * 0.2) * 40.0 + 128.0 for number in range(3)]
    picture = np.stack(waves, axis=-1).astype(np.uint8)
    for number in range(2):
        image = builder.image(png(np.roll(picture, 5 * number, axis=0)), name=f"picture {number}")
        more: dict[str, Any] = {}
        if number == 0:
            tilted = np.stack([waves[2], waves[1], np.full((32, 32), 240.0)], axis=-1).astype(np.uint8)
            texture = builder.add("textures", source=builder.image(png(tilted), name="bumps"))
            more = {"normalTexture": {"index": texture}}
            orm = builder.add("textures", source=builder.image(png(picture[::-1]), name="packed"))
            base = builder.add("textures", source=image)
            pbr = {"baseColorTexture": {"index": base}, "metallicRoughnessTexture": {"index": orm}}
            material = builder.material(pbr=pbr, **more)
        else:
            material = builder.material(image)
        position = SQUARE + np.array([number - 1, -0.5, 0], np.float32)
        primitives.append(builder.triangle(material, POSITION=position, TEXCOORD_0=SQUARE_UVS))
    return builder.drawn(*primitives).write(tmp_path_factory.mktemp("scene") / "scene.glb")


def encode(scene: Path, out: Path, *options: str) -> int:
    return cli.main(["encode", str(scene), "--out", str(out), "--device", "cpu", *options])


@pytest.mark.parametrize("codec", [("--codec", "block", "--bits", "8"), ("--codec", "grid", "--steps", "30")])
def test_all_maps_are_encoded_shown_and_decoded(
    scene_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], codec: tuple[str, ...]
) -> None:
    out = tmp_path / "a.ntc"
    assert encode(scene_path, out, "--maps", "all", "--grouping", "baseline", *codec) == 0
    pack = read_pack(out)
    assert [texture.maps for texture in pack.textures] == [WHOLE, BASE_ALONE]
    assert (pack.config.maps, pack.config.output_channels) == (WHOLE, 7)
    assert match_scene(pack, load_scene(scene_path)).matched == 2
    assert cli.main(["info", str(out)]) == 0
    assert "roughness" in capsys.readouterr().out
    assert cli.main(["decode", str(out), "--out", str(tmp_path / "png")]) == 0
    first, second = (name.removesuffix(".png") for name in ("picture 0.png", "picture 1.png"))
    names = {path.name for path in (tmp_path / "png").iterdir()}
    assert names == {f"{first}.png", *(f"{first}.{name}.png" for name in WHOLE[1:]), f"{second}.png"}
    assert read_image(tmp_path / "png" / f"{first}.normal.png").shape == (32, 32, 3)


def test_the_window_encodes_whole_materials_and_goes_on_from_either_kind(scene_path: Path, tmp_path: Path) -> None:
    scene, settings = load_scene(scene_path), TrainingSettings("baseline")
    request = prepare(EncodeScene(settings), scene, None, JobReport())
    assert [texture.maps for texture in request.textures] == [WHOLE, BASE_ALONE]
    assert request.codec.maps == WHOLE
    universal = prepare(EncodeScene(TrainingSettings("universal")), scene, None, JobReport())
    assert universal.codec.maps == WHOLE
    for maps in ("base", "all"):
        out = tmp_path / f"{maps}.ntc"
        assert encode(scene_path, out, "--maps", maps, "--grouping", "baseline") == 0
        pack = read_pack(out)
        again = prepare(RetrainGroups(settings, frozenset({0})), scene, pack, JobReport())
        assert [texture.maps for texture in again.textures] == [texture.maps for texture in pack.textures]
