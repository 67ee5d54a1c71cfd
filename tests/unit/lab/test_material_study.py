"""Study of materials: what counts as bits and quality, and the whole study end to end."""

import json
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from lab.commands.study_materials import ALONE, ASTC, BC, SEEN, TOGETHER, at_bits, bits_to_reach, comparisons
from lab.studies.materials.coding import CodedMaps, Coding, MaterialPoint, joined, part_of
from lab.studies.materials.hardware import decoded_part
from ntc.codec.maps import MapName
from ntc.codec.textures import SourceTexture, hash_pixels
from tests.end_to_end.conftest import SQUARE, SQUARE_UVS
from tests.support.gltf_builder import GltfBuilder, png
from viewer import cli

MAPS: tuple[MapName, ...] = ("base", "normal", "roughness", "metalness")
NEEDS_ENCODERS = pytest.mark.skipif(
    any(find_spec(name) is None for name in ("astc_encoder", "etcpak", "quicktex")), reason="needs the extra lab"
)


def material(side: int = 32) -> SourceTexture:
    """A material of waves."""
    y, x = np.mgrid[0:side, 0:side]
    waves = [np.sin(x * 0.2 * (number % 3 + 1) + y * 0.15) * 40.0 + 128.0 for number in range(7)]
    pixels = np.stack(waves, axis=-1).astype(np.uint8)
    return SourceTexture("waves", pixels, hash_pixels(pixels), maps=MAPS)


def point(curve: str, bits: float, mean_db: float, degrees: float) -> MaterialPoint:
    return MaterialPoint(curve, "", bits, mean_db, None, None, None, None, degrees, None)


def test_parts_joined_again_are_the_whole() -> None:
    source = material()
    decoded = source.pixels ^ np.uint8(3)
    whole = CodedMaps.of(MAPS, decoded, source.pixels)
    codings = []
    for names in (("base",), ("normal",), ("roughness", "metalness")):
        own, other = (part_of(replace(source, pixels=pixels), names) for pixels in (source.pixels, decoded))
        assert own is not None
        assert other is not None
        codings.append(Coding((CodedMaps.of(own.maps, other.pixels, own.pixels),), 10.0))
    again = joined(codings)
    assert again.stored_bits == 30.0
    assert again.materials == (whole,)
    assert part_of(source, ("emissive",)) is None
    found = MaterialPoint.of("x", "y", again, [source])
    assert found.emissive_db is None
    assert found.mean_db == pytest.approx(whole.psnr_db())
    assert found.degrees == whole.degrees[0]  # type: ignore[index]


def test_curves_are_compared_at_equal_bits() -> None:
    points = [
        point(TOGETHER, 2.0, 30.0, 2.0), point(TOGETHER, 4.0, 34.0, 1.0),
        point(SEEN, 2.0, 29.0, 1.5), point(SEEN, 4.0, 33.0, 0.5),
        point(ASTC, 8.0**0.5, 31.0, 3.0), point(ALONE, 9.0, 40.0, 1.0), point(BC, 24.0, 33.0, 1.0),
    ]  # fmt: skip
    assert at_bits(points, TOGETHER, "mean_db", 8.0**0.5) == pytest.approx(32.0)
    assert at_bits(points, TOGETHER, "mean_db", 9.0) is None
    assert bits_to_reach(points, TOGETHER, 32.0) == pytest.approx(8.0**0.5)
    assert bits_to_reach(points, TOGETHER, 50.0) is None
    first, second = comparisons(points)
    assert (first["curve"], first["beside"], first["more_db"]) == (TOGETHER, ASTC, pytest.approx(1.0))
    assert second["angle_ratio"] == pytest.approx(1.0 / 3.0)


@NEEDS_ENCODERS
@pytest.mark.parametrize("block_format", ["bc7", "astc-4x4", "astc-10x8"])
@pytest.mark.parametrize("names", [("base",), ("normal",), ("roughness", "metalness")])
def test_hardware_formats_keep_each_map_in_its_place(block_format: str, names: tuple[MapName, ...]) -> None:
    own = part_of(material(30), names)
    assert own is not None
    decoded = decoded_part(own, block_format)  # type: ignore[arg-type]
    assert decoded.shape == own.pixels.shape
    assert CodedMaps.of(own.maps, decoded, own.pixels).psnr_db() > 28.0


@NEEDS_ENCODERS
def test_the_study_writes_its_figures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, builder = material(), GltfBuilder()
    images = [source.pixels[..., :3], source.pixels[..., 2:5], source.pixels[..., 4:7]]
    numbers = [builder.add("textures", source=builder.image(png(np.ascontiguousarray(image)))) for image in images]
    pbr = {"baseColorTexture": {"index": numbers[0]}, "metallicRoughnessTexture": {"index": numbers[2]}}
    made = builder.material(pbr=pbr, normalTexture={"index": numbers[1]})
    square = builder.triangle(made, POSITION=SQUARE, TEXCOORD_0=SQUARE_UVS)
    scene = builder.drawn(square).write(tmp_path / "scene.glb")
    out = tmp_path / "out"
    arguments = ["study", "materials", str(scene), "--out", str(out), "--bits", "8", "12"]
    assert cli.main(arguments) == 0
    record = json.loads((out / "materials.json").read_text())
    assert {row["curve"] for row in record["rows"]} >= {TOGETHER, SEEN, ALONE, BC, ASTC}
    assert record["materials"][0]["maps"] == list(MAPS)
    assert all((out / f"materials.{ending}").stat().st_size for ending in ("md", "csv", "png"))
    assert "degrees" in capsys.readouterr().out


def test_scenes_without_whole_materials_are_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    builder = GltfBuilder()
    made = builder.material(builder.image(png(material().pixels[..., :3].copy())))
    scene = builder.drawn(builder.triangle(made, POSITION=SQUARE, TEXCOORD_0=SQUARE_UVS)).write(tmp_path / "scene.glb")
    assert cli.main(["study", "materials", str(scene), "--out", str(tmp_path / "out")]) == 2
    assert "no material has normals and one more map" in capsys.readouterr().err
