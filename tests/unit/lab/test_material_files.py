"""Lab benchmarks of whole materials: map files by their names, and the neural codec beside codec `block`."""

import json
from pathlib import Path

import numpy as np
import pytest

from lab.benchmarks import material_sets
from lab.benchmarks.material_sets import named_maps
from lab.benchmarks.neural_codec import SHAPES, NeuralShape, trained_image
from ntc import material
from ntc.codec.quality import psnr_db
from ntc.errors import InputError
from viewer.scene.images import write_png


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("Rails001_4K-JPG_Color.jpg", ("Rails001", ["base"])),
        ("Rails001_4K-JPG_NormalGL.jpg", ("Rails001", ["normal"])),
        ("Rails001_4K-JPG_NormalDX.jpg", None),
        ("roof_09_nor_gl_4k.png", ("roof_09", ["normal"])),
        ("roof_09_arm_4k.jpg", ("roof_09", ["occlusion", "roughness", "metalness"])),
        ("metal_plate_diff_4k.jpg", ("metal_plate", ["base"])),
        ("notes.png", None),
    ],
)
def test_maps_are_known_by_the_names_of_their_files(name: str, found: tuple[str, list[str]] | None) -> None:
    named = named_maps(Path(name))
    assert (None if named is None else (named[0], [str(own[0]) for own in named[1]])) == found


def test_a_folder_of_map_files_is_measured(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    random = np.random.default_rng(0)
    for word in ("Color", "NormalGL", "Roughness"):
        write_png(tmp_path / f"Rails001_1K-PNG_{word}.png", random.integers(90, 160, (32, 32, 3), dtype=np.uint8))
    out = tmp_path / "o.json"
    material_sets.main([str(tmp_path), "--bits", "8", "--json", str(out)])
    record = json.loads(out.read_text())
    assert list(record["rows"][0]["map_db"]) == ["base", "normal", "roughness"]
    assert record["mean_of_maps_db"] == pytest.approx(np.mean(list(record["rows"][0]["map_db"].values())))
    assert "mean of 3 maps" in capsys.readouterr().out
    with pytest.raises(InputError, match="none"):
        material_sets.main([str(tmp_path / "none")])


def test_the_neural_codec_learns_and_is_decoded_as_it_is_stored() -> None:
    assert [shape.grid_bits for shape in SHAPES] == [2.125, 4.25]
    y, x = np.mgrid[0:16, 0:16]
    base = np.stack([8 * x, 8 * y, 4 * (x + y)], axis=-1).astype(np.uint8)
    source = material({"base": base, "roughness": base[..., :1]})
    shape = NeuralShape(4, 4, 4, width=16)
    codec, image, curve = trained_image(source, shape, 120, 128, seed=0)
    assert curve[-1]["psnr_db"] == psnr_db(image, source.pixels) > curve[0]["psnr_db"]
    stored = codec.fine.detach().numpy() * 2**shape.bits + 2 ** (shape.bits - 1) - 0.5
    np.testing.assert_allclose(stored, np.rint(stored), atol=1e-5)
