"""The groups of a pack as a table: who is in them, how well they decode, how alike they are."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import FeatureName
from ntc.codec.model import Pack
from ntc.features import FeatureOptions, feature_matrix
from ntc.pack.match import PackMatch
from viewer.jobs.job import JobReport
from viewer.locations import features_cache
from viewer.scene.model import Scene
from viewer.scene.source_textures import source_textures

QUICK_FEATURES = ("low_level", "spectral")
"""Those that need neither a network nor its weights."""

GroupColumn = Literal["group", "members", "mean dB", "worst dB"]


@dataclass(frozen=True)
class GroupRow:
    """One group, as far as the scene has textures of it."""

    group: int
    members: tuple[int, ...]
    """Texture ids of the scene."""
    mean_db: float | None
    """Mean of the members' PSNR in dB."""
    worst_db: float | None
    absent: int
    """Textures of the group in the pack that the scene does not have."""


def group_rows(pack: Pack, match: PackMatch) -> tuple[GroupRow, ...]:
    """All groups of `pack` by their number."""
    members: defaultdict[int, list[int]] = defaultdict(list)
    for texture_id, group in enumerate(match.decoders(pack)):
        if group >= 0:
            members[group].append(texture_id)
    sizes = np.bincount([texture.group for texture in pack.textures], minlength=len(pack.decoders)).tolist()
    rows: list[GroupRow] = []
    for group in range(len(pack.decoders)):
        of_group = [pack.textures[match.texture_index[texture]].psnr_db for texture in members[group]]
        values = [value for value in of_group if value is not None]
        rows.append(
            GroupRow(
                group,
                tuple(members[group]),
                float(np.mean(values)) if values else None,
                min(values) if values else None,
                sizes[group] - len(members[group]),
            )
        )
    return tuple(rows)


@dataclass(frozen=True)
class GroupDistances:
    """How far each texture is from the middle of its group."""

    features: FeatureName
    grouped_by: str
    """The features that the pack was grouped by, where those need a network; "" where they are the same."""
    by_texture: Mapping[int, float]
    """Euclidean, by texture id."""

    def caption(self) -> str:
        """What the numbers are."""
        actual = f" (grouped by {self.grouped_by})" if self.grouped_by else ""
        return f"distance to the group's centroid in {self.features} features{actual}"


def grouping_features(pack: Pack) -> tuple[FeatureName, str] | None:
    """Features to measure distances in, and the name of those that they replace; "" where they are the same.

    None where the pack does not name features that grouped it.
    """
    named = pack.grouping.parameters.get("features")
    if not isinstance(named, str):
        return None
    return (cast(FeatureName, named), "") if named in QUICK_FEATURES else ("low_level", named)


def centroid_distances(features: NDArray[np.float64], groups: NDArray[np.int64]) -> NDArray[np.float64]:
    """[N] Euclidean distance of each row of `features` [N, F] to the mean of the rows of its group, `groups` [N]."""
    distances = np.zeros(len(features))
    for group in np.unique(groups):
        of_group = groups == group
        centroid = features[of_group].mean(axis=0)
        distances[of_group] = np.linalg.norm(features[of_group] - centroid, axis=1)
    return distances


def group_distances(
    scene: Scene, decoders: tuple[int, ...], features: FeatureName, grouped_by: str, report: JobReport
) -> GroupDistances:
    """A job: distances of all textures that are decoded. `decoders` is by texture id, -1 for none."""
    held = [texture for texture, decoder in enumerate(decoders) if decoder >= 0]
    textures = source_textures(scene, None)
    options = FeatureOptions(cache=features_cache(), progress=report.progress)
    matrix = feature_matrix(features, [textures[texture] for texture in held], options)
    distances = centroid_distances(matrix, np.array([decoders[texture] for texture in held], np.int64))
    return GroupDistances(features, grouped_by, dict(zip(held, distances.tolist(), strict=True)))
