"""The study of groupings over the number of groups."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.studies.cluster_plot import cluster_figure
from lab.studies.clusters import ClusterStudyConfig, EncodedGrouping, Fold, cluster_study, cluster_table
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.grouping.covisible import seen_blocks

TEXTURES = 12


def view(seed: int) -> NDArray[np.int32]:
    """Neighbouring numbers lie side by side."""
    rows, columns = np.indices((60, 90))
    return ((columns // 9 + rows // 11 + seed) % TEXTURES).astype(np.int32)


@pytest.fixture(scope="module")
def rows():  # type: ignore[no-untyped-def]
    random = np.random.default_rng(0)
    textures = [SourceTexture(f"wood_{n}", np.zeros((4, 4, 3), np.uint8), str(n)) for n in range(TEXTURES)]
    features = {"low_level": random.normal(size=(TEXTURES, 3)), "spectral": random.normal(size=(TEXTURES, 5))}
    halves = [seen_blocks([view(seed)], TEXTURES) for seed in (0, 1)]
    folds = [Fold(halves[0], halves[1]), Fold(halves[1], halves[0])]
    packs = [EncodedGrouping("single", (0,) * TEXTURES, 30.5)]
    config = ClusterStudyConfig(counts=(1, 4, 100))
    return cluster_study(textures, features, folds, config, packs)  # type: ignore[arg-type]


def test_every_grouping_has_its_rows(rows) -> None:  # type: ignore[no-untyped-def]
    found = {(row.grouping, row.features, row.groups) for row in rows}
    assert {("baseline", None, 12), ("category", None, 1), ("pack single", None, 1)} <= found
    for name in ("low_level", "spectral"):
        assert {("clustered", name, count) for count in (1, 4, 12)} <= found
        assert ("covisible", name, 4) in found
    assert ("random", None, 4) in found


def test_figures_are_those_of_the_ends(rows) -> None:  # type: ignore[no-untyped-def]
    by_name = {row.grouping: row for row in rows}
    baseline, single = by_name["baseline"], by_name["pack single"]
    assert (baseline.held_out_cut_percent, baseline.spread_percent, baseline.largest_group) == (0.0, 0.0, 1)
    assert (single.held_out_cut_percent, single.held_out_excess, single.psnr_db) == (100.0, 0.0, 30.5)
    assert single.spread_percent == pytest.approx(100.0)


def test_covisible_cuts_most_and_keeps_its_limits(rows) -> None:  # type: ignore[no-untyped-def]
    four = {(row.grouping, row.features): row for row in rows if row.groups == 4}
    for name in ("low_level", "spectral"):
        free, clustered = four["covisible", name], four["clustered", name]
        assert free.seen_cut_percent >= clustered.seen_cut_percent
        assert free.largest_group <= math.ceil(12 / 4)
        alike = four["covisible, as alike as clustered", name]
        assert alike.spread_percent <= clustered.spread_percent + 1e-6
        assert alike.seen_cut_percent >= clustered.seen_cut_percent - 1e-6


def test_table_and_plot_show_all_rows(rows) -> None:  # type: ignore[no-untyped-def]
    assert cluster_table(rows).markdown().count("\n") == len(rows) + 2
    figure = cluster_figure(rows, "a title")
    assert len(figure.axes) == 3


def test_views_that_cannot_be_measured_are_refused() -> None:
    nothing = seen_blocks([np.full((16, 16), -1, np.int32)], 2)
    textures = [SourceTexture(f"{n}", np.zeros((4, 4, 3), np.uint8), str(n)) for n in range(2)]
    with pytest.raises(InputError, match="nothing to measure"):
        cluster_study(textures, {"low_level": np.eye(2)}, [Fold(nothing, nothing)], ClusterStudyConfig())


def test_no_groups_are_refused() -> None:
    with pytest.raises(InputError, match="--clusters 0"):
        ClusterStudyConfig(counts=(5, 0))
