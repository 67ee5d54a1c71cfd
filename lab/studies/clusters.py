"""How divergence and likeness depend on the number of decoders: the sensitivity analysis that the paper leaves open."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import FeatureName
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.grouping.category import category_grouping
from ntc.grouping.clustered import clustered_grouping, random_grouping
from ntc.grouping.covisible import CovisibleConfig, SeenBlocks, covisible_grouping, feature_spread
from ntc.metrics.divergence import cut_percent
from viewer.cli.table import Cell, Column, Table

Groups = NDArray[np.int64]
Floats = NDArray[np.float64]

RANDOM_SEEDS = 10
"""Number of random groupings that are averaged."""
SPREAD_LIMITS = {"covisible, as alike as clustered": 1.0, "covisible, spread 1.5 x clustered": 1.5}
"""covisible with at most so many times the feature spread of clustered, and without a bound on the size of groups."""


@dataclass(frozen=True, eq=False)
class Fold:
    """Views split into those that groups may be chosen by, and those that they are judged by."""

    seen: SeenBlocks
    """Views that covisible optimises for."""
    held_out: SeenBlocks
    """Views that groupings are judged by."""


@dataclass(frozen=True)
class ClusterStudyConfig:
    """Settings of the study."""

    counts: tuple[int, ...] = (1, 2, 5, 10, 20)
    """Numbers of groups; those above the number of textures are left out, and the number of textures is added."""
    spread_weight: float = CovisibleConfig.spread_weight
    largest_share: float = CovisibleConfig.largest_share
    seed: int = 0

    def __post_init__(self) -> None:
        for count in self.counts:
            if count < 1:
                raise InputError(f"--clusters {count}: must be at least 1")


@dataclass(frozen=True)
class ClusterRow:
    """One grouping with one number of groups. Excess and cuts are means over the folds."""

    grouping: str
    features: str | None
    """Features that textures were compared by; None where they were not."""
    groups: int
    largest_group: int
    seen_cut_percent: float | None
    """How much less excess than with a decoder for each texture, on the views that covisible optimises for."""
    held_out_cut_percent: float | None
    """The same on the held-out views."""
    held_out_excess: float
    spread_percent: float | None
    """Spread of the features inside groups, as a share of that of all textures together; of the row's own features,
    else of the first ones."""
    seconds: float
    """Time to find the groups, without that of the features."""
    psnr_db: float | None = None
    """Mean over the textures, of packs."""


COLUMNS = (
    Column("grouping", "grouping"),
    Column("features", "features"),
    Column("groups", "groups"),
    Column("largest_group", "largest group"),
    Column("seen_cut_percent", "cut, seen views %", 1),
    Column("held_out_cut_percent", "cut, held-out views %", 1),
    Column("held_out_excess", "excess, held-out", 0),
    Column("spread_percent", "feature spread %", 1),
    Column("psnr_db", "PSNR dB", 2),
    Column("seconds", "s", 2),
)


def cluster_table(rows: Sequence[ClusterRow]) -> Table:
    """The rows as a table."""
    dictionaries: list[Mapping[str, Cell]] = [asdict(row) for row in rows]
    return Table(COLUMNS, dictionaries)


@dataclass(frozen=True, eq=False)
class EncodedGrouping:
    """The grouping of a pack."""

    name: str
    groups: tuple[int, ...]
    psnr_db: float | None
    """Mean over its textures."""


class _Judge:
    """Measures groups on all folds."""

    def __init__(self, folds: Sequence[Fold], features: Mapping[FeatureName, Floats]) -> None:
        self._folds, self._features = folds, features
        self._first: FeatureName = next(iter(features))
        textures = len(next(iter(features.values())))
        apart = np.arange(textures)
        self._worst = [(fold.seen.excess(apart), fold.held_out.excess(apart)) for fold in folds]
        self._whole = {name: feature_spread(matrix, np.zeros(textures, np.int64)) for name, matrix in features.items()}

    def row(
        self,
        grouping: str,
        features: FeatureName | None,
        found: Sequence[Groups],
        seconds: float,
        psnr_db: float | None = None,
    ) -> ClusterRow:
        """`found`: as many groups as there are folds, or a multiple: several tries, fold by fold."""
        seen, held_out, spreads, sizes = [], [], [], []
        excess = []
        measured_by = features if features is not None else self._first
        for number, groups in enumerate(found):
            fold, worst = number % len(self._folds), self._worst[number % len(self._folds)]
            seen.append(cut_percent(self._folds[fold].seen.excess(groups), worst[0]))
            held = self._folds[fold].held_out.excess(groups)
            excess.append(held)
            held_out.append(cut_percent(held, worst[1]))
            spreads.append(feature_spread(self._features[measured_by], groups))
            sizes.append(np.bincount(groups))
        whole = self._whole[measured_by]
        return ClusterRow(
            grouping=grouping,
            features=features,
            groups=max(int(np.count_nonzero(size)) for size in sizes),
            largest_group=max(int(size.max()) for size in sizes),
            seen_cut_percent=_mean(seen),
            held_out_cut_percent=_mean(held_out),
            held_out_excess=float(np.mean(excess)),
            spread_percent=100.0 * float(np.mean(spreads)) / whole if whole > 0.0 else None,
            seconds=seconds / len(found),
            psnr_db=psnr_db,
        )


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _timed(make: Callable[[], Grouping]) -> tuple[Groups, float]:
    began = time.perf_counter()
    grouping = make()
    return np.array(grouping.groups, np.int64), time.perf_counter() - began


def cluster_study(
    textures: Sequence[SourceTexture],
    features: Mapping[FeatureName, Floats],
    folds: Sequence[Fold],
    config: ClusterStudyConfig,
    packs: Sequence[EncodedGrouping] = (),
    progress: Callable[[int, int], None] = lambda _done, _whole: None,
) -> tuple[ClusterRow, ...]:
    """Every grouping with every number of groups, measured on views it was chosen by and on views it was not.

    `features` [textures, F] by name, at least one. Raises InputError for folds whose views show no two textures together.
    """
    if any(not len(part.weights) for fold in folds for part in (fold.seen, fold.held_out)):
        raise InputError("--views: half of the views show no block with two textures; there is nothing to measure")
    counts = sorted({*(count for count in config.counts if count < len(textures)), len(textures)})
    judge = _Judge(folds, features)
    apart = np.arange(len(textures))
    rows = [judge.row("baseline", None, [apart] * len(folds), 0.0)]
    categories, seconds = _timed(lambda: category_grouping(textures))
    rows.append(judge.row("category", None, [categories] * len(folds), seconds * len(folds)))
    whole, done = len(counts) * len(features), 0
    for count in counts:
        for name, matrix in features.items():
            rows += _with_features(name, matrix, count, judge, folds, config, random=name == next(iter(features)))
            done += 1
            progress(done, whole)
    for pack in packs:
        groups = np.array(pack.groups, np.int64)
        rows.append(judge.row(f"pack {pack.name}", None, [groups] * len(folds), 0.0, pack.psnr_db))
    return tuple(rows)


def _with_features(
    name: FeatureName,
    matrix: Floats,
    count: int,
    judge: _Judge,
    folds: Sequence[Fold],
    config: ClusterStudyConfig,
    random: bool,
) -> list[ClusterRow]:
    clustered_at = time.perf_counter()
    clustered = clustered_grouping(matrix, name, count, config.seed)
    clustered_seconds = time.perf_counter() - clustered_at
    alike = np.array(clustered.groups, np.int64)
    rows = []
    if random:
        tries = [
            np.array(random_grouping(clustered, seed).groups, np.int64)
            for seed in range(config.seed, config.seed + RANDOM_SEEDS)
            for _ in folds
        ]
        rows.append(judge.row("random", None, tries, 0.0))
    rows.append(judge.row("clustered", name, [alike] * len(folds), clustered_seconds * len(folds)))
    search = CovisibleConfig(
        clusters=count, largest_share=config.largest_share, spread_weight=config.spread_weight, seed=config.seed
    )
    spread = feature_spread(matrix, alike) * (1.0 + 1e-9)
    limited = {
        title: replace(search, largest_share=1.0, spread_limit=times * spread) for title, times in SPREAD_LIMITS.items()
    }
    for title, settings in {"covisible": search, **limited}.items():
        if count in (1, len(matrix)):
            # Nothing to choose.
            continue
        found, seconds = [], 0.0
        for fold in folds:
            groups, took = _timed(partial(covisible_grouping, fold.seen, matrix, settings, start=alike))
            found.append(groups)
            seconds += took
        rows.append(judge.row(title, name, found, seconds))
    return rows
