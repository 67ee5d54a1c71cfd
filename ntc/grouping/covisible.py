"""Grouping by what is seen together: the groups with the least measured excess over a set of views."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.grouping.order import in_order_of_appearance
from ntc.grouping.seen_blocks import SeenBlocks
from ntc.pack import Grouping

Array = NDArray[np.float64]
Groups = NDArray[np.int64]


@dataclass(frozen=True)
class CovisibleConfig:
    """How groups are searched."""

    clusters: int = 10
    largest_share: float = 0.2
    """No group holds more than this share of the textures (rounded up), unless `clusters` groups cannot hold them all."""
    spread_weight: float = 0.1
    """Weight of the spread of features inside groups, against excess; both relative to their worst."""
    starts: int = 6
    kicks: int = 20
    """Times that each start's result is disturbed and improved again."""
    seed: int = 0


class _Objective:
    """Excess and feature spread of groups, and how single moves change them."""

    def __init__(self, seen: SeenBlocks, features: Array, config: CovisibleConfig) -> None:
        textures = len(features)
        self._seen = seen
        self._weighted = seen.members.multiply(seen.weights[:, None]).tocsr()
        self._seen_with = np.asarray(self._weighted.sum(axis=0)).reshape(-1)
        self._features = features
        self.clusters = config.clusters
        self.bound = max(int(np.ceil(config.largest_share * textures)), -(-textures // config.clusters))
        worst_excess = seen.excess(np.arange(textures))
        worst_spread = float(((features - features.mean(axis=0)) ** 2).sum()) if textures else 0.0
        self._excess_scale = 1.0 / worst_excess if worst_excess > 0.0 else 0.0
        self._spread_scale = config.spread_weight / worst_spread if worst_spread > 0.0 else 0.0

    def together(self) -> Array:
        """[textures, textures] blocks in which two textures are seen together; 0 on the diagonal."""
        pairs = np.asarray((self._weighted.T @ self._seen.members).todense())
        np.fill_diagonal(pairs, 0.0)
        return pairs

    def counts(self, groups: Groups) -> Array:
        """[sets, clusters] textures of each set in each group."""
        choice = np.zeros((len(groups), self.clusters))
        choice[np.arange(len(groups)), groups] = 1.0
        return np.asarray(self._seen.members @ choice)

    def cost(self, groups: Groups) -> float:
        """What is minimised."""
        spread = 0.0
        for group in range(self.clusters):
            inside = self._features[groups == group]
            if len(inside):
                spread += float(((inside - inside.mean(axis=0)) ** 2).sum())
        return self._seen.excess(groups) * self._excess_scale + spread * self._spread_scale

    def moves(self, groups: Groups) -> Array:
        """[textures, clusters] change of the cost when one texture moves to a group; infinite where that is full."""
        counts = self.counts(groups)
        everyone = np.arange(len(groups))
        # A set loses a decoder where the texture was its group's last member there, and gains one where it is the first.
        joins = self._seen_with[:, None] - self._weighted.T @ (counts > 0.0)
        leaves = (self._weighted.T @ (counts == 1.0))[everyone, groups]
        change = (joins - leaves[:, None]) * self._excess_scale + self._spread_moves(groups)
        sizes = np.bincount(groups, minlength=self.clusters)
        change[:, sizes >= self.bound] = np.inf
        change[everyone, groups] = 0.0
        return np.asarray(change)

    def _spread_moves(self, groups: Groups) -> Array:
        sizes = np.bincount(groups, minlength=self.clusters).astype(np.float64)
        sums = np.zeros((self.clusters, self._features.shape[1]))
        np.add.at(sums, groups, self._features)
        means = sums / np.maximum(sizes, 1.0)[:, None]
        away = ((self._features[:, None, :] - means[None]) ** 2).sum(axis=2)
        own = sizes[groups]
        loss = away[np.arange(len(groups)), groups] * own / np.maximum(own - 1.0, 1.0) * (own > 1.0)
        gain = away * (sizes / (sizes + 1.0))
        return (gain - loss[:, None]) * self._spread_scale


SMALLEST_GAIN = 1e-12
SWAPS_TRIED = 24


def _best_swap(objective: _Objective, groups: Groups, cost: float) -> tuple[Groups, float] | None:
    """The best of the most promising exchanges of two textures, if it helps."""
    # Moves into full groups are forbidden alone, not as one half of a swap.
    unbounded = objective.moves(groups)
    relaxed = np.where(np.isfinite(unbounded), unbounded, 0.0)
    into = relaxed[:, groups]
    promise = into + into.T
    promise[groups[:, None] == groups[None, :]] = np.inf
    upper = np.triu_indices(len(groups), 1)
    if not len(upper[0]):
        return None
    order = np.argsort(promise[upper], kind="stable")[:SWAPS_TRIED]
    best: tuple[Groups, float] | None = None
    for pair in order:
        first, second = int(upper[0][pair]), int(upper[1][pair])
        if not np.isfinite(promise[first, second]):
            break
        swapped = groups.copy()
        swapped[first], swapped[second] = groups[second], groups[first]
        value = objective.cost(swapped)
        if value < (best[1] if best else cost) - SMALLEST_GAIN:
            best = swapped, value
    return best


def _descend(objective: _Objective, groups: Groups) -> tuple[Groups, float]:
    """Best moves, then best swaps, until neither helps."""
    groups, cost = groups.copy(), objective.cost(groups)
    while True:
        change = objective.moves(groups)
        texture, group = np.unravel_index(int(np.argmin(change)), change.shape)
        if change[texture, group] < -SMALLEST_GAIN:
            groups[texture] = group
            cost = objective.cost(groups)
            continue
        swap = _best_swap(objective, groups, cost)
        if swap is None:
            return groups, cost
        groups, cost = swap


def _merged(objective: _Objective, textures: int) -> Groups:
    """A start from below: every texture alone, then again and again the two groups whose union saves most."""
    groups = np.arange(textures)
    together = objective.together()
    alive = list(range(textures))
    sizes = np.ones(textures, np.int64)
    while len(alive) > objective.clusters:
        part = together[np.ix_(alive, alive)]
        fits = sizes[alive][:, None] + sizes[alive][None, :] <= objective.bound
        np.fill_diagonal(fits, False)
        if not fits.any():
            break
        # Small groups first among equals, so that the bound does not stop the merging.
        score = np.where(fits, part - 1e-6 * (sizes[alive][:, None] + sizes[alive][None, :]), -np.inf)
        a, b = np.unravel_index(int(np.argmax(score)), score.shape)
        keep, gone = alive[min(a, b)], alive[max(a, b)]
        together[keep] += together[gone]
        together[:, keep] += together[:, gone]
        sizes[keep] += sizes[gone]
        groups[groups == gone] = keep
        alive.remove(gone)
    numbers = {old: new for new, old in enumerate(alive)}
    merged = np.array([numbers[group] for group in groups.tolist()], np.int64)
    # Where the bound left more groups than asked for, the smallest ones are spread over those with room.
    for group in range(objective.clusters, len(alive)):
        for texture in np.nonzero(merged == group)[0]:
            room = np.bincount(merged[merged < objective.clusters], minlength=objective.clusters)
            merged[texture] = int(np.argmin(room))
    return merged


def _shuffled(random: np.random.Generator, textures: int, clusters: int) -> Groups:
    return random.permutation(np.arange(textures) % clusters)


def covisible_grouping(seen: SeenBlocks, features: Array, config: CovisibleConfig) -> Grouping:
    """The best groups found by descents from several starts, each disturbed and improved again many times.

    `features` [textures, F] describe how alike textures are; `seen` what the views show. The same seed gives the same
    groups. Raises InputError where the views show no block with two textures.
    """
    textures = len(features)
    if not len(seen.weights):
        raise InputError("--views: no block of any view shows two textures; there is nothing to group by")
    objective = _Objective(seen, features, replace(config, clusters=min(config.clusters, textures)))
    random = np.random.default_rng(config.seed)
    starts = [_merged(objective, textures)]
    starts += [_shuffled(random, textures, objective.clusters) for _ in range(config.starts - 1)]
    results = sorted((_descend(objective, start) for start in starts), key=lambda result: result[1])
    best, best_cost = results[0]
    for kick in range(config.kicks * len(results)):
        # Half of the disturbances start from the best, so that the others keep their chance.
        source = best if kick % 2 == 0 else results[kick % len(results)][0]
        disturbed = source.copy()
        chosen = random.choice(textures, size=max(2, textures // 8), replace=False)
        disturbed[chosen] = disturbed[random.permutation(chosen)]
        groups, cost = _descend(objective, disturbed)
        if cost < best_cost - SMALLEST_GAIN:
            best, best_cost = groups, cost
    parameters = {
        "clusters": config.clusters,
        "largest_share": config.largest_share,
        "spread_weight": config.spread_weight,
        "seed": config.seed,
        "excess": seen.excess(best),
        "baseline_excess": seen.excess(np.arange(textures)),
    }
    return Grouping("covisible", in_order_of_appearance(best.tolist()), parameters)
