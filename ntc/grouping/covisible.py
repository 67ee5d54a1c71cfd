"""Grouping by what is seen together: the groups with the least measured excess over a set of views."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ntc.codec.model import Grouping
from ntc.errors import InputError
from ntc.metrics.divergence import BLOCK, distinct_ids


@dataclass(frozen=True, eq=False)
class SeenBlocks:
    """The distinct texture sets of blocks with two textures or more; others cannot diverge."""

    members: sparse.csr_array
    """[sets, textures] float64, 1 where the set holds the texture."""
    weights: NDArray[np.float64]
    """[sets] number of blocks with this set."""
    blocks: int
    """All blocks of all views, those without excess too."""

    def excess(self, groups: NDArray[np.int64]) -> float:
        """Return the sum of D - 1 over all blocks when texture t is decoded by decoder `groups[t]` (paper, Sec. 2)."""
        choice = np.zeros((len(groups), int(groups.max(initial=-1)) + 1))
        choice[np.arange(len(groups)), groups] = 1.0
        distinct = ((self.members @ choice) > 0.0).sum(axis=1)
        return float(self.weights @ (distinct - 1.0)) if len(self.weights) else 0.0


def seen_blocks(views: Sequence[NDArray[np.int32]], textures: int, block: tuple[int, int] = BLOCK) -> SeenBlocks:
    """Return the texture sets of `views`, each [H, W] int32 texture ids with -1 for none, row 0 on top.

    Raises ValueError for an id that is not below `textures`.
    """
    sets: dict[bytes, int] = {}
    blocks = 0
    for view in views:
        if view.size and int(view.max()) >= textures:
            raise ValueError(f"texture id {int(view.max())} in a scene of {textures} textures")
        rows = distinct_ids(view, block).reshape(-1, block[0] * block[1])
        blocks += len(rows)
        several = rows[(rows >= 0).sum(axis=1) > 1]
        distinct, counts = np.unique(np.sort(several, axis=1), axis=0, return_counts=True)
        for row, count in zip(distinct, counts.tolist(), strict=True):
            key = row[row >= 0].tobytes()
            sets[key] = sets.get(key, 0) + count
    ids = [np.frombuffer(key, np.int32) for key in sets]
    starts = np.concatenate([[0], np.cumsum([len(row) for row in ids])]).astype(np.int64)
    columns = np.concatenate(ids) if ids else np.zeros(0, np.int32)
    members = sparse.csr_array((np.ones(len(columns)), columns, starts), shape=(len(ids), textures))
    return SeenBlocks(members, np.array(list(sets.values()), np.float64), blocks)


Groups = NDArray[np.int64]
Floats = NDArray[np.float64]

SMALLEST_GAIN = 1e-9
FIRST_PENALTY = 0.02
PENALTY_STEP = 1.05
"""A group above the bound costs a penalty that grows while there is one and shrinks while there is none, so that
chains walk along the bound from both sides (strategic oscillation; F. Glover, "Tabu Search, Part II", 1990)."""


@dataclass(frozen=True, eq=False)
class SearchProblem:
    """The cost to minimise: excess plus weighted spread of features, both as shares of their worst."""

    seen: SeenBlocks
    features: Floats
    """[textures, F]."""
    clusters: int
    bound: int
    """Most textures of a group; `clusters` groups of it hold all textures."""
    spread_limit: float = np.inf
    """Groups with more spread than this are passed through, not kept."""

    @property
    def worst_excess(self) -> float:
        """Excess with a decoder for each texture."""
        return self.seen.excess(np.arange(len(self.features)))

    @property
    def worst_spread(self) -> float:
        """Spread of all textures as one group."""
        return feature_spread(self.features, np.zeros(len(self.features), np.int64))


def feature_spread(features: Floats, groups: Groups) -> float:
    """Return the sum of squared distances of `features` [textures, F] from the mean of their group."""
    total = 0.0
    for group in np.unique(groups):
        inside = features[groups == group]
        total += float(((inside - inside.mean(axis=0)) ** 2).sum())
    return total


class _Chains:
    """The state of all chains, and how every single move would change it.

    Arrays have the chain as first axis. A set is a distinct set of textures that share blocks, see SeenBlocks.
    """

    def __init__(self, problem: SearchProblem, starts: Groups) -> None:
        chains, textures = starts.shape
        members = problem.seen.members
        self.groups = starts.copy()
        self._chain = np.arange(chains)
        self._weighted = members.multiply(problem.seen.weights[:, None]).tocsr().T.tocsr()
        self._seen_with = np.asarray(self._weighted.sum(axis=1)).reshape(-1)
        self._features = problem.features
        self._squares = (problem.features**2).sum(axis=1)
        # Sets of each texture, padded with a set that weighs nothing.
        columns = members.tocsc()
        longest = int(np.diff(columns.indptr).max(initial=0))
        self._sets_of = np.full((textures, longest), members.shape[0], np.int64)
        for texture in range(textures):
            mine = columns.indices[columns.indptr[texture] : columns.indptr[texture + 1]]
            self._sets_of[texture, : len(mine)] = mine
        shape = (chains, problem.clusters)
        self._counts = np.zeros((*shape, members.shape[0] + 1), np.int16)
        self.sizes = np.zeros(shape)
        self._sums = np.zeros((*shape, problem.features.shape[1]))
        for texture in range(textures):
            self._add(np.full(chains, texture), starts[:, texture], 1)
        self._joins = np.empty((*shape, textures))
        self._leaves = np.empty((*shape, textures))
        self._away = np.empty((*shape, textures))
        for group in range(problem.clusters):
            self._refresh(self._chain, np.full(chains, group))
        used = (self._counts[..., :-1] > 0).sum(axis=1)
        self.excess = used @ problem.seen.weights - problem.seen.weights.sum()
        kept = ((self._sums**2).sum(axis=2) / np.maximum(self.sizes, 1.0)).sum(axis=1)
        self.spread = self._squares.sum() - kept

    def _add(self, textures: Groups, groups: Groups, sign: int) -> None:
        self._counts[self._chain[:, None], groups[:, None], self._sets_of[textures]] += np.int16(sign)
        self.sizes[self._chain, groups] += sign
        self._sums[self._chain, groups] += sign * self._features[textures]

    def _refresh(self, chains: Groups, groups: Groups) -> None:
        """Compute the costs of joining and leaving these groups for each texture."""
        counts = self._counts[chains, groups, :-1]
        # A set gains a decoder with its first texture of a group, and loses it with the last.
        self._joins[chains, groups] = self._seen_with - (self._weighted @ (counts > 0).T).T
        self._leaves[chains, groups] = (self._weighted @ (counts == 1).T).T
        means = self._sums[chains, groups] / np.maximum(self.sizes[chains, groups], 1.0)[:, None]
        self._away[chains, groups] = self._squares - 2.0 * means @ self._features.T + (means**2).sum(axis=1)[:, None]

    def changes(self) -> tuple[Floats, Floats]:
        """Return [chains, clusters, textures] change of excess and of spread when one texture moves to a group."""
        chain, texture = self._chain[:, None], np.arange(self.groups.shape[1])[None]
        excess = self._joins - self._leaves[chain, self.groups, texture][:, None, :]
        own = self.sizes[chain, self.groups]
        loss = self._away[chain, self.groups, texture] * own / np.maximum(own - 1.0, 1.0) * (own > 1.0)
        spread = self._away * (self.sizes / (self.sizes + 1.0))[:, :, None] - loss[:, None, :]
        return excess, spread

    def move(self, textures: Groups, groups: Groups) -> Groups:
        """Move one texture of each chain; the groups that they leave."""
        left = self.groups[self._chain, textures]
        self._add(textures, left, -1)
        self._add(textures, groups, 1)
        self.groups[self._chain, textures] = groups
        self._refresh(np.tile(self._chain, 2), np.concatenate([left, groups]))
        return left


def _adapted(penalty: Floats, kept: NDArray[np.bool_]) -> Floats:
    return np.clip(np.where(kept, penalty / PENALTY_STEP, penalty * PENALTY_STEP), 1e-4, 100.0)


def tabu_search(
    problem: SearchProblem, starts: Groups, weights: Floats, iterations: int, random: np.random.Generator
) -> tuple[Floats, Groups]:
    """Best cost [chains] and groups [chains, textures] that each chain met within the bound and the spread limit.

    `starts` [chains, textures] groups to start from; `weights` [chains] the weight of spread against excess. A chain
    that met nothing allowed has an infinite cost.
    """
    chains, textures = starts.shape
    state = _Chains(problem, starts)
    chain, everyone = np.arange(chains), np.arange(textures)[None]
    excess_scale = 1.0 / max(problem.worst_excess, 1e-300)
    worst_spread = max(problem.worst_spread, 1e-300)
    spread_scale = weights / worst_spread
    limited = bool(np.isfinite(problem.spread_limit))
    shortest, longest = max(1, textures // 8), max(2, textures // 2)
    penalty = np.full(chains, FIRST_PENALTY)
    spread_penalty = np.ones(chains)
    forbidden_until = np.zeros((chains, problem.clusters, textures), np.int64)
    best_cost, best = np.full(chains, np.inf), starts.copy()

    def keep_better(cost: Floats, within: NDArray[np.bool_]) -> None:
        better = within & (state.spread <= problem.spread_limit) & (cost < best_cost - SMALLEST_GAIN)
        best_cost[better] = cost[better]
        best[better] = state.groups[better]

    cost = state.excess * excess_scale + state.spread * spread_scale
    keep_better(cost, state.sizes.max(axis=1) <= problem.bound)
    for iteration in range(iterations):
        excess, spread = state.changes()
        change = excess * excess_scale + spread * spread_scale[:, None, None]
        over = state.sizes - problem.bound
        change += (penalty[:, None] * (over >= 0))[:, :, None]
        change -= (penalty[:, None] * (over > 0))[chain[:, None], state.groups][:, None, :]
        if limited:
            beyond = np.maximum(state.spread[:, None, None] + spread - problem.spread_limit, 0.0)
            beyond -= np.maximum(state.spread - problem.spread_limit, 0.0)[:, None, None]
            change += beyond * (spread_penalty / worst_spread)[:, None, None]
        # Not back to where it just came from, unless that is better than anything before.
        hopeful = change < (best_cost - cost)[:, None, None] - SMALLEST_GAIN
        change[(forbidden_until > iteration) & ~hopeful] = np.inf
        change[chain[:, None], state.groups, everyone] = np.inf
        chosen = change.reshape(chains, -1).argmin(axis=1)
        group, texture = chosen // textures, chosen % textures
        state.excess = state.excess + excess[chain, group, texture]
        state.spread = state.spread + spread[chain, group, texture]
        left = state.move(texture, group)
        forbidden_until[chain, left, texture] = iteration + random.integers(shortest, longest, chains)
        within = state.sizes.max(axis=1) <= problem.bound
        penalty = _adapted(penalty, within)
        spread_penalty = _adapted(spread_penalty, state.spread <= problem.spread_limit)
        cost = state.excess * excess_scale + state.spread * spread_scale
        keep_better(cost, within)
    return best_cost, best


SPREAD_WEIGHTS_UNDER_A_LIMIT = (0.01, 4.0)
"""Weights of spread that chains try, from the first to the last, where spread has a limit."""
LARGEST_WORK = 2.0e9
"""Rough number of elementary steps after which a search ends early, so that a thousand textures take a minute."""


@dataclass(frozen=True)
class CovisibleConfig:
    """Options of the search for groups."""

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
    """Return [textures] groups from below: every texture alone, then again and again the two groups whose union saves most."""
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
    """Return [chains, textures]: in turn the merged groups, the given ones if any, and two random ones."""
    textures = len(problem.features)
    merged = merged_start(problem.seen, textures, problem.clusters, problem.bound)
    starts = np.stack([random.permutation(np.arange(textures) % problem.clusters) for _ in range(chains)])
    starts[::4] = merged
    if given is not None:
        starts[1::4] = given
    return starts


def largest_group(textures: int, clusters: int, largest_share: float) -> int:
    """Return the most textures of a group: the share of them, but enough for `clusters` groups to hold all."""
    return max(int(largest_share * textures), -(-textures // clusters), 1)


def covisible_grouping(
    seen: SeenBlocks, features: Floats, config: CovisibleConfig, start: NDArray[np.int64] | None = None
) -> Grouping:
    """Find the groups of least cost over all chains.

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
