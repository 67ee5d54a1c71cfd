"""Grouping by what is seen together: the groups with the least measured excess over a set of views."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.model import Grouping
from ntc.errors import InputError
from ntc.grouping.seen_blocks import SeenBlocks
from ntc.grouping.tabu_search import Floats, Groups, SearchProblem, feature_spread, tabu_search

SPREAD_WEIGHTS_UNDER_A_LIMIT = (0.01, 4.0)
"""Weights of spread that chains try, from the first to the last, where spread has a limit."""
LARGEST_WORK = 2.0e9
"""Rough number of elementary steps after which a search ends early, so that a thousand textures take a minute."""


@dataclass(frozen=True)
class CovisibleConfig:
    """How groups are searched."""

    clusters: int = 10
    largest_share: float = 0.2
    """No group holds more than this share of the textures (rounded down), unless `clusters` groups cannot hold them all."""
    spread_weight: float = 0.3
    """Weight of the spread of features inside groups, against excess; both relative to their worst."""
    spread_limit: float | None = None
    """Most spread that is allowed; where given, the least excess under it is searched and `spread_weight` is unused."""
    chains: int = 24
    """Searches side by side, each from a start of its own."""
    iterations: int = 2000
    seed: int = 0


def merged_start(seen: SeenBlocks, textures: int, clusters: int, bound: int) -> Groups:
    """[textures] groups from below: every texture alone, then again and again the two groups whose union saves most."""
    weighted = seen.members.multiply(seen.weights[:, None]).tocsr()
    together = np.asarray((weighted.T @ seen.members).todense())
    np.fill_diagonal(together, 0.0)
    groups = np.arange(textures)
    alive = list(range(textures))
    sizes = np.ones(textures, np.int64)
    while len(alive) > clusters:
        part = together[np.ix_(alive, alive)]
        both = sizes[alive][:, None] + sizes[alive][None, :]
        fits = both <= bound
        np.fill_diagonal(fits, False)
        if not fits.any():
            break
        # Small groups first among equals, so that the bound does not stop the merging.
        score = np.where(fits, part - 1e-6 * both, -np.inf)
        a, b = np.unravel_index(int(np.argmax(score)), score.shape)
        keep, gone = alive[min(a, b)], alive[max(a, b)]
        together[keep] += together[gone]
        together[:, keep] += together[:, gone]
        sizes[keep] += sizes[gone]
        groups[groups == gone] = keep
        alive.remove(gone)
    numbers = {old: new for new, old in enumerate(alive)}
    merged = np.array([numbers[group] for group in groups.tolist()], np.int64)
    # Where the bound left more groups than asked for, the last ones are spread over those with room.
    for texture in np.nonzero(merged >= clusters)[0]:
        merged[texture] = int(np.argmin(np.bincount(merged[merged < clusters], minlength=clusters)))
    return merged


def _starts(problem: SearchProblem, chains: int, given: Groups | None, random: np.random.Generator) -> Groups:
    """[chains, textures]: in turn the merged groups, the given ones if any, and two random ones."""
    textures = len(problem.features)
    merged = merged_start(problem.seen, textures, problem.clusters, problem.bound)
    starts = np.stack([random.permutation(np.arange(textures) % problem.clusters) for _ in range(chains)])
    starts[::4] = merged
    if given is not None:
        starts[1::4] = given
    return starts


def largest_group(textures: int, clusters: int, largest_share: float) -> int:
    """Most textures of a group: the share of them, but enough for `clusters` groups to hold all."""
    return max(int(largest_share * textures), -(-textures // clusters), 1)


def covisible_grouping(
    seen: SeenBlocks, features: Floats, config: CovisibleConfig, start: NDArray[np.int64] | None = None
) -> Grouping:
    """The best groups found over all chains.

    `features` [textures, F] describe how alike textures are; `seen` what the views show; `start` [textures] groups to
    begin some chains with. The same seed gives the same groups. Raises InputError where the views show no block with
    two textures, and where no groups within the bound and the spread limit were met.
    """
    textures = len(features)
    if not len(seen.weights):
        raise InputError("--views: no block of any view shows two textures; there is nothing to group by")
    clusters = min(config.clusters, textures)
    bound = largest_group(textures, clusters, config.largest_share)
    limit = np.inf if config.spread_limit is None else config.spread_limit
    problem = SearchProblem(seen, features, clusters, bound, limit)
    random = np.random.default_rng(config.seed)
    weights = np.full(config.chains, config.spread_weight)
    if config.spread_limit is not None:
        weights = np.geomspace(*SPREAD_WEIGHTS_UNDER_A_LIMIT, config.chains)
    iterations = config.iterations
    work = config.chains * (clusters * textures + seen.members.nnz)
    iterations = max(textures, min(iterations, int(LARGEST_WORK / work)))
    usable = start if start is not None and int(start.max(initial=0)) < clusters else None
    costs, groups = tabu_search(problem, _starts(problem, config.chains, usable, random), weights, iterations, random)
    if config.spread_limit is not None:
        costs = np.where(np.isfinite(costs), [seen.excess(found) for found in groups], np.inf)
    if not np.isfinite(costs).any():
        raise InputError(
            f"covisible: no {clusters} groups of at most {bound} textures with a spread of at most "
            f"{config.spread_limit}; allow more spread or larger groups"
        )
    best = groups[int(np.argmin(costs))]
    parameters = {
        "clusters": config.clusters,
        "largest_group": bound,
        "spread_weight": config.spread_weight if config.spread_limit is None else None,
        "spread_limit": config.spread_limit,
        "seed": config.seed,
        "excess": seen.excess(best),
        "baseline_excess": seen.excess(np.arange(textures)),
        "spread": feature_spread(features, best),
    }
    return Grouping.of_labels("covisible", best.tolist(), parameters)
