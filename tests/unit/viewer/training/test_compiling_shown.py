"""What the window says while the encoder is compiled for the first time."""

import time
from types import SimpleNamespace
from typing import Any, cast

import pytest

from ntc.training.compiling import COMPILING
from ntc.training.messages import TrainingProgress
from viewer.app.work_under_way import training_work
from viewer.training.preparation import EncodeScene
from viewer.training.run_log import ActiveRun, State
from viewer.training.settings import TrainingSettings
from viewer.ui.panels.training import _state


def run_with(progress: TrainingProgress | None, state: State = "training") -> ActiveRun:
    return ActiveRun(1, EncodeScene(TrainingSettings()), cast(Any, None), time.monotonic(), state, progress=progress)


def work_line(run: ActiveRun) -> tuple[str, float | None]:
    (work,) = training_work(cast(Any, SimpleNamespace(active=run, saving=False)))
    return work.title, work.share


def test_the_panel_and_the_status_bar_name_the_compiling_and_no_share() -> None:
    compiling = TrainingProgress(0.0, 0.0, 0, 0, 0, {}, {}, COMPILING, elapsed_seconds=12.0)
    assert _state(run_with(compiling), None) == f"{COMPILING}, 12 s"
    title, share = work_line(run_with(compiling))
    assert title.endswith(f", {COMPILING}")
    assert share is None
    encoding = TrainingProgress(0.5, 1e3, 1, 2, 1000, {}, {}, "encoding texture", elapsed_seconds=3.0)
    title, share = work_line(run_with(encoding))
    assert COMPILING not in title
    assert share == pytest.approx(0.5)
