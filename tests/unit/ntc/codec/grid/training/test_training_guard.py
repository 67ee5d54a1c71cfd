"""Numbers that blow up: the step is dropped, the good state comes back; three in a row end the training, its state saved."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.training import batch as training_batch
from ntc.codec.grid.training.config import TrainingConfig
from ntc.codec.grid.training.optimizers import squared_error
from ntc.codec.model import Grouping
from ntc.errors import TrainingFailedError
from ntc.training.encode import encode_textures
from ntc.training.messages import TrainingProgress
from tests.unit.ntc.training.test_train import arrays, same, texture

pytestmark = pytest.mark.slow

SHORT = TrainingConfig(steps=120, texels_per_texture=32, device="cpu")
CONFIG = GridConfig(hidden_width=16, adapters=True)
TEXTURES = [texture(16, 16), texture(12, 8, seed=1)]
PAIR = Grouping("single", (0, 0))


def spoilt(monkeypatch: pytest.MonkeyPatch, calls: range, value: float) -> None:
    """Let the loss of these calls, and so its gradients, be `value`."""
    count = iter(range(10**9))
    true_loss = squared_error

    def loss(*arguments: object) -> torch.Tensor:
        right = true_loss(*arguments)  # type: ignore[arg-type]
        return right * value if next(count) in calls else right

    monkeypatch.setattr(training_batch, "squared_error", loss)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
@pytest.mark.parametrize("step", [0, 70, 119])
def test_a_bad_step_is_dropped_and_the_training_goes_on(
    monkeypatch: pytest.MonkeyPatch, value: float, step: int
) -> None:
    reports: list[TrainingProgress] = []
    spoilt(monkeypatch, range(step, step + 1), value)
    pack = encode_textures(TEXTURES, PAIR, CONFIG, SHORT, reports.append)
    assert all(np.isfinite(array).all() for array in arrays(pack))
    assert pack.training["dropped_steps"] == 1
    notes = [report.note for report in reports if report.note]
    assert len(notes) == 1
    assert f"step {step}: loss or gradients are not finite" in notes[0]
    assert f"back to the state of step {step - step % 50}" in notes[0]
    assert "rates lowered to 0.5" in notes[0]
    assert pack.textures[0].psnr_db is not None
    assert pack.textures[0].psnr_db > 12.0


def test_three_in_a_row_stop_it_with_the_state_saved(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    path = tmp_path / "a.state"
    with monkeypatch.context() as patch:
        spoilt(patch, range(60, 63), float("nan"))
        with pytest.raises(TrainingFailedError, match="3 steps in a row, the last at step 62"):
            encode_textures(TEXTURES, PAIR, CONFIG, SHORT, state=path)
    assert path.exists()
    pack = encode_textures(TEXTURES, PAIR, CONFIG, SHORT, state=path)
    assert all(np.isfinite(array).all() for array in arrays(pack))
    assert not path.exists()


def test_bad_steps_with_good_ones_between_do_not_stop_it(monkeypatch: pytest.MonkeyPatch) -> None:
    spoilt(monkeypatch, range(10, 110, 20), float("nan"))
    assert encode_textures(TEXTURES, PAIR, CONFIG, SHORT).training["dropped_steps"] == 5


@pytest.mark.parametrize(
    "change",
    [
        lambda training: replace(training, decoder_rate=1e30),
        lambda training: replace(training, hidden_rate=1e30),
        lambda training: replace(training, latent_rate=1e30),
    ],
)
def test_absurd_rates_end_in_a_pack_or_in_one_line(
    change: Callable[[TrainingConfig], TrainingConfig],
) -> None:
    try:
        pack = encode_textures(TEXTURES, PAIR, CONFIG, change(SHORT))
    except TrainingFailedError:
        return
    assert all(np.isfinite(array).all() for array in arrays(pack))


def test_without_trouble_nothing_is_dropped() -> None:
    first, again = (encode_textures(TEXTURES, PAIR, CONFIG, SHORT) for _ in range(2))
    assert first.training["dropped_steps"] == 0
    assert same(first, again)
