"""Figures of rate and distortion: what counts as bits and quality of a set."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from lab.studies import hardware_formats
from lab.studies.disk_formats import disk_file, measured_files, side_by_side
from lab.studies.hardware_formats import FormatStudy
from lab.studies.rate_table import RatePoint, disk_figure, disk_rows, rate_figure, rate_table
from lab.studies.set_quality import PictureQuality, SetQuality, picture_quality, texel_count
from lab.studies.settings import DISK_FORMATS
from ntc.codec.mips import mip_chain, mip_sizes
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError

Image = np.ndarray


def waves(side: int, seed: int) -> Image:
    """[side, side, 3] uint8: waves with noise."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:side, 0:side]
    layers = [128 + 90 * np.sin(x / (5 + seed + 3 * i) + y / (9 - i)) for i in range(3)]
    return np.clip(np.stack(layers, axis=-1) + random.normal(0, 8, (side, side, 3)), 0, 255).astype(np.uint8)


def texture(side: int, seed: int) -> SourceTexture:
    """A texture of `waves`."""
    pixels = waves(side, seed)
    return SourceTexture(f"waves {seed}", pixels, hash_pixels(pixels))


def test_mips_go_down_to_one_texel() -> None:
    assert mip_sizes(5, 2) == [(5, 2), (2, 1), (1, 1)]
    assert texel_count([(4, 4), (5, 2)]) == 16 + 10


def test_an_exact_picture_counts_as_off_by_one_value() -> None:
    image = waves(16, 0)
    found = picture_quality(image, image)
    assert (found.ssim, found.flip) == (1.0, 0.0)
    off = image.copy()
    off[0, 0, 0] ^= 1
    assert found.psnr_db == pytest.approx(picture_quality(image, off).psnr_db)


def test_a_set_has_means_and_the_worst() -> None:
    pictures = [PictureQuality(20.0, 0.5, 0.1), PictureQuality(40.0, 0.9, None)]
    found = SetQuality.of(pictures, 2.0, 1.0)
    assert (found.mean_db, found.worst_db, found.ssim, found.flip) == (30.0, 20.0, 0.7, 0.1)
    assert found.of_mean_mse_db == pytest.approx(22.967, abs=1e-3)
    with pytest.raises(InputError, match="no texture to compare"):
        SetQuality.of([], 2.0, 1.0)


def test_a_format_is_measured_once_and_its_bits_count_all_mips(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("quicktex")
    textures = [texture(32, seed) for seed in range(2)]
    pictures, quality = FormatStudy(tmp_path, "medium").measured(textures, "bc1")
    # 64 + 16 + 4 + 1 + 1 + 1 blocks of 64 bits for 1024 texels of mip 0.
    assert quality.bits_per_texel == pytest.approx(87 * 64 / 1024)
    monkeypatch.setattr(hardware_formats, "compress", lambda *_: pytest.fail("encoded again"))
    assert FormatStudy(tmp_path, "medium").measured(textures, "bc1") == (pictures, quality)


def test_points_make_a_table_and_a_plot() -> None:
    points = [
        RatePoint("ASTC", f"astc-{n}", SetQuality(float(n), 30.0 + n, 29.0 + n, 25.0, 0.9, None, 1.0)) for n in (2, 4)
    ]
    points.append(RatePoint("BC1", "bc1", SetQuality(4.0, 33.0, 32.0, 28.0, 0.9, None, 1.0)))
    table = rate_table(points)
    assert "FLIP" not in table.markdown()
    assert [row["bits_per_texel"] for row in table.rows] == [2.0, 4.0, 4.0]
    figure = rate_figure(points, "a set")
    assert figure.get_suptitle() == "a set"
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "PSNR, mean of textures, dB",
        "PSNR of the mean MSE, dB",
    ]
    assert np.array_equal(figure.axes[0].lines[0].get_xdata(), [2.0, 4.0])


@pytest.mark.parametrize("size", [(16, 16), (32, 4), (4, 32), (1, 1)])
def test_mips_side_by_side_are_whole(size: tuple[int, int]) -> None:
    mips = mip_chain(np.full((*size, 3), 7, np.uint8), "srgb")
    found = side_by_side(mips)
    assert (found == 7).all()
    assert found.shape[0] * found.shape[1] >= sum(mip.shape[0] * mip.shape[1] for mip in mips)


def test_files_hold_all_mips_and_sizes_are_compared_at_equal_quality() -> None:
    pytest.importorskip("alktx2")
    textures = [texture(32, seed) for seed in range(2)]
    points = []
    for name in DISK_FORMATS:
        for quality in (10, 90):
            found = measured_files(textures, partial(disk_file, name=name, quality=quality), 1)
            assert found.file_bits_per_texel == found.bits_per_texel
            points.append(RatePoint(name, str(quality), found))
    jpeg = [point.quality for point in points if point.curve == "jpeg"]
    assert jpeg[0].bits_per_texel < jpeg[1].bits_per_texel
    assert jpeg[0].mean_db < jpeg[1].mean_db
    (row,) = disk_rows(points, [0.5 * (jpeg[0].mean_db + jpeg[1].mean_db)])
    bits = row["jpeg"]
    assert isinstance(bits, float)
    assert jpeg[0].bits_per_texel < bits < jpeg[1].bits_per_texel
    assert disk_rows(points, [90.0])[0]["jpeg"] is None
    assert len(disk_figure(points, "textures").axes) == 1
