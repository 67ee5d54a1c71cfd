"""Trainings that take turns give what each gives alone, and trainings of one seed see the same samples."""

import threading
from itertools import cycle

import numpy as np
import pytest

from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.training.batch import RandomStreams, TrainingBatch
from ntc.codec.grid.training.config import TrainingConfig
from ntc.codec.model import Grouping
from ntc.codec.quality import PsnrSummary
from ntc.errors import TrainingCancelledError
from ntc.torch_device import choose_device
from ntc.training.encode import encode_textures
from ntc.training.messages import TrainingRequest
from ntc.training.turns import SampledTexels, TrainingInTurns
from tests.support.textures import arrays, texture

CODEC = GridConfig(hidden_width=16)
OPTIONS = TrainingConfig(steps=30, texels_per_texture=64, device="cpu", seed=3)
TEXTURES = tuple(texture(32, 32, seed=number) for number in range(3))
GROUPINGS = (Grouping("baseline", (0, 1, 2)), Grouping("clustered", (0, 1, 0)), Grouping("single", (0, 0, 0)))


def in_turns(groupings: tuple[Grouping, ...] = GROUPINGS) -> list[TrainingInTurns]:
    sample = SampledTexels.of(TEXTURES)
    return [
        TrainingInTurns(TrainingRequest(TEXTURES, grouping, CODEC, OPTIONS), sample, lambda: False)
        for grouping in groupings
    ]


def test_turns_do_not_change_results() -> None:
    trainings = in_turns()
    for training in cycle(trainings):
        if training.ended is None:
            training.run_slice(0.0)
        if all(each.ended for each in trainings):
            break
    for grouping, training in zip(GROUPINGS, trainings, strict=True):
        alone = encode_textures(TEXTURES, grouping, CODEC, OPTIONS)
        for one, other in zip(arrays(alone), arrays(training.pack()), strict=True):
            np.testing.assert_array_equal(one, other)


def test_curve_has_points_early_and_ends_at_the_last_step_with_the_quality_of_the_pack() -> None:
    (training,) = in_turns(GROUPINGS[:1])
    while training.ended is None:
        training.run_slice(0.0)
    steps = [point.step for point in training.curve]
    assert steps == sorted(steps)
    assert steps[0] < 30 == steps[-1]
    whole = PsnrSummary.of([each.psnr_db or 0.0 for each in training.pack().textures])
    assert whole is not None
    # All texels of so small a texture are sampled about once.
    assert training.curve[-1].psnr_db == pytest.approx(whole.mean_db, abs=0.5)


def test_samples_and_latents_do_not_depend_on_the_grouping() -> None:
    device = choose_device("cpu")
    batches = [
        TrainingBatch(TEXTURES, groups, CODEC, OPTIONS, device, RandomStreams.of_seed(7))
        for groups in ((0, 1, 2), (0, 0, 0))
    ]
    first, second = (batch.rounded_now(range(3)) for batch in batches)
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one.stored, other.stored)
    streams = [RandomStreams.of_seed(7) for _ in range(2)]
    for stream, groups in zip(streams, ((0, 1, 2), (0, 0, 0)), strict=True):
        TrainingBatch(TEXTURES, groups, CODEC, OPTIONS, device, stream).advance(1.0)
    assert streams[0].samples.get_state().equal(streams[1].samples.get_state())


def test_a_cancelled_training_ends_within_its_slice() -> None:
    cancelled = threading.Event()
    request = TrainingRequest(TEXTURES, GROUPINGS[0], CODEC, OPTIONS)
    training = TrainingInTurns(request, SampledTexels.of(TEXTURES), cancelled.is_set)
    cancelled.set()
    with pytest.raises(TrainingCancelledError):
        training.run_slice()
    with pytest.raises(ValueError, match="no result"):
        training.pack()
