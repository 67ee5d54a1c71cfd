"""Background encoding in codec `block`: each group is shown as soon as it is encoded, and none ends worse."""

import os
import time
from dataclasses import replace

import numpy as np
import pytest

from ntc.codec.encoding import QualityBudget, StepBudget, TimeBudget
from ntc.codec.model import Grouping
from ntc.codec.quality import psnr_db
from ntc.codec.reference import decode_image
from ntc.training.messages import GroupSnapshot, TrainingProgress, apply_snapshot
from ntc.worker.client import Finished, Report, TrainingWorker, starting_pack
from ntc.worker.process import Failed, Paused, Resumed
from tests.support.training_workers import (
    BLOCK_CODEC,
    BLOCK_OPTIONS,
    BLOCKS_FROM_NOTHING,
    GROUPS,
    MANY_BLOCKS,
    TEXTURES,
    array_bytes,
    blocks,
    encoded_by_group,
    finished,
    lives,
    pack_of,
    processor_seconds,
    until,
)
from tests.unit.ntc.worker.test_worker import same

pytestmark = pytest.mark.process


def test_before_the_first_snapshot_textures_have_their_mean_colour() -> None:
    pack = starting_pack(BLOCKS_FROM_NOTHING)
    for index, texture in enumerate(TEXTURES):
        image = decode_image(pack, index)
        assert image.shape == texture.pixels.shape
        mean = texture.pixels.reshape(-1, texture.pixels.shape[2]).mean(0)
        np.testing.assert_allclose(
            image.reshape(-1, image.shape[2]), np.broadcast_to(mean, (image[..., 0].size, len(mean))), atol=1
        )


def test_a_window_that_reads_seldom_gets_the_last_report(shared: TrainingWorker) -> None:
    """Textures are encoded within a frame or two: curves and figures of such a run come from its last report alone."""
    shared.start(BLOCKS_FROM_NOTHING)
    reports: list[Report] = []
    while not any(isinstance(report, Finished | Failed) for report in reports):
        time.sleep(0.4)
        reports += shared.poll()
    last = [report for report in reports if isinstance(report, TrainingProgress)][-1]
    assert last.step == last.steps == len(TEXTURES) == len(last.psnr_db)


def test_a_group_is_shown_as_soon_as_it_is_encoded_and_the_whole_is_the_pack(shared: TrainingWorker) -> None:
    end, reports = finished(shared, BLOCKS_FROM_NOTHING)
    shown = starting_pack(BLOCKS_FROM_NOTHING)
    kinds = [report for report in reports if isinstance(report, GroupSnapshot | TrainingProgress)]
    first = next(number for number, report in enumerate(kinds) if isinstance(report, GroupSnapshot))
    assert any(isinstance(report, TrainingProgress) for report in kinds[first:]), "the rest was not yet encoded"
    for group in (0, 1):
        mine = [report for report in reports if isinstance(report, GroupSnapshot) and report.group == group]
        assert [snapshot.version for snapshot in mine] == list(range(1, len(mine) + 1))
        assert [snapshot.final for snapshot in mine] == [False] * (len(mine) - 1) + [True]
        for snapshot in mine:
            shown = apply_snapshot(shown, snapshot)
            for index in snapshot.members:
                assert psnr_db(decode_image(shown, index), TEXTURES[index].pixels) > 25.0
    assert same(shown, pack_of(end))


def test_the_smallest_groups_come_first(shared: TrainingWorker) -> None:
    request = replace(BLOCKS_FROM_NOTHING, grouping=Grouping("baseline", (0, 1, 2, 3)))
    end, reports = finished(shared, request)
    assert [report.group for report in reports if isinstance(report, GroupSnapshot)] == [3, 1, 0, 2]
    assert [outcome.group for outcome in end.outcomes] == [0, 1, 2, 3]


def test_encoded_again_only_the_dirty_group_changes_and_never_gets_worse(shared: TrainingWorker) -> None:
    packs = sorted(
        (encoded_by_group(TEXTURES, GROUPS, BLOCK_CODEC, seed) for seed in (1, 2)),
        key=lambda pack: sum(texture.psnr_db or 0.0 for texture in pack.textures if texture.group == 0),
    )
    for start, other in (packs, packs[::-1]):
        seed = int(other.training["seed"])
        training = replace(BLOCK_OPTIONS, seed=seed)
        request = replace(BLOCKS_FROM_NOTHING, training=training, start=start, dirty=frozenset({0}))
        end, reports = finished(shared, request)
        pack, (outcome,) = pack_of(end), end.outcomes
        assert {report.group for report in reports if isinstance(report, GroupSnapshot)} == {0}
        assert outcome.before_db is not None
        assert outcome.kept_old == (outcome.after_db < outcome.before_db)
        expected = start if outcome.kept_old else other
        for index, texture in enumerate(pack.textures):
            twin = (expected if index in (0, 2) else start).textures[index]
            assert array_bytes(texture) == array_bytes(twin)
        assert pack.training["seed"] == start.training["seed"]
        assert pack.training["retrained"]["groups"] == [0]


@pytest.mark.parametrize("budget", [StepBudget(1), TimeBudget(0.001), QualityBudget(5.0), QualityBudget(100.0)])
def test_whatever_the_budget_every_texture_is_encoded(
    shared: TrainingWorker, budget: StepBudget | TimeBudget | QualityBudget
) -> None:
    end, _ = finished(shared, replace(BLOCKS_FROM_NOTHING, budget=budget))
    assert len(end.outcomes) == GROUPS.group_count
    assert same(pack_of(end), encoded_by_group(TEXTURES, GROUPS, BLOCK_CODEC, BLOCKS_FROM_NOTHING.training.seed))
    if isinstance(budget, QualityBudget):
        assert end.reason == ("target reached" if budget.psnr_db < 50.0 else "target not reached")


def test_killed_it_says_so_and_leaves_nothing() -> None:
    with TrainingWorker() as worker:
        worker.start(MANY_BLOCKS)
        process = worker.process_id
        assert process is not None
        until(worker, TrainingProgress)
        os.kill(process, 9)
        end = until(worker, (Finished, Failed), seconds=5.0)[-1]
        assert isinstance(end, Failed)
        assert "signal 9" in end.line
        assert not lives(process)
        assert blocks() == []
        assert isinstance(finished(worker, BLOCKS_FROM_NOTHING)[0], Finished), "it can be started again"


@pytest.mark.timing
def test_pause_resume_and_cancel_come_between_two_textures(shared: TrainingWorker) -> None:
    shared.start(MANY_BLOCKS)
    until(shared, TrainingProgress)
    shared.pause()
    until(shared, Paused)
    assert shared.process_id is not None
    used = processor_seconds(shared.process_id)
    time.sleep(0.2)
    assert processor_seconds(shared.process_id) - used < 0.05
    shared.resume()
    until(shared, Resumed)
    until(shared, TrainingProgress)
    process, began = shared.process_id, time.monotonic()
    shared.cancel()
    end = until(shared, (Finished, Failed))[-1]
    assert isinstance(end, Finished)
    assert (end.reason, end.pack) == ("cancelled", None)
    assert time.monotonic() - began < 1.0
    assert shared.process_id == process, "it obeyed, and serves again"
    assert blocks() == []
