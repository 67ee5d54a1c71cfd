"""A training that is stopped and gone on with ends as if it had never been stopped."""

import errno
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.training.config import TrainingConfig
from ntc.codec.model import Grouping
from ntc.errors import InputError, TrainingCancelledError
from ntc.training.encode import encode_textures
from tests.unit.ntc.training.test_train import same, texture

pytestmark = pytest.mark.slow

SHORT = TrainingConfig(steps=60, texels_per_texture=32, device="cpu")
FULL = GridConfig(hidden_width=16, latent_channels=8, latent_bits=4, adapters=True, adapter_output=True)
TEXTURES = [texture(16, 16), texture(12, 8, seed=1), texture(9, 5, seed=2)]
GROUPS = Grouping("clustered", (0, 1, 0))


def stopping_after(steps: int) -> Callable[[], bool]:
    """Answers yes from the question after so many steps on."""
    asked = iter(range(10**9))
    return lambda: next(asked) >= steps


@pytest.mark.parametrize(
    "training",
    [SHORT, replace(SHORT, texels_per_group=64), replace(SHORT, converged_db=18.0), replace(SHORT, balance=0.5)],
    ids=["side by side", "group by group", "dropping out", "balanced"],
)
@pytest.mark.parametrize("step", [0, 1, 25, 50, 57, 59])
def test_stopped_at_any_step_it_ends_alike(tmp_path: Path, training: TrainingConfig, step: int) -> None:
    path = tmp_path / "a.state"
    whole = encode_textures(TEXTURES, GROUPS, FULL, training)
    with pytest.raises(TrainingCancelledError):
        encode_textures(TEXTURES, GROUPS, FULL, training, cancelled=stopping_after(step), state=path)
    assert path.exists()
    resumed = encode_textures(TEXTURES, GROUPS, FULL, training, state=path)
    assert same(whole, resumed)
    assert whole.training == resumed.training
    assert not path.exists()
    assert list(tmp_path.iterdir()) == []


def test_stopped_again_and_again_it_ends_alike(tmp_path: Path) -> None:
    path = tmp_path / "a.state"
    for _ in range(5):
        with pytest.raises(TrainingCancelledError):
            encode_textures(TEXTURES, GROUPS, FULL, SHORT, cancelled=stopping_after(11), state=path)
    assert same(
        encode_textures(TEXTURES, GROUPS, FULL, SHORT, state=path), encode_textures(TEXTURES, GROUPS, FULL, SHORT)
    )


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
    for _ in range(60):
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
    monkeypatch.setattr("ntc.training.trainer.save_state", full)
    pack = encode_textures(TEXTURES, GROUPS, FULL, SHORT, state=path, progress=lambda report: notes.append(report.note))
    assert len(refused) > 1
    assert any("could not be saved, training continues (a.state: cannot be written" in note for note in notes)
    assert same(pack, encode_textures(TEXTURES, GROUPS, FULL, SHORT))


def test_a_state_that_changes_while_it_is_read_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = saved(tmp_path / "a.state")

    def changed(_path: Path) -> bytes:
        raise OSError(errno.EAGAIN, "it changed while it was read")

    monkeypatch.setattr("ntc.training.trainer.read_file", changed)
    with pytest.raises(InputError, match="it changed while it was read"):
        encode_textures(TEXTURES, GROUPS, FULL, SHORT, state=path)
