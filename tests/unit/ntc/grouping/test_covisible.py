"""Grouping by what is seen together."""

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.grouping.covisible import (
    CovisibleConfig,
    SearchProblem,
    covisible_grouping,
    feature_spread,
    seen_blocks,
    tabu_search,
)
from ntc.metrics.divergence import DivergenceStatistics, divergence_map

TEXTURES = 24


def neighbours(seed: int, textures: int = TEXTURES, size: tuple[int, int] = (90, 131)) -> NDArray[np.int32]:
    """A picture of patches in which textures with near numbers lie side by side, with some background."""
    random = np.random.default_rng(seed)
    rows, columns = np.indices(size)
    ids = ((columns // 11 + rows // 13 + random.integers(0, textures)) % textures).astype(np.int32)
    ids[random.random(size) < 0.05] = -1
    return ids


@pytest.mark.parametrize("block", [(8, 8), (4, 8), (4, 16)])
def test_excess_is_that_of_the_divergence_map(block: tuple[int, int]) -> None:
    views = [neighbours(seed, size=size) for seed, size in enumerate(((90, 131), (64, 64), (7, 3)))]
    seen = seen_blocks(views, TEXTURES, block)
    random = np.random.default_rng(0)
    for clusters in (1, 3, TEXTURES):
        groups = random.integers(0, clusters, TEXTURES)
        exact = 0
        for view in views:
            decoders = np.append(groups, -1)[view].astype(np.int32)
            exact += DivergenceStatistics.of(divergence_map(decoders, block)).excess
        assert seen.excess(groups) == exact
    assert seen.blocks == sum(-(-view.shape[0] // block[0]) * -(-view.shape[1] // block[1]) for view in views)


@pytest.mark.parametrize("weight", [0.0, 0.4, 5.0])
def test_every_chain_knows_its_cost(weight: float) -> None:
    # Chains add up the changes of thousands of moves: the sum must still be the cost of the groups they return.
    random = np.random.default_rng(3)
    features = random.normal(size=(TEXTURES, 5))
    problem = SearchProblem(seen_blocks([neighbours(1)], TEXTURES), features, clusters=5, bound=6)
    starts = random.integers(0, 5, (7, TEXTURES))
    costs, found = tabu_search(problem, starts, np.full(7, weight), 500, random)
    for cost, groups in zip(costs, found, strict=True):
        exact = problem.seen.excess(groups) / problem.worst_excess
        exact += weight * feature_spread(features, groups) / problem.worst_spread
        assert cost == pytest.approx(exact, abs=1e-6)
        assert np.bincount(groups).max() <= 6


def test_the_search_finds_the_best_of_all_groups() -> None:
    # Eight textures in three groups of at most three: few enough to try every assignment.
    features = np.random.default_rng(4).normal(size=(8, 2))
    problem = SearchProblem(seen_blocks([neighbours(seed, 8) for seed in range(2)], 8), features, 3, 3)

    def cost(groups: NDArray[np.int64]) -> float:
        spread = feature_spread(features, groups) / problem.worst_spread
        return problem.seen.excess(groups) / problem.worst_excess + 0.3 * spread

    everything = (np.array(groups) for groups in itertools.product(range(3), repeat=8))
    best = min(cost(groups) for groups in everything if np.bincount(groups).max() <= 3)
    random = np.random.default_rng(0)
    costs, _ = tabu_search(problem, random.integers(0, 3, (4, 8)), np.full(4, 0.3), 200, random)
    assert costs.min() == pytest.approx(best, abs=1e-9)


@pytest.mark.slow
def test_a_limit_and_a_weight_on_spread_are_kept() -> None:
    seen = seen_blocks([neighbours(seed) for seed in range(2)], TEXTURES)
    features = np.random.default_rng(5).normal(size=(TEXTURES, 3))
    free = covisible_grouping(seen, features, CovisibleConfig(clusters=6, spread_weight=0.0))
    limit = 0.7 * feature_spread(features, np.array(free.groups))
    limited = covisible_grouping(seen, features, CovisibleConfig(clusters=6, spread_limit=limit))
    assert feature_spread(features, np.array(limited.groups)) <= limit
    assert limited.parameters["excess"] >= free.parameters["excess"]
    tied = covisible_grouping(seen, features, CovisibleConfig(clusters=6, spread_weight=3.0))
    assert feature_spread(features, np.array(tied.groups)) < feature_spread(features, np.array(free.groups))
    assert tied.parameters["excess"] >= free.parameters["excess"]
    with pytest.raises(InputError, match="allow more spread"):
        covisible_grouping(seen, features, CovisibleConfig(clusters=6, spread_limit=1e-6))


def test_it_finds_what_belongs_together() -> None:
    # Six islands of four textures each, never seen with another island: no divergence is needed.
    views = []
    for island in range(6):
        view = np.random.default_rng(island).integers(0, 4, (40, 40)).astype(np.int32) * 6 + island
        views.append(view)
    features = np.random.default_rng(9).normal(size=(24, 3))
    config = CovisibleConfig(clusters=6, spread_weight=0.0)
    grouping = covisible_grouping(seen_blocks(views, 24), features, config)
    assert grouping.parameters["excess"] == 0.0
    assert grouping.group_count == 6


@pytest.mark.parametrize(("textures", "clusters"), [(2, 10), (3, 3), (5, 1)])
def test_few_textures(textures: int, clusters: int) -> None:
    seen = seen_blocks([neighbours(0, textures)], textures)
    grouping = covisible_grouping(seen, np.zeros((textures, 1)), CovisibleConfig(clusters=clusters, iterations=20))
    assert len(grouping.groups) == textures
    assert grouping.group_count <= min(clusters, textures)


def test_views_that_show_nothing_are_refused() -> None:
    empty = np.full((20, 20), -1, np.int32)
    alone = np.zeros((20, 20), np.int32)
    for views in ([empty], [alone], [empty, alone]):
        with pytest.raises(InputError, match="no block"):
            covisible_grouping(seen_blocks(views, 3), np.zeros((3, 1)), CovisibleConfig(clusters=2))
    with pytest.raises(ValueError, match="texture id 7"):
        seen_blocks([np.full((8, 8), 7, np.int32)], 7)
