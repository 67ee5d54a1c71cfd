"""The scale of the decoder's updates and of the learning rates."""

import math

import pytest

from ntc.codec.grid.training.config import FreezingConfig, TrainingConfig, freezing_scale, rate_scale, recipe_config


def test_freezing_follows_the_paper() -> None:
    freezing = FreezingConfig(start=0.5, duration=0.1)
    assert [freezing_scale(progress, freezing) for progress in (0.0, 0.3, 0.5)] == [1.0, 1.0, 1.0]
    assert [freezing_scale(progress, freezing) for progress in (0.6, 0.7, 1.0)] == [0.0, 0.0, 0.0]
    for share in (0.1, 0.25, 0.5, 0.9):
        expected = 0.5 * (1.0 + math.cos(math.pi * share))
        assert freezing_scale(0.5 + 0.1 * share, freezing) == pytest.approx(expected)


def test_freezing_never_rises() -> None:
    scales = [freezing_scale(step / 1000, FreezingConfig(0.2, 0.5)) for step in range(1001)]
    assert scales == sorted(scales, reverse=True)


def test_freezing_without_duration_is_a_step() -> None:
    freezing = FreezingConfig(start=0.5, duration=0.0)
    assert [freezing_scale(progress, freezing) for progress in (0.0, 0.49, 0.5, 1.0)] == [1.0, 1.0, 0.0, 0.0]


def test_no_freezing() -> None:
    assert freezing_scale(0.9, None) == 1.0


def test_rates() -> None:
    cosine, constant = TrainingConfig(schedule="cosine"), TrainingConfig(schedule="constant")
    assert [rate_scale(progress, cosine) for progress in (0.0, 0.5, 1.0)] == pytest.approx([1.0, 0.5, 0.0])
    assert rate_scale(0.9, constant) == 1.0


def test_a_trapezoid_rises_stays_and_falls_to_nothing() -> None:
    trapezoid = TrainingConfig(schedule="trapezoid")
    scales = [rate_scale(step / 1000, trapezoid) for step in range(1001)]
    assert 0.0 < scales[0] < 0.05
    assert scales[40] == scales[300] == scales[600] == 1.0
    assert scales[800] == pytest.approx(0.5)
    assert scales[1000] == 0.0
    assert scales[600:] == sorted(scales[600:], reverse=True)


def test_the_paper_recipe_has_the_papers_numbers() -> None:
    paper = recipe_config("paper")
    assert (paper.epochs, paper.steps, paper.texels_per_group) == (350.0, None, 32768)
    assert (paper.latent_rate, paper.decoder_rate, paper.schedule) == (4e-3, 4e-4, "constant")
    assert paper.freezing == FreezingConfig(0.5, 0.1)
    assert recipe_config("best").recipe == "best"


@pytest.mark.parametrize(("steps", "epochs"), [(None, None), (10, 1.0)])
def test_a_training_has_one_length(steps: int | None, epochs: float | None) -> None:
    with pytest.raises(ValueError, match="steps or epochs"):
        TrainingConfig(steps=steps, epochs=epochs)
