"""Files of panoramas: what is right is read as it is, what is wrong is one line."""

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
import pytest

from ntc.errors import InputError
from viewer.lighting import panorama
from viewer.lighting.panorama import LARGEST_RADIANCE, load_panorama, reduced


def write(path: Path, pixels: np.ndarray, kind: str = "float") -> Path:
    height, width, channels = pixels.shape
    output: Any = OpenImageIO.ImageOutput.create(str(path))
    assert output.open(str(path), OpenImageIO.ImageSpec(width, height, channels, kind))
    assert output.write_image(pixels)
    output.close()
    return path


def radiance(height: int = 8, channels: int = 3) -> np.ndarray:
    return np.random.default_rng(0).gamma(0.5, 2.0, (height, 2 * height, channels)).astype(np.float32)


def test_exr_and_hdr_are_read(tmp_path: Path) -> None:
    pixels = radiance()
    found = load_panorama(write(tmp_path / "a.exr", pixels))
    np.testing.assert_array_equal(found.pixels, pixels)
    rgbe = load_panorama(write(tmp_path / "a.hdr", pixels))
    # Eight bits under the exponent of the largest channel.
    np.testing.assert_allclose(rgbe.pixels, pixels, atol=float(pixels.max()) / 128)
    assert found.digest != rgbe.digest
    assert load_panorama(tmp_path / "a.exr").digest == found.digest


def test_grey_becomes_rgb_alpha_is_left_out_and_suns_are_clamped(tmp_path: Path) -> None:
    pixels = radiance(channels=4)
    pixels[0, 0, 0], pixels[0, 1, 0] = 1e7, -1e-7
    found = load_panorama(write(tmp_path / "a.exr", pixels)).pixels
    assert found.shape == (8, 16, 3)
    assert found[0, 0, 0] == LARGEST_RADIANCE
    assert found[0, 1, 0] == 0.0
    grey = load_panorama(write(tmp_path / "grey.exr", radiance(channels=1))).pixels
    np.testing.assert_array_equal(grey[..., 0], grey[..., 2])


def test_large_panoramas_are_reduced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(panorama, "KEPT_WIDTH", 8)
    pixels = radiance(16)
    found = load_panorama(write(tmp_path / "a.exr", pixels)).pixels
    assert found.shape == (4, 8, 3)
    np.testing.assert_allclose(found[0, 0], pixels[:4, :4].mean(axis=(0, 1)), rtol=1e-5)
    assert reduced(pixels, 64) is pixels


def broken(folder: Path, fault: str) -> Path:
    path, pixels = folder / "broken.exr", radiance(64)
    if fault == "missing":
        return folder / "none.hdr"
    if fault == "folder":
        return folder
    if fault == "text":
        path.write_text("#?RADIANCE\nno picture")
        return path
    if fault == "empty":
        path.write_bytes(b"")
        return path
    if fault == "square":
        return write(path, pixels[:, :64])
    if fault == "too wide":
        return write(path, np.zeros((1 << 13, 1 << 14, 1), np.float16), "half")
    if fault == "colours":
        return write(folder / "broken.png", (pixels.clip(0, 1) * 255).astype(np.uint8), "uint8")
    if fault == "nan":
        pixels[3, 4] = np.nan
    if fault == "infinite":
        pixels[3, 4, 1] = np.inf
    if fault == "negative":
        pixels[3, 4] = -5.0
    write(path, pixels)
    if fault == "truncated":
        path.write_bytes(path.read_bytes()[:-3000])
    return path


FAULTS = {
    "missing": "cannot be read",
    "folder": "cannot be read",
    "text": "not an image|does not decode",
    "empty": "not an image",
    "square": "64 x 64 texels; an equirectangular panorama is twice as wide as high",
    "too wide": "at most 8192 across",
    "colours": "no radiance; give a panorama as HDR or EXR",
    "nan": "1 texels are infinite or no number",
    "infinite": "1 texels are infinite or no number",
    "negative": "negative radiance, down to -5",
    "truncated": "does not decode|not an image",
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faulty_files_are_one_line(tmp_path: Path, fault: str) -> None:
    path = broken(tmp_path, fault)
    with pytest.raises(InputError, match=FAULTS[fault]) as caught:
        load_panorama(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_part_of_a_panorama_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "part.exr"
    spec = OpenImageIO.ImageSpec(64, 32, 3, "float")
    spec.x, spec.y, spec.full_width, spec.full_height = 10, 4, 128, 64
    output: Any = OpenImageIO.ImageOutput.create(str(path))
    assert output.open(str(path), spec)
    output.write_image(radiance(32))
    output.close()
    with pytest.raises(InputError, match="holds a part of a picture"):
        load_panorama(path)


def test_a_header_that_lies_about_its_size_is_refused_before_memory_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "liar.hdr"
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4096 +X 8192\n" + bytes(64))
    with pytest.raises(InputError, match=r"8192 x 4096 texels in .* bytes; the file is broken"):
        load_panorama(path)
