"""Names and settings that all codecs share: frozen dataclasses, one definition for CLI, pack, settings file and UI."""

from dataclasses import dataclass
from typing import Final, Literal

WrapMode = Literal["repeat", "mirror", "clamp"]
ColorSpace = Literal["srgb", "linear"]
GroupingName = Literal["baseline", "single", "random", "category", "clustered", "covisible", "universal"]
FeatureName = Literal["low_level", "spectral", "efficientnet", "clip"]
Precision = Literal["fp32", "fp16", "fp16-arithmetic", "fp16-accumulate"]
"""Numbers that are rounded to half precision: none; stored weights; products as well; sums as well."""
PrecisionChoice = Literal["auto", "fp32", "fp16", "fp16-arithmetic", "fp16-accumulate"]
"""A precision, or the cheapest one without a visible difference (`ntc.codec.grid.accuracy.precision_choice`)."""
LARGEST_HALF = 65504.0
"""Largest finite half."""
UNIVERSAL: Final = "universal"
"""The grouping whose one decoder ships with the program and never saw the scene."""


@dataclass(frozen=True)
class GroupingConfig:
    """Choice of the textures that share a decoder. Fields that a grouping does not need have no effect."""

    name: GroupingName = "clustered"
    clusters: int | None = None
    """Groups of clustered, random and covisible. None: 10, or one for each texture where there are fewer."""
    features: FeatureName = "low_level"
    """Features by which clustered compares textures, and which covisible keeps alike."""
    spread_weight: float = 0.3
    """covisible: weight of the spread of features inside groups against excess, both relative to their worst."""
    largest_share: float = 0.2
    """covisible: no group holds more than this share of the textures, unless there are too few groups to hold all."""
    seed: int = 0


DEFAULT_CLUSTERS = 10
"""Groups where no number is given (paper, Sec. 4)."""
