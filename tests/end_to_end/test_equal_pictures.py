"""A scene in which nothing needs decoding looks the same with and without a pack."""

import json
from pathlib import Path

import numpy as np

from lab.bench.random_pack import random_pack
from ntc.pack.file import write_pack
from tests.support.gltf_builder import GltfBuilder
from viewer import cli


def test_equal_pictures_give_valid_json(tmp_path: Path) -> None:
    builder = GltfBuilder()
    material = builder.material(pbr={"baseColorFactor": [0.5, 0.2, 0.1, 1.0]})
    scene = builder.drawn(builder.triangle(material)).write(tmp_path / "plain.glb")
    write_pack(tmp_path / "any.ntc", random_pack(((16, 16),), (0,)))
    arguments = [
        "render",
        str(scene),
        "--pack",
        str(tmp_path / "any.ntc"),
        "--size",
        "32x24",
        "--out",
        str(tmp_path / "o"),
    ]
    assert cli.main(arguments) == 0
    stats = json.loads((tmp_path / "o" / "stats.json").read_text(), parse_constant=lambda name: 1 / 0)
    assert stats["psnr_db"] is None
    assert stats["pixels"]["covered"] > 0
    assert np.load(tmp_path / "o" / "decoder_id.npy").max() == -1
