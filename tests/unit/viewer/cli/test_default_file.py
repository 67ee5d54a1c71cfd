"""The file that `encode` writes where none is named."""

from pathlib import Path

import pytest

from ntc.errors import InputError
from viewer.cli.encode import default_out
from viewer.cli.options import EncodeOptions


def test_a_pack_lies_beside_its_scene_and_replaces_none(tmp_path: Path) -> None:
    scene = tmp_path / "street.glb"
    scene.touch()
    assert default_out(EncodeOptions(scene)) == tmp_path / "street.clustered.ntc"
    (tmp_path / "street.clustered.ntc").touch()
    assert default_out(EncodeOptions(scene)).name == "street.clustered-2.ntc"
    images = tmp_path / "bricks"
    images.mkdir()
    assert default_out(EncodeOptions(images, grouping="single")) == tmp_path / "bricks.single.ntc"
    with pytest.raises(InputError, match="--out"):
        default_out(EncodeOptions(tmp_path / "images.txt"))
