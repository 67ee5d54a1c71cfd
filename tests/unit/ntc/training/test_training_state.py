"""Trainings that are stopped end as if they had not been, and numbers that blow up end none."""

import errno
import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch

from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.training import batch as training_batch
from ntc.codec.grid.training.config import TrainingConfig
from ntc.codec.grid.training.optimizers import squared_error
from ntc.codec.model import Grouping, Pack
from ntc.errors import InputError, TrainingCancelledError, TrainingFailedError
from ntc.training.encode import encode_textures
from ntc.training.messages import TrainingProgress
from tests.support.textures import arrays, same, texture

pytestmark = pytest.mark.slow


SHORT = TrainingConfig(steps=60, texels_per_texture=32, device="cpu")
FULL = GridConfig(hidden_width=16, latent_channels=8, latent_bits=4, adapters=True, adapter_output=True)
TEXTURES = [texture(16, 16), texture(12, 8, seed=1), texture(9, 5, seed=2)]
GROUPS = Grouping("clustered", (0, 1, 0))


def stopping_after(steps: int) -> Callable[[], bool]:
    """Answers yes from the question after so many steps on."""
    asked = iter(range(10**9))
    return lambda: next(asked) >= steps


@cache
def whole_training(training: TrainingConfig) -> Pack:
    return encode_textures(TEXTURES, GROUPS, FULL, training)


WAYS = {
    "side by side": SHORT,
    "group by group": replace(SHORT, texels_per_group=64),
    "dropping out": replace(SHORT, converged_db=18.0),
    "balanced": replace(SHORT, balance=0.5),
}
ANY_STEP = [(way, step) for way in WAYS for step in (0, 1, 25, 50, 57, 59)]
OFTEN = (*((way, 57) for way in WAYS), *(("side by side", step) for step in (0, 50, 59)))


@pytest.mark.parametrize(
    ("way", "step"),
    [case if case in OFTEN else pytest.param(*case, marks=pytest.mark.guards("training")) for case in ANY_STEP],
)
def test_stopped_at_any_step_it_ends_alike(tmp_path: Path, way: str, step: int) -> None:
    path, training = tmp_path / "a.state", WAYS[way]
    whole = whole_training(training)
    with pytest.raises(TrainingCancelledError):
        encode_textures(TEXTURES, GROUPS, FULL, training, cancelled=stopping_after(step), state=path)
    assert path.exists()
    resumed = encode_textures(TEXTURES, GROUPS, FULL, training, state=path)
    assert same(whole, resumed)
    assert whole.training == resumed.training
    assert not path.exists()
    assert list(tmp_path.iterdir()) == []


def saved(path: Path) -> Path:
    """The state of a training that was stopped half-way."""
    with pytest.raises(TrainingCancelledError):
        encode_textures(TEXTURES, GROUPS, FULL, SHORT, cancelled=stopping_after(30), state=path)
    return path


def test_the_state_of_another_training_is_refused(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.state")
    for words, textures, groups, codec, training in (
        ("training", TEXTURES, GROUPS, FULL, replace(SHORT, seed=1)),
        ("codec", TEXTURES, GROUPS, replace(FULL, hidden_width=32), SHORT),
        ("groups", TEXTURES, Grouping("clustered", (0, 1, 1)), FULL, SHORT),
        ("textures", [*TEXTURES[:2], texture(9, 5, seed=3)], GROUPS, FULL, SHORT),
    ):
        with pytest.raises(InputError, match=rf"another training \(it differs in {words}\); remove it"):
            encode_textures(textures, groups, codec, training, state=path)


@pytest.mark.parametrize("content", [b"", b"{", b"\x00" * 200, json.dumps({"a": 1}).encode()])
def test_what_is_no_state_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.state"
    path.write_bytes(content)
    with pytest.raises(InputError, match="not the state of a training"):
        encode_textures(TEXTURES, GROUPS, FULL, SHORT, state=path)
    assert path.read_bytes() == content


def test_a_damaged_state_is_refused_or_read_never_a_crash(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.state")
    whole = path.read_bytes()
    random = np.random.default_rng(0)
    for _ in range(25):
        damaged = bytearray(whole[: random.integers(1, len(whole))] if random.random() < 0.3 else whole)
        place = random.integers(0, min(len(damaged), 6000))
        damaged[place] ^= 1 << random.integers(0, 8)
        path.write_bytes(bytes(damaged))
        try:
            encode_textures(TEXTURES, GROUPS, FULL, SHORT, cancelled=stopping_after(0), state=path)
        except (InputError, TrainingCancelledError):
            continue


def test_a_full_disk_now_and_then_ends_no_training(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, notes, refused = tmp_path / "a.state", [], []

    def full(*_: object) -> None:
        refused.append(True)
        raise InputError("a.state: cannot be written (No space left on device)")

    monkeypatch.setattr("ntc.training.trainer.SECONDS_BETWEEN_SAVES", 0.0)
    monkeypatch.setattr("ntc.training.trainer.write_bytes", full)
    pack = encode_textures(TEXTURES, GROUPS, FULL, SHORT, state=path, progress=lambda report: notes.append(report.note))
    assert len(refused) > 1
    assert any("could not be saved, training continues (a.state: cannot be written" in note for note in notes)
    assert same(pack, whole_training(SHORT))


def test_a_state_that_changes_while_it_is_read_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = saved(tmp_path / "a.state")

    def changed(_path: Path) -> bytes:
        raise OSError(errno.EAGAIN, "it changed while it was read")

    monkeypatch.setattr("ntc.training.trainer.read_file", changed)
    with pytest.raises(InputError, match="it changed while it was read"):
        encode_textures(TEXTURES, GROUPS, FULL, SHORT, state=path)


LONGER = TrainingConfig(steps=120, texels_per_texture=32, device="cpu")
CONFIG = GridConfig(hidden_width=16, adapters=True)
TWO_TEXTURES = [texture(16, 16), texture(12, 8, seed=1)]
PAIR = Grouping("single", (0, 0))


def spoilt(monkeypatch: pytest.MonkeyPatch, calls: range, value: float) -> None:
    """Let the loss of these calls, and so its gradients, be `value`."""
    count = iter(range(10**9))
    true_loss = squared_error

    def loss(*arguments: object) -> torch.Tensor:
        right = true_loss(*arguments)  # type: ignore[arg-type]
        return right * value if next(count) in calls else right

    monkeypatch.setattr(training_batch, "squared_error", loss)


@pytest.mark.parametrize(("value", "step"), [(float("nan"), 0), (float("inf"), 70), (float("nan"), 119)])
def test_a_bad_step_is_dropped_and_the_training_goes_on(
    monkeypatch: pytest.MonkeyPatch, value: float, step: int
) -> None:
    reports: list[TrainingProgress] = []
    spoilt(monkeypatch, range(step, step + 1), value)
    pack = encode_textures(TWO_TEXTURES, PAIR, CONFIG, LONGER, reports.append)
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
            encode_textures(TWO_TEXTURES, PAIR, CONFIG, LONGER, state=path)
    assert path.exists()
    pack = encode_textures(TWO_TEXTURES, PAIR, CONFIG, LONGER, state=path)
    assert all(np.isfinite(array).all() for array in arrays(pack))
    assert not path.exists()


@pytest.mark.parametrize("rate", ["decoder_rate", "hidden_rate", "latent_rate"])
def test_absurd_rates_end_in_a_pack_or_in_one_line(rate: str) -> None:
    try:
        pack = encode_textures(TWO_TEXTURES, PAIR, CONFIG, replace(LONGER, **{rate: 1e30}))  # type: ignore[arg-type]
    except TrainingFailedError:
        return
    assert all(np.isfinite(array).all() for array in arrays(pack))
