"""PSNR, SSIM, FLIP and divergence, against closed forms, sums written out and OpenImageIO."""

import math
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import OpenImageIO
import pytest
from numpy.typing import NDArray

from lab.bench.random_pack import random_pack
from ntc.codec.grid.model import grid_parts
from ntc.codec.mips import srgb_to_linear
from ntc.codec.quality import PsnrSummary, mean_square_error, psnr_db, worst_share_db
from ntc.errors import InputError
from ntc.metrics.divergence import DivergenceStatistics, cut_percent, divergence_map
from ntc.metrics.image_quality import flip, ssim
from ntc.metrics.metrics import psnr_table
from tests.support.gltf_builder import noise


def test_a_known_error() -> None:
    a, b = np.zeros((4, 4, 3), np.uint8), np.full((4, 4, 3), 2, np.uint8)
    assert mean_square_error(a, b) == mean_square_error(b, a) == 4.0
    assert psnr_db(a, b) == pytest.approx(10.0 * math.log10(255.0**2 / 4.0))
    assert psnr_db(a, np.full_like(a, 255)) == pytest.approx(0.0)
    assert psnr_db(a, a.copy()) == math.inf


def test_summary_of_known_values() -> None:
    summary = PsnrSummary.of([20.0, 30.0, 70.0])
    assert summary is not None
    assert (summary.mean_db, summary.median_db, summary.minimum_db) == (40.0, 30.0, 20.0)
    mean = (10**-2.0 + 10**-3.0 + 10**-7.0) / 3.0
    assert summary.of_mean_mse_db == pytest.approx(-10.0 * math.log10(mean))
    assert PsnrSummary.of([]) is None
    # With a perfect texture it stays printable.
    perfect = PsnrSummary.of([math.inf, 30.0])
    assert perfect is not None
    assert perfect.minimum_db == 30.0
    assert perfect.of_mean_mse_db == pytest.approx(30.0 + 10.0 * math.log10(2.0))


def test_table_lists_the_worst_texture_first_and_counts_every_byte() -> None:
    pack = random_pack(sizes=((16, 16), (8, 8), (4, 4)), groups=(0, 1, 0))
    textures = tuple(
        replace(t, psnr_db=value) for t, value in zip(grid_parts(pack).textures, (40.0, 20.0, None), strict=True)
    )
    table = psnr_table(replace(pack, textures=textures))
    assert [line.split()[1] for line in table.lines()[1:4]] == ["1", "0", "2"]
    arrays = [a for t in textures for a in (t.latents, t.scale, t.offset)]
    decoders = [a for d in grid_parts(pack).decoders for a in (*d.weights, *d.biases)]
    assert table.latent_bytes == sum(a.nbytes for a in arrays)
    assert table.decoder_bytes == sum(a.nbytes for a in decoders)
    texels = 16 * 16 + 8 * 8 + 4 * 4
    assert table.bits_per_texel == pytest.approx(8 * (table.latent_bytes + table.decoder_bytes) / texels)
    assert table.summary is not None
    assert table.summary.mean_db == 30.0


Image = NDArray[np.uint8]
HOSTILE_SIZES = [(1, 1), (4096, 1), (1, 4096), (10, 11), (11, 11), (3, 40)]
METRICS = [ssim, flip]


def disturbed(image: Image, steps: int, seed: int = 1) -> Image:
    """`image` with up to `steps` added to or taken from every value."""
    shift = np.random.default_rng(seed).integers(-steps, steps + 1, image.shape)
    return np.clip(image.astype(np.int64) + shift, 0, 255).astype(np.uint8)


def smooth(width: int, height: int) -> Image:
    """[height, width, 3] uint8: waves in every channel, within 48 and 208."""
    y, x = np.mgrid[0:height, 0:width]
    waves = [np.sin(x / 9.0 + y / 17.0), np.cos(x / 13.0 - y / 7.0), np.sin(x / 5.0) * np.cos(y / 11.0)]
    return (128.0 + 80.0 * np.stack(waves, axis=-1)).astype(np.uint8)


def slow_ssim(a: Image, b: Image) -> float:
    """SSIM as its paper has it, window by window, for sides of 11 and more."""
    offsets = np.arange(-5, 6)
    window = np.exp(-(offsets[:, None] ** 2 + offsets[None, :] ** 2) / (2.0 * 1.5**2))
    window /= window.sum()
    x, y = (0.299 * i[..., 0] + 0.587 * i[..., 1] + 0.114 * i[..., 2] for i in (a, b))
    values = []
    for row in range(a.shape[0] - 10):
        for column in range(a.shape[1] - 10):
            p, q = x[row : row + 11, column : column + 11], y[row : row + 11, column : column + 11]
            mean_p, mean_q = (window * p).sum(), (window * q).sum()
            variances = (window * (p - mean_p) ** 2).sum() + (window * (q - mean_q) ** 2).sum()
            covariance = (window * (p - mean_p) * (q - mean_q)).sum()
            luminance = (2 * mean_p * mean_q + 6.5025) / (mean_p**2 + mean_q**2 + 6.5025)
            values.append(luminance * (2 * covariance + 58.5225) / (variances + 58.5225))
    return float(np.mean(values))


@pytest.mark.parametrize("size", [(11, 11), (11, 30), (24, 17)])
def test_ssim_agrees_with_the_paper_written_out(size: tuple[int, int]) -> None:
    image = noise(*size)
    for other in (disturbed(image, 40), noise(*size, seed=5)):
        assert ssim(image, other) == pytest.approx(slow_ssim(image, other), abs=1e-9)


@pytest.mark.parametrize("size", [(32, 32), (5, 7), (1, 1), (4096, 1)])
def test_ssim_of_two_flat_pictures_is_the_luminance_term(size: tuple[int, int]) -> None:
    for first, second in ((100, 110), (0, 255), (0, 1)):
        a, b = (np.full((size[1], size[0], 3), value, np.uint8) for value in (first, second))
        c1 = (0.01 * 255) ** 2
        expected = (2 * first * second + c1) / (first**2 + second**2 + c1)
        assert ssim(a, b) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("size", HOSTILE_SIZES)
def test_pictures_of_any_shape_stay_within_bounds_and_equal_ones_are_the_best(
    size: tuple[int, int], channels: int
) -> None:
    a, b = noise(*size, channels), noise(*size, channels, seed=9)
    assert ssim(a, a.copy()) == pytest.approx(1.0, abs=1e-12)
    assert flip(a, a.copy()) == 0.0
    assert -1.0 <= ssim(a, b) < 1.0
    assert 0.0 < flip(a, b) <= 1.0


@pytest.mark.parametrize("metric", METRICS)
def test_alpha_is_left_out_and_grey_repeated(metric: Any) -> None:
    a, b = noise(20, 20, 4), noise(20, 20, 4, seed=2)
    assert metric(a, b) == metric(a[..., :3], b[..., :3])
    grey = metric(a[..., :1], b[..., :1])
    assert metric(a[..., :2], b[..., :2]) == grey
    assert metric(a[..., :1].repeat(3, axis=2), b[..., :1].repeat(3, axis=2)) == grey


@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize(
    ("a", "b"),
    [
        (noise(4, 4), noise(4, 5)),
        (noise(4, 4, 3), noise(4, 4, 4)),
        (noise(4, 4)[..., 0], noise(4, 4)[..., 0]),
        (noise(4, 4, 5), noise(4, 4, 5)),
        (noise(0, 4), noise(0, 4)),
        (noise(4, 4) / 255.0, noise(4, 4) / 255.0),
    ],
)
def test_bad_pictures_are_one_line(metric: Any, a: Image, b: Image) -> None:
    with pytest.raises(InputError, match="image"):
        metric(a, b)


def test_what_cannot_be_measured_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    for pixels_per_degree in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(InputError, match="pixels_per_degree"):
            flip(noise(4, 4), noise(4, 4), pixels_per_degree)
    nonsense: tuple[tuple[list[float], float], ...] = (
        ([], 0.05),
        ([30.0, math.nan], 0.05),
        ([30.0], 0.0),
        ([30.0], 1.5),
        ([30.0], math.nan),
    )
    for values, share in nonsense:
        with pytest.raises(InputError, match="worst PSNR"):
            worst_share_db(values, share)
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    with pytest.raises(InputError, match="pip install flip-evaluator"):
        flip(noise(4, 4), noise(4, 4))


def flip_of_openimageio(a: Image, b: Image, pixels_per_degree: float) -> float:
    """Mean LDR-FLIP by OpenImageIO's own implementation, which wants linear light."""
    if not hasattr(OpenImageIO.ImageBufAlgo, "FLIP_diff"):
        pytest.skip("this OpenImageIO has no FLIP")
    buffers = [OpenImageIO.ImageBuf(srgb_to_linear(image.astype(np.float32) / np.float32(255.0))) for image in (a, b)]
    for buffer in buffers:
        buffer.specmod().set_colorspace("lin_rec709")
    errors = OpenImageIO.ImageBufAlgo.FLIP_diff(buffers[0], buffers[1], hdr=0, ppd=pixels_per_degree).get_pixels()
    assert errors is not None, OpenImageIO.geterror()
    return float(np.mean(errors, dtype=np.float64))


@pytest.mark.parametrize("size", [(64, 48), (1, 1), (1, 500), (500, 1), (3, 5)])
@pytest.mark.parametrize("pixels_per_degree", [67.02, 30.0])
def test_flip_agrees_with_openimageio(size: tuple[int, int], pixels_per_degree: float) -> None:
    for image, steps in ((noise(*size), 255), (noise(*size), 20), (smooth(*size), 8)):
        other = disturbed(image, steps)
        expected = flip_of_openimageio(image, other, pixels_per_degree)
        assert flip(image, other, pixels_per_degree) == pytest.approx(expected, abs=2e-5)


def test_worst_share_of_known_values() -> None:
    values = [float(value) for value in range(100, 0, -1)]
    assert worst_share_db(values) == pytest.approx(3.0)
    assert worst_share_db(values, 0.07) == pytest.approx(4.0)
    assert worst_share_db(values, 1.0) == pytest.approx(50.5)
    assert worst_share_db([40.0, 30.0, 35.0]) == 30.0
    assert worst_share_db(values[:21]) == pytest.approx(80.5), "one and a bit is two"
    assert worst_share_db([math.inf, 30.0]) == 30.0
    assert worst_share_db([math.inf]) == math.inf


def brute_map(ids: NDArray[np.int32], block: tuple[int, int]) -> NDArray[np.uint16]:
    """Distinct ids that are not negative, block by block."""
    rows = [
        [
            len({int(i) for i in ids[y : y + block[0], x : x + block[1]].ravel() if i >= 0})
            for x in range(0, ids.shape[1], block[1])
        ]
        for y in range(0, ids.shape[0], block[0])
    ]
    return np.array(rows, np.uint16).reshape(-(-ids.shape[0] // block[0]), -(-ids.shape[1] // block[1]))


@pytest.mark.parametrize("size", [(16, 16), (17, 33), (8, 8), (1, 1), (5, 100), (23, 7)])
@pytest.mark.parametrize("block", [(8, 8), (4, 8), (1, 1), (3, 5), (64, 64)])
@pytest.mark.parametrize("decoders", [1, 3, 70, 60000])
def test_map_agrees_with_a_loop(size: tuple[int, int], block: tuple[int, int], decoders: int) -> None:
    ids = np.random.default_rng(decoders).integers(-2, decoders, size).astype(np.int32)
    result = divergence_map(ids, block)
    assert result.dtype == np.uint16
    np.testing.assert_array_equal(result, brute_map(ids, block))


def test_maps_of_pictures_that_decode_one_texel_nothing_or_all_there_is() -> None:
    ids = np.full((8, 16), -1, np.int32)
    ids[3, 11] = 5
    np.testing.assert_array_equal(divergence_map(ids), [[0, 1]])
    assert divergence_map(np.zeros((0, 16), np.int32)).shape == (0, 2)
    assert divergence_map(np.zeros((0, 0), np.int32)).shape == (0, 0)
    assert divergence_map(np.arange(64, dtype=np.int32).reshape(8, 8)).tolist() == [[64]]


def figures(statistics: DivergenceStatistics) -> tuple[float, int, int, int, float, float]:
    """score, excess, divergent blocks, maximum, mean, wave efficiency."""
    s = statistics
    return s.score, s.excess, s.divergent_blocks, s.maximum, s.mean, s.wave_efficiency


def test_statistics_of_a_known_map() -> None:
    statistics = DivergenceStatistics.of(np.array([[0, 1, 2], [5, 1, 0]], np.uint16))
    assert figures(statistics) == (5 / 6, 5, 2, 5, 9 / 4, 4 / 9)
    assert (statistics.blocks, statistics.covered_blocks, statistics.decoder_runs) == (6, 4, 9)
    assert statistics.histogram == (2, 2, 1, 0, 0, 1)
    assert figures(DivergenceStatistics.of(np.zeros((0, 0), np.uint16))) == (0.0, 0, 0, 0, 0.0, 1.0)
    assert figures(DivergenceStatistics.of(np.ones((3, 3), np.uint16))) == (0.0, 0, 0, 1, 1.0, 1.0)
    assert cut_percent(30, 40) == pytest.approx(25.0)
    assert cut_percent(50, 40) == pytest.approx(-25.0)
    assert cut_percent(0, 0) is None
