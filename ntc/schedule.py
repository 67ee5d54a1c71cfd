"""Learning rates over a training, as functions of progress in [0, 1]."""

import math

from ntc.training_config import FreezingConfig, TrainingConfig


def freezing_scale(progress: float, freezing: FreezingConfig | None) -> float:
    """Scale of the decoder's updates (paper, Sec. 3): 1 before e_s, then 0.5 (1 + cos(pi p)), 0 after e_s + T."""
    if freezing is None:
        return 1.0
    if freezing.duration <= 0.0:
        return 1.0 if progress < freezing.start else 0.0
    share = min(max((progress - freezing.start) / freezing.duration, 0.0), 1.0)
    return 0.5 * (1.0 + math.cos(math.pi * share))


def rate_scale(progress: float, training: TrainingConfig) -> float:
    """Scale of both learning rates: 1 for constant, half a cosine from 1 to 0 for cosine."""
    return 1.0 if training.schedule == "constant" else 0.5 * (1.0 + math.cos(math.pi * min(max(progress, 0.0), 1.0)))
