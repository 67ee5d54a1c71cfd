"""`import ntc`: what is exported, that it is light, and that arrays come back as they went in, within the codec's error."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import ntc
from ntc.codec.maps import MapName

FRESH = """
import os, sys
for name in ("DISPLAY", "WAYLAND_DISPLAY"):
    os.environ.pop(name, None)
import ntc
pack = ntc.read_pack({path!r})
picture = ntc.decode(pack, 0)
ntc.divergence_map(picture[..., 0].astype("int32"))
heavy = [name for name in ("torch", "moderngl", "glfw", "imgui_bundle", "trimesh", "OpenImageIO", "viewer") if name in sys.modules]
sys.exit(f"imported {{heavy}}" if heavy else 0)
"""


def waves(phase: int, channels: int = 3) -> NDArray[np.uint8]:
    """[48, 64, channels]: smooth, as photographs are."""
    y, x = np.mgrid[0:48, 0:64]
    parts = [np.sin(x * 0.2 * (number + 1) + y * 0.15 + phase) * 60.0 + 128.0 for number in range(channels)]
    return np.stack(parts, axis=-1).astype(np.uint8)


@pytest.fixture(scope="module")
def pictures() -> list[NDArray[np.uint8]]:
    return [waves(0), waves(2), waves(4)]


@pytest.fixture(scope="module")
def pack(pictures: list[NDArray[np.uint8]]) -> ntc.Pack:
    textures = [ntc.texture(own, f"picture {number}") for number, own in enumerate(pictures)]
    return ntc.encode(textures, grouping=ntc.GroupingConfig("single"), target=ntc.BitsTarget(8.0))


def test_every_exported_name_is_there_and_described() -> None:
    assert sorted(ntc.__all__) == ntc.__all__
    for name in ntc.__all__:
        assert getattr(ntc, name).__doc__, name
    assert set(ntc.__all__) <= set(dir(ntc))
    with pytest.raises(AttributeError, match="nothing_of_that_name"):
        _ = ntc.nothing_of_that_name


def test_arrays_come_back(pack: ntc.Pack, pictures: list[NDArray[np.uint8]], tmp_path: Path) -> None:
    path = tmp_path / "pictures.ntc"
    ntc.write_pack(path, pack)
    again = ntc.read_pack(path)
    for number, picture in enumerate(pictures):
        decoded = ntc.decode(again, number)
        assert decoded.shape == picture.shape
        assert ntc.psnr_db(decoded, picture) > 30.0
        assert ntc.psnr_db(decoded, picture) == pytest.approx(pack.textures[number].psnr_db or 0.0, abs=0.01)
        assert np.abs(ntc.decode(again, number, backend="torch").astype(int) - decoded).max() <= 1
        tensor = ntc.decode_to_torch(again, number)
        assert np.abs(tensor.numpy() * 255.0 - decoded).max() <= 0.51
    assert ntc.bits_with_mips(again) > 0.0
    assert ntc.decode(again, 0, ntc.mip_count(again, 0) - 1).shape[0] < 48


def test_whole_materials_are_taken_apart_again() -> None:
    maps: dict[MapName, NDArray[np.uint8]] = {"base": waves(1), "normal": waves(3, 2), "roughness": waves(5, 1)}
    made = ntc.material(maps, "wall")
    decoded = ntc.decode_maps(ntc.encode([made], target=ntc.BitsTarget(8.0)), 0)
    assert {name: pixels.shape for name, pixels in decoded.items()} == {name: own.shape for name, own in maps.items()}
    assert ntc.psnr_db(decoded["base"], maps["base"]) > 25.0


def test_what_does_not_fit_is_told_in_a_line(pack: ntc.Pack) -> None:
    refused = [
        lambda: ntc.texture(waves(0).astype(np.float32)),
        lambda: ntc.texture(waves(0)[..., 0]),
        lambda: ntc.material({"base": waves(0), "normal": waves(0)}),
        lambda: ntc.material({"base": waves(0), "normal": waves(0, 2)[:8]}),
        lambda: ntc.material({"bumps": waves(0)}),  # type: ignore[dict-item]
        lambda: ntc.encode([]),
        lambda: ntc.encode([ntc.texture(waves(0))], codec="grid", target=ntc.BitsTarget(2.0)),
        lambda: ntc.encode([ntc.texture(waves(0))], training=ntc.TrainingConfig()),
        lambda: ntc.decode(pack, 3),
        lambda: ntc.decode(pack, 0, 99),
        lambda: ntc.decode_to_torch(pack, -1),
    ]
    for call in refused:
        with pytest.raises(ntc.InputError) as caught:
            call()
        assert "\n" not in str(caught.value)


@pytest.mark.process
def test_reading_and_decoding_take_neither_torch_nor_a_display(pack: ntc.Pack, tmp_path: Path) -> None:
    path = tmp_path / "pictures.ntc"
    ntc.write_pack(path, pack)
    done = subprocess.run(
        [sys.executable, "-c", FRESH.format(path=str(path))], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_codec_grid_is_trained_as_asked(pictures: list[NDArray[np.uint8]]) -> None:
    textures = [ntc.texture(own, f"picture {number}") for number, own in enumerate(pictures)]
    settings = ntc.TrainingConfig(steps=3, device="cpu")
    grouping = ntc.Grouping("single", (0, 0, 0))
    packs = [ntc.encode(textures, codec="grid", grouping=grouping, training=settings) for _ in range(2)]
    assert packs[0].config.kind == "grid"
    assert (ntc.decode(packs[0], 2) == ntc.decode(packs[1], 2)).all()
