"""What a training promises its host: it ends by the host's clock, and can be interrupted in the middle of every piece of work."""

import math
from dataclasses import replace

import pytest

from ntc.codec.encoding import TimeBudget
from ntc.errors import TrainingCancelledError
from ntc.training.messages import GroupSnapshot, TrainingProgress, TrainingRequest, checked_request
from ntc.training.trainer import Trainer
from tests.support.training_workers import ENDLESS, FROM_NOTHING, LARGE, MANY_BLOCKS


class CountingHost:
    """Counts interruptions; its clock counts them too."""

    def __init__(self, seconds_between_interruptions: float = 1.0, cancelled_at: float = math.inf) -> None:
        """The training is cancelled at step `cancelled_at`."""
        self._seconds, self._cancelled_at = seconds_between_interruptions, cancelled_at
        self.interruptions = 0
        self.last: TrainingProgress | None = None
        self.snapshots: list[GroupSnapshot] = []

    @property
    def step(self) -> int:
        """The last step that was reported: for codec `block`, the textures that are encoded."""
        return 0 if self.last is None else self.last.step

    def interruption(self) -> None:
        self.interruptions += 1
        if self.step >= self._cancelled_at:
            raise TrainingCancelledError

    def seconds(self) -> float:
        return self.interruptions * self._seconds

    def progress(self, progress: TrainingProgress) -> None:
        self.last = progress

    def wants_snapshot(self, group: int) -> bool:
        return False

    def snapshot(self, snapshot: GroupSnapshot) -> None:
        self.snapshots.append(snapshot)


def test_a_budget_of_seconds_ends_in_time_with_rounded_latents() -> None:
    host = CountingHost(1.0 / 256.0)
    request = checked_request(replace(FROM_NOTHING, training=ENDLESS, budget=TimeBudget(3.0)))
    ended = Trainer(request, host, snapshots=host).run()
    assert host.last is not None
    assert 2.9 < host.last.elapsed_seconds < 3.1
    assert ended.record["steps"] == host.last.step == host.last.steps
    textures = [texture for snapshot in host.snapshots for texture in snapshot.textures]
    assert len(textures) == len(request.textures)
    assert min(texture.psnr_db or 0.0 for texture in textures) > 12.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("request_", "least", "steps"), [(LARGE, 20, 8), (MANY_BLOCKS, 4, 40)], ids=["grid, a step", "block, a texture"]
)
def test_work_can_be_interrupted_many_times(request_: TrainingRequest, least: int, steps: int) -> None:
    host = CountingHost(cancelled_at=steps)
    with pytest.raises(TrainingCancelledError):
        Trainer(checked_request(request_), host, snapshots=host).run()
    assert host.interruptions >= least * host.step
