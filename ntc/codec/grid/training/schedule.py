"""Learning rates over a training, as functions of progress in [0, 1]."""

import math

from ntc.codec.grid.training.config import FreezingConfig, TrainingConfig


def freezing_scale(progress: float, freezing: FreezingConfig | None) -> float:
    """Scale of the decoder's updates (paper, Sec. 3): 1 before e_s, then 0.5 (1 + cos(pi p)), 0 after e_s + T."""
    if freezing is None:
        return 1.0
    if freezing.duration <= 0.0:
        return 1.0 if progress < freezing.start else 0.0
    share = min(max((progress - freezing.start) / freezing.duration, 0.0), 1.0)
    return 0.5 * (1.0 + math.cos(math.pi * share))


FIRST_STEP = 1e-3
"""Added to the progress of a rising rate, so that the first step is one."""
WARM_UP = 1 / 30
"""Share of the training in which the rates of a trapezoid rise."""
FALL_FROM = 0.6
"""Share of the training after which they fall."""


def rate_scale(progress: float, training: TrainingConfig) -> float:
    """Scale of all learning rates: 1 for constant, half a cosine from 1 to 0 for cosine; for trapezoid a straight line up to 1,
    then 1, then a straight line down to 0.
    """
    share = min(max(progress, 0.0), 1.0)
    if training.schedule == "constant":
        return 1.0
    if training.schedule == "cosine":
        return 0.5 * (1.0 + math.cos(math.pi * share))
    return max(0.0, min(1.0, (share + FIRST_STEP) / WARM_UP, (1.0 - share) / (1.0 - FALL_FROM)))
