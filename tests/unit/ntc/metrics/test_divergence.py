"""The divergence map against a loop over blocks."""

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.metrics.divergence import DivergenceStatistics, cut_percent, divergence_map


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


def test_what_decodes_nothing_counts_for_nothing() -> None:
    ids = np.full((8, 16), -1, np.int32)
    ids[3, 11] = 5
    np.testing.assert_array_equal(divergence_map(ids), [[0, 1]])


def test_an_empty_picture_has_an_empty_map() -> None:
    assert divergence_map(np.zeros((0, 16), np.int32)).shape == (0, 2)
    assert divergence_map(np.zeros((0, 0), np.int32)).shape == (0, 0)


def test_all_different_ids() -> None:
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


def test_statistics_of_an_empty_map() -> None:
    assert figures(DivergenceStatistics.of(np.zeros((0, 0), np.uint16))) == (0.0, 0, 0, 0, 0.0, 1.0)


def test_statistics_of_a_map_without_divergence() -> None:
    assert figures(DivergenceStatistics.of(np.ones((3, 3), np.uint16))) == (0.0, 0, 0, 1, 1.0, 1.0)


def test_statistics_agree_with_the_definition() -> None:
    divergence = np.random.default_rng(0).integers(0, 9, (13, 21)).astype(np.uint16)
    excess = np.maximum(divergence.astype(int) - 1, 0)
    statistics = DivergenceStatistics.of(divergence)
    assert statistics.excess == excess.sum()
    assert statistics.score == pytest.approx(excess.mean())
    assert statistics.mean == pytest.approx(divergence[divergence > 0].mean())
    assert statistics.wave_efficiency == pytest.approx((divergence > 0).sum() / divergence.sum())


def test_a_cut_is_in_percent_of_what_there_was() -> None:
    assert cut_percent(30, 40) == pytest.approx(25.0)
    assert cut_percent(50, 40) == pytest.approx(-25.0)
    assert cut_percent(0, 0) is None
