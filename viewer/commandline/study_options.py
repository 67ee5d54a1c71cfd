"""Options of `ntc-viewer study NAME`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from ntc.config import FeatureName, GroupingConfig
from viewer.commandline.options import OptionalScene, Packs


@dataclass(frozen=True)
class ClusterStudyOptions:
    """How divergence and likeness depend on the number of decoders, for every grouping: table, CSV, JSON and plot."""

    out: Path
    """Folder for clusters.md, clusters.csv, clusters.json and clusters.png."""
    scene: OptionalScene = None
    """glTF scene. None: the built-in courtyard."""
    pack: Packs = ()
    """Packs to measure besides those found beside the scene (NAME.*.ntc)."""
    clusters: tuple[int, ...] = (1, 2, 5, 10, 20)
    """Numbers of groups to try; one group for each texture is added."""
    features: tuple[FeatureName, ...] = ("low_level", "spectral")
    """What textures are compared by: each in turn."""
    clip_weights: Annotated[str | None, tyro.conf.arg(metavar="FILE|download")] = None
    """Weights of --features clip: a file, or "download" to fetch them."""
    views: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """JSON file of cameras; every other one is held out. None: the scene's own cameras."""
    sampled_views: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Look from this many places sampled in the scene too. None: 24 where there are no cameras."""
    spread_weight: float = GroupingConfig.spread_weight
    """covisible: how much it counts that textures of a group are alike, against divergence."""
    largest_share: float = GroupingConfig.largest_share
    """covisible: no group holds more than this share of the textures."""
    texture_size: int = 256
    """Textures are reduced to at most this many texels a side before they are compared."""
    seed: int = 0
    """Seed of groupings and sampled places."""
