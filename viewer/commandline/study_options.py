"""Options of `ntc-viewer study NAME`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ntc.config import FeatureName, GroupingConfig
from ntc.studies.ablation_config import AblationConfig
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


@dataclass(frozen=True)
class AblationStudyOptions:
    """What each part of the recipe is worth, at equal samples: table, CSV, JSON and plot. Stopped, it goes on where it was."""

    source: Annotated[Path, tyro.conf.arg(metavar="SCENE|FOLDER"), tyro.conf.Positional]
    """glTF scene, or a folder of images."""
    out: Path
    """Folder for ablation.md, .csv, .json and .png, and for the finished runs."""
    clusters: int | None = None
    """Decoders, by k-means over low-level features. None: 10, or one for each texture where there are fewer."""
    steps: int = AblationConfig.steps
    """Optimisation steps of each run."""
    texels_per_texture: int = AblationConfig.texels_per_texture
    """Samples of each texture in a step."""
    texture_size: int = 256
    """Textures are reduced to at most this many texels a side."""
    levels: int | None = AblationConfig.levels
    """Latent levels; 1: mip 0 alone as in the paper, None: all mips."""
    seeds: tuple[int, ...] = AblationConfig.seeds
    """Seeds; figures are means over them."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where to train."""
