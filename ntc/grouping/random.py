"""Random grouping with the group sizes of another one: the control of the paper's Table 1."""

import numpy as np

from ntc.grouping.order import in_order_of_appearance
from ntc.pack.model import Grouping


def random_grouping(like: Grouping, seed: int) -> Grouping:
    """The groups of `like` with their textures shuffled."""
    shuffled = np.random.default_rng(seed).permutation(np.array(like.groups, dtype=np.int64))
    parameters = {"clusters": like.group_count, "sizes_of": like.name, "seed": seed}
    return Grouping("random", in_order_of_appearance(shuffled.tolist()), parameters)
