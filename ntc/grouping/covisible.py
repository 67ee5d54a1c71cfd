"""Grouping `covisible`: the groups with the least excess of decoders over a set of views (docs/explanation/sharing.md)."""

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
    """The distinct sets of textures that share a framebuffer block, with counts. Blocks of one texture cannot diverge and are left
    out."""

    members: sparse.csr_array
    """[sets, textures] float64, 1 where the set holds the texture."""
    weights: NDArray[np.float64]
    """[sets] number of blocks with this set."""
    blocks: int
    """Number of all blocks of all views, also of those without excess."""

    def excess(self, groups: NDArray[np.int64]) -> float:
        """Return the sum of D - 1 over all blocks when texture t is decoded by decoder `groups[t]` (paper, Sec. 2)."""
        choice = np.zeros((len(groups), int(groups.max(initial=-1)) + 1))
        choice[np.arange(len(groups)), groups] = 1.0
        distinct = ((self.members @ choice) > 0.0).sum(axis=1)
        return float(self.weights @ (distinct - 1.0)) if len(self.weights) else 0.0


def seen_blocks(views: Sequence[NDArray[np.int32]], textures: int, block: tuple[int, int] = BLOCK) -> SeenBlocks:
    """Return the sets of textures that share blocks in `views`, each [H, W] int32 texture ids with -1 for none, row 0 on top.

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

# The search. A grouping costs its excess over the views plus the weighted spread of features within groups; both are exact sums over
# SeenBlocks and features. A move puts one texture into another group. Tabu search (F. Glover, "Tabu Search, Part I and II",
# 1989/1990) always makes the best move, even one that raises the cost, and then forbids the reverse move for some iterations. So it
# leaves local minima. 24 chains run side by side, as arrays with the chain as first axis, from bottom-up merging and from random
# groups. `_Chains` holds the change of cost of every move, and after a move updates the two groups that changed.
# The bound of a group's size is a penalty that grows while it is violated and shrinks while it is not, so chains cross the bound to
# and fro (strategic oscillation, ibid.); only groupings within it count. What it gains: docs/explanation/sharing.md.
SMALLEST_GAIN = 1e-9
"""Change of cost that counts as better."""
FIRST_PENALTY = 0.02
"""Initial penalty of a group above the bound, in units of the cost."""
PENALTY_STEP = 1.05
"""Factor by which a penalty grows or shrinks in an iteration."""


@dataclass(frozen=True, eq=False)
class SearchProblem:
    """The cost to minimise: excess plus weighted spread of features, both relative to their worst value."""

    seen: SeenBlocks
    features: Floats
    """[textures, F]."""
    clusters: int
    bound: int
    """Largest number of textures in a group; `clusters` groups of this size hold all textures."""
    spread_limit: float = np.inf
    """Largest spread of a result. The search may pass through groupings with more."""

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
    """The groupings of all chains, and the change of cost of every move.

    Arrays have the chain as first axis. A set is a distinct set of textures that share blocks (SeenBlocks).
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
        # Sets of each texture, padded with a set of weight 0.
        columns = members.tocsc()
        longest = int(np.diff(columns.indptr).max(initial=0))
        self._sets_of = np.full((textures, longest), members.shape[0], np.int64)
        for texture in range(textures):
            sets = columns.indices[columns.indptr[texture] : columns.indptr[texture + 1]]
            self._sets_of[texture, : len(sets)] = sets
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
        explained = ((self._sums**2).sum(axis=2) / np.maximum(self.sizes, 1.0)).sum(axis=1)
        self.spread = self._squares.sum() - explained

    def _add(self, textures: Groups, groups: Groups, sign: int) -> None:
        self._counts[self._chain[:, None], groups[:, None], self._sets_of[textures]] += np.int16(sign)
        self.sizes[self._chain, groups] += sign
        self._sums[self._chain, groups] += sign * self._features[textures]

    def _refresh(self, chains: Groups, groups: Groups) -> None:
        """Compute for each texture the change of cost of joining and leaving group `groups`[i] of chain `chains`[i]."""
        counts = self._counts[chains, groups, :-1]
        # A set gains a decoder with its first texture of a group, and loses it with the last.
        self._joins[chains, groups] = self._seen_with - (self._weighted @ (counts > 0).T).T
        self._leaves[chains, groups] = (self._weighted @ (counts == 1).T).T
        means = self._sums[chains, groups] / np.maximum(self.sizes[chains, groups], 1.0)[:, None]
        self._away[chains, groups] = self._squares - 2.0 * means @ self._features.T + (means**2).sum(axis=1)[:, None]

    def changes(self) -> tuple[Floats, Floats]:
        """Return the changes of excess and of spread, [chains, clusters, textures] each, if a texture moves to a group."""
        chain, texture = self._chain[:, None], np.arange(self.groups.shape[1])[None]
        excess = self._joins - self._leaves[chain, self.groups, texture][:, None, :]
        size = self.sizes[chain, self.groups]
        loss = self._away[chain, self.groups, texture] * size / np.maximum(size - 1.0, 1.0) * (size > 1.0)
        spread = self._away * (self.sizes / (self.sizes + 1.0))[:, :, None] - loss[:, None, :]
        return excess, spread

    def move(self, textures: Groups, groups: Groups) -> Groups:
        """Move texture `textures`[i] of chain i to group `groups`[i]. Return the groups that the textures left."""
        left = self.groups[self._chain, textures]
        self._add(textures, left, -1)
        self._add(textures, groups, 1)
        self.groups[self._chain, textures] = groups
        self._refresh(np.tile(self._chain, 2), np.concatenate([left, groups]))
        return left


def _adapted(penalty: Floats, within: NDArray[np.bool_]) -> Floats:
    return np.clip(np.where(within, penalty / PENALTY_STEP, penalty * PENALTY_STEP), 1e-4, 100.0)


def tabu_search(
    problem: SearchProblem, starts: Groups, weights: Floats, iterations: int, random: np.random.Generator
) -> tuple[Floats, Groups]:
    """Return the best cost [chains] and groups [chains, textures] of each chain, within the bound and the spread limit.

    `starts` [chains, textures] are the initial groups; `weights` [chains] the weights of spread against excess. A chain without a
    grouping within the limits has an infinite cost.
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

    def record_better(cost: Floats, within: NDArray[np.bool_]) -> None:
        better = within & (state.spread <= problem.spread_limit) & (cost < best_cost - SMALLEST_GAIN)
        best_cost[better] = cost[better]
        best[better] = state.groups[better]

    cost = state.excess * excess_scale + state.spread * spread_scale
    record_better(cost, state.sizes.max(axis=1) <= problem.bound)
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
        # A forbidden move is allowed if it gives the best cost so far (aspiration).
        aspired = change < (best_cost - cost)[:, None, None] - SMALLEST_GAIN
        change[(forbidden_until > iteration) & ~aspired] = np.inf
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
        record_better(cost, within)
    return best_cost, best


SPREAD_WEIGHTS_UNDER_A_LIMIT = (0.01, 4.0)
"""Range of the weights of spread, from the first chain to the last, if spread has a limit."""
LARGEST_WORK = 2.0e9
"""Approximate number of elementary steps after which a search ends early: a thousand textures take a minute."""


@dataclass(frozen=True)
class CovisibleConfig:
    """Options of the search for `covisible` groups."""

    clusters: int = 10
    largest_share: float = 0.2
    """Largest share of the textures in one group, rounded down; more if `clusters` groups could not hold all textures."""
    spread_weight: float = 0.3
    """Weight of the spread of features within groups against excess, both relative to their worst value."""
    spread_limit: float | None = None
    """Largest spread. If given, the least excess within it is searched, and `spread_weight` is unused."""
    chains: int = 24
    """Searches side by side, with different starts."""
    iterations: int = 2000
    """Moves of each chain."""
    seed: int = 0


def merged_start(seen: SeenBlocks, textures: int, clusters: int, bound: int) -> Groups:
    """Return [textures] groups by bottom-up merging: from a group per texture, join the two groups that share most blocks, and
    repeat."""
    weighted = seen.members.multiply(seen.weights[:, None]).tocsr()
    shared_blocks = np.asarray((weighted.T @ seen.members).todense())
    np.fill_diagonal(shared_blocks, 0.0)
    groups = np.arange(textures)
    alive = list(range(textures))
    sizes = np.ones(textures, np.int64)
    while len(alive) > clusters:
        part = shared_blocks[np.ix_(alive, alive)]
        both = sizes[alive][:, None] + sizes[alive][None, :]
        fits = both <= bound
        np.fill_diagonal(fits, False)
        if not fits.any():
            break
        # Among equals, small groups first: the bound stops fewer merges.
        score = np.where(fits, part - 1e-6 * both, -np.inf)
        a, b = np.unravel_index(int(np.argmax(score)), score.shape)
        target, source = alive[min(a, b)], alive[max(a, b)]
        shared_blocks[target] += shared_blocks[source]
        shared_blocks[:, target] += shared_blocks[:, source]
        sizes[target] += sizes[source]
        groups[groups == source] = target
        alive.remove(source)
    numbers = {old: new for new, old in enumerate(alive)}
    merged = np.array([numbers[group] for group in groups.tolist()], np.int64)
    # If the bound left too many groups, the textures of the last ones go to the smallest others.
    for texture in np.nonzero(merged >= clusters)[0]:
        merged[texture] = int(np.argmin(np.bincount(merged[merged < clusters], minlength=clusters)))
    return merged


def _starts(problem: SearchProblem, chains: int, given: Groups | None, random: np.random.Generator) -> Groups:
    """Return [chains, textures] starts, in turn: the merged groups, the given ones if any, and two random ones."""
    textures = len(problem.features)
    merged = merged_start(problem.seen, textures, problem.clusters, problem.bound)
    starts = np.stack([random.permutation(np.arange(textures) % problem.clusters) for _ in range(chains)])
    starts[::4] = merged
    if given is not None:
        starts[1::4] = given
    return starts


def largest_group(textures: int, clusters: int, largest_share: float) -> int:
    """Return the largest number of textures in a group: `largest_share` of them, but enough that `clusters` groups hold all."""
    return max(int(largest_share * textures), -(-textures // clusters), 1)


def covisible_grouping(
    seen: SeenBlocks, features: Floats, config: CovisibleConfig, start: NDArray[np.int64] | None = None
) -> Grouping:
    """Return the grouping of least cost over all chains.

    `seen` is what the views show, `features` [textures, F] how similar textures are. `start` [textures] are initial groups of some
    chains. The same seed gives the same groups. Raises InputError if no block shows two textures, and if no chain met a grouping
    within the bound and the spread limit.
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
        costs = np.where(np.isfinite(costs), [seen.excess(each) for each in groups], np.inf)
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
