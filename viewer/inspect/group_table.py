"""The groups of a pack as a table: who is in them, how well they decode, how alike they are."""

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
from viewer.locations import features_cache
from viewer.scene.model import Scene
from viewer.scene.source_textures import source_textures

QUICK_FEATURES = ("low_level", "spectral")
"""Those that need neither a network nor its weights."""


@dataclass(frozen=True)
class GroupRow:
    """One group, as far as the scene has textures of it."""

    group: int
    members: tuple[int, ...]
    """Texture ids of the scene."""
    psnr_db: float | None
    """PSNR in dB of the mean square error of the members' mip 0, as encoders and training report it."""
    worst_db: float | None
    """The least PSNR of a member's mip 0."""
    absent: int
    """Textures of the group in the pack that the scene does not have."""
    before_db: float | None = None
    """`psnr_db` of the same textures in the pack that this one replaced; None where that is not known."""


def _psnr_db(pack: Pack, match: PackMatch, members: Iterable[int]) -> list[float] | None:
    """PSNR in dB of mip 0 of textures of the scene; None where it is not known of all."""
    indices = [match.texture_index[texture] for texture in members]
    found = [pack.textures[index].psnr_db if index >= 0 else None for index in indices]
    known = [value for value in found if value is not None]
    return known if known and len(known) == len(found) else None


def _together(values: Sequence[float] | None) -> float | None:
    return None if values is None else psnr_of_mse(float(np.mean([mse_of_psnr(value) for value in values])))


def group_rows(pack: Pack, match: PackMatch, before: tuple[Pack, PackMatch] | None = None) -> tuple[GroupRow, ...]:
    """All groups of `pack` by their number; `before` is the pack that it replaced."""
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
