"""Table of a pack's groups: their members, the PSNR, and the distances of members from their centroid."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import FeatureName
from ntc.codec.model import Pack
from ntc.codec.quality import mse_of_psnr, psnr_of_mse
from ntc.features import FeatureOptions, feature_matrix
from ntc.pack.match import PackMatch
from viewer.jobs.job import JobReport
from viewer.locations import cache_folder
from viewer.scene.model import Scene
from viewer.scene.source_textures import has_source, source_texture

QUICK_FEATURES = ("low_level", "spectral")
"""Features that need no network."""


@dataclass(frozen=True)
class GroupRow:
    """Group with its textures in the scene."""

    group: int
    members: tuple[int, ...]
    """Texture ids of the members in the scene."""
    psnr_db: float | None
    """PSNR in dB of the mean square error of the members' mip 0, as encoders and training report it."""
    worst_db: float | None
    """Lowest PSNR of a member's mip 0, in dB."""
    absent: int
    """Number of textures of the group that are not in the scene."""
    before_db: float | None = None
    """PSNR in dB of the same textures in the pack that this one replaced; None where it is unknown."""


def _psnr_db(pack: Pack, match: PackMatch, members: Iterable[int]) -> list[float] | None:
    """Return the PSNR in dB of mip 0 of textures of the scene; None where one is unknown."""
    indices = [match.texture_index[texture] for texture in members]
    values = [pack.textures[index].psnr_db if index >= 0 else None for index in indices]
    known_values = [value for value in values if value is not None]
    return known_values if known_values and len(known_values) == len(values) else None


def _together(decibels: Sequence[float] | None) -> float | None:
    return None if decibels is None else psnr_of_mse(float(np.mean([mse_of_psnr(value) for value in decibels])))


def group_rows(pack: Pack, match: PackMatch, before: tuple[Pack, PackMatch] | None = None) -> tuple[GroupRow, ...]:
    """Return all groups of `pack` by number; `before` is the pack that it replaced."""
    members: defaultdict[int, list[int]] = defaultdict(list)
    for texture_id, group in enumerate(match.decoders(pack)):
        if group >= 0:
            members[group].append(texture_id)
    sizes = np.bincount([texture.group for texture in pack.textures], minlength=len(pack.decoders)).tolist()
    rows: list[GroupRow] = []
    for group in range(len(pack.decoders)):
        values = _psnr_db(pack, match, members[group])
        replaced = _psnr_db(*before, members[group]) if before is not None else None
        rows.append(
            GroupRow(
                group=group,
                members=tuple(members[group]),
                psnr_db=_together(values),
                worst_db=min(values) if values else None,
                absent=sizes[group] - len(members[group]),
                before_db=_together(replaced),
            )
        )
    return tuple(rows)


@dataclass(frozen=True)
class GroupDistances:
    """Distance of each texture from the centroid of its group, in feature space."""

    features: FeatureName
    grouped_by: str
    """Features that the pack was grouped by, where those need a network; "" where they are `features`."""
    by_texture: Mapping[int, float]
    """Euclidean distances by texture id."""

    def caption(self) -> str:
        """Return a description of the distances."""
        actual = f" (grouped by {self.grouped_by})" if self.grouped_by else ""
        return f"distance to the group's centroid in {self.features} features{actual}"


def grouping_features(pack: Pack) -> tuple[FeatureName, str] | None:
    """Return the features that measure distances, and the name of the features that they replace, "" where there is no replacement.

    Features that need a network are replaced, because they take too long. Returns None where the pack was not grouped by features.
    """
    named = pack.grouping.parameters.get("features")
    if not isinstance(named, str):
        return None
    return (cast(FeatureName, named), "") if named in QUICK_FEATURES else ("low_level", named)


def centroid_distances(features: NDArray[np.float64], groups: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the Euclidean distance [N] of each row of `features` [N, F] to the mean of its group in `groups` [N]."""
    distances = np.zeros(len(features))
    for group in np.unique(groups):
        members = groups == group
        centroid = features[members].mean(axis=0)
        distances[members] = np.linalg.norm(features[members] - centroid, axis=1)
    return distances


def group_distances(
    scene: Scene, decoders: tuple[int, ...], features: FeatureName, grouped_by: str, report: JobReport
) -> GroupDistances:
    """Return the distances of all decoded textures (a job). `decoders` is by texture id, -1 for none."""
    decoded = [texture for texture, decoder in enumerate(decoders) if decoder >= 0]
    options = FeatureOptions(cache=cache_folder("features"), progress=report.progress)
    sources = [
        source_texture(scene, texture, None, "base" if has_source(scene.textures[texture], "base") else "all")
        for texture in decoded
    ]
    matrix = feature_matrix(features, sources, options)
    distances = centroid_distances(matrix, np.array([decoders[texture] for texture in decoded], np.int64))
    return GroupDistances(features, grouped_by, dict(zip(decoded, distances.tolist(), strict=True)))
