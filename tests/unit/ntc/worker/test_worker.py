"""Background training: what it delivers is what training delivers, it obeys at once, and dies without a trace."""

import hashlib
import math
import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.encoding import QualityBudget, StepBudget, TimeBudget
from ntc.codec.model import Grouping, Pack
from ntc.codec.quality import psnr_db
from ntc.codec.reference import decode_image
from ntc.pack.file import read_pack, write_pack
from ntc.training.encode import encode_textures
from ntc.training.messages import GroupSnapshot, TrainingProgress, apply_snapshot, moved_texture
from ntc.worker.client import Finished, TrainingWorker, starting_pack
from ntc.worker.process import Failed
from tests.support.training_workers import (
    CODEC,
    ENDLESS,
    FROM_NOTHING,
    GROUPS,
    SHORT,
    TEXTURES,
    CodecCase,
    array_bytes,
    blocks,
    finished,
    pack_of,
    threads,
    until,
)

pytestmark = pytest.mark.process


def digest(pack: Pack, texture_index: int) -> str:
    """Over everything that decodes a texture."""
    encoded = pack.textures[texture_index]
    return hashlib.sha256(b"".join(array_bytes((encoded, pack.decoders[encoded.group])))).hexdigest()


def same(a: Pack, b: Pack) -> bool:
    """Whether two packs hold the same bits."""
    return array_bytes((a.textures, a.decoders)) == array_bytes((b.textures, b.decoders))


def test_from_nothing_it_gives_what_training_gives_bit_by_bit(
    shared: TrainingWorker, case: CodecCase, tmp_path: Path
) -> None:
    end, reports = finished(shared, case.from_nothing)
    pack = pack_of(end)
    assert end.reason == "done"
    assert same(pack, case.trained)
    assert [t.psnr_db for t in pack.textures] == [t.psnr_db for t in case.trained.textures]
    assert pack.training == case.trained.training
    write_pack(tmp_path / "a.ntc", pack)
    assert same(read_pack(tmp_path / "a.ntc"), pack)
    assert [outcome.before_db for outcome in end.outcomes] == [None, None]
    assert blocks() == []

    last = [report for report in reports if isinstance(report, TrainingProgress)][-1]
    steps = 120 if case.from_nothing is FROM_NOTHING else len(TEXTURES)
    assert (last.step, last.steps, last.seconds_left) == (steps, steps, 0.0)
    assert set(last.losses) == {0, 1}
    assert set(last.psnr_db) == {0, 1, 2, 3}
    assert all(math.isfinite(value) for value in (*last.losses.values(), *last.psnr_db.values()))
    assert last.ktexels_per_second > 0.0
    assert last.freezing_scale == 1.0


def test_group_by_group_as_the_paper_trains(shared: TrainingWorker) -> None:
    training = replace(SHORT, texels_per_group=64, steps=70)
    with threads(max(1, len(os.sched_getaffinity(0)) - 1)):
        expected = encode_textures(TEXTURES, GROUPS, CODEC, training)
    end, reports = finished(shared, replace(FROM_NOTHING, training=training))
    assert same(pack_of(end), expected)
    steps = [report.step for report in reports if isinstance(report, TrainingProgress)]
    assert steps == sorted(steps)
    assert steps[-1] == 140


def test_snapshots_come_early_and_can_be_swapped_in(shared: TrainingWorker) -> None:
    request = replace(FROM_NOTHING, training=replace(SHORT, steps=400), seconds_between_snapshots=0.05)
    _, reports = finished(shared, request)
    pack = starting_pack(request)
    for group in (0, 1):
        mine = [report for report in reports if isinstance(report, GroupSnapshot) and report.group == group]
        assert [snapshot.version for snapshot in mine] == list(range(1, len(mine) + 1))
        assert [snapshot.final for snapshot in mine] == [False] * (len(mine) - 1) + [True]
        assert len(mine) >= 3
    quality = []
    for snapshot in (report for report in reports if isinstance(report, GroupSnapshot)):
        pack = apply_snapshot(pack, snapshot)
        quality.append(psnr_db(decode_image(pack, 2), TEXTURES[2].pixels))
    assert quality[-1] > quality[0] > 8.0
    assert same(pack, pack_of(reports[-1]))  # type: ignore[arg-type]


def test_a_reader_who_sleeps_finds_the_latest_and_no_queue(shared: TrainingWorker) -> None:
    shared.start(replace(FROM_NOTHING, training=ENDLESS, seconds_between_snapshots=0.01))
    until(shared, TrainingProgress)
    time.sleep(2.0)
    waiting = shared.poll()
    assert len([report for report in waiting if isinstance(report, TrainingProgress)]) <= 2
    assert len([report for report in waiting if isinstance(report, GroupSnapshot)]) <= 4
    shared.cancel()
    until(shared, Finished)


def test_only_the_dirty_group_changes_and_gets_better(shared: TrainingWorker, trained: Pack) -> None:
    end, reports = finished(shared, replace(FROM_NOTHING, start=trained, dirty=frozenset({1}), budget=StepBudget(200)))
    pack = pack_of(end)
    assert {report.group for report in reports if isinstance(report, GroupSnapshot)} == {1}
    before, after = [[digest(p, index) for index in range(4)] for p in (trained, pack)]
    assert [a == b for a, b in zip(before, after, strict=True)] == [True, False, True, False]
    (outcome,) = end.outcomes
    assert outcome.before_db is not None
    assert outcome.after_db > outcome.before_db + 1.0
    assert pack.training["retrained"]["groups"] == [1]
    for index in range(4):
        measured = psnr_db(decode_image(pack, index), TEXTURES[index].pixels)
        assert measured == pytest.approx(pack.textures[index].psnr_db, abs=0.1)


def test_a_group_never_ends_worse(shared: TrainingWorker, trained: Pack) -> None:
    ruinous = replace(SHORT, latent_rate=3.0, decoder_rate=1.0, hidden_rate=3.0, schedule="constant")
    request = replace(FROM_NOTHING, training=ruinous, start=trained, dirty=frozenset({0}), budget=StepBudget(5))
    end, reports = finished(shared, request)
    (outcome,) = end.outcomes
    assert outcome.kept_old
    assert "the old one was kept" in outcome.line()
    assert same(pack_of(end), trained)
    final = [report for report in reports if isinstance(report, GroupSnapshot)][-1]
    assert final.final
    assert same(apply_snapshot(trained, final), trained)


def test_a_texture_moves_and_its_two_groups_alone_are_trained(shared: TrainingWorker, case: CodecCase) -> None:
    groups = Grouping("random", (0, 1, 0, 2))
    start = pack_of(finished(shared, replace(case.from_nothing, grouping=groups))[0])
    moved = moved_texture(groups, 2, 1)
    request = replace(case.from_nothing, grouping=moved, start=start)
    checked = shared.start(request)
    assert checked.dirty == frozenset({0, 1})
    end = until(shared, (Finished, Failed))[-1]
    assert isinstance(end, Finished)
    pack = pack_of(end)
    assert pack.grouping == moved
    assert [t.group for t in pack.textures] == [0, 1, 1, 2]
    assert digest(pack, 3) == digest(start, 3)
    assert pack.textures[2].psnr_db is not None
    assert pack.textures[2].psnr_db > 15.0
    assert {outcome.group: outcome.before_db for outcome in end.outcomes} == {0: None, 1: None}


def test_regrouped_with_another_count(shared: TrainingWorker, case: CodecCase) -> None:
    other = Grouping("clustered", (2, 0, 1, 1), {"clusters": 3})
    end, reports = finished(shared, replace(case.from_nothing, grouping=other, start=case.trained))
    pack = pack_of(end)
    assert pack.grouping == other
    assert len(pack.decoders) == 3
    shown = case.trained
    for snapshot in (report for report in reports if isinstance(report, GroupSnapshot)):
        shown = apply_snapshot(shown, snapshot)
    for index in range(4):
        np.testing.assert_array_equal(decode_image(shown, index), decode_image(pack, index))


@pytest.mark.timing
def test_a_budget_of_seconds_ends_in_time_with_rounded_latents(shared: TrainingWorker) -> None:
    end, reports = finished(shared, replace(FROM_NOTHING, training=ENDLESS, budget=TimeBudget(3.0)))
    last = [report for report in reports if isinstance(report, TrainingProgress)][-1]
    assert 2.9 < last.elapsed_seconds < 4.5
    pack = pack_of(end)
    assert pack.training["steps"] == last.step == last.steps
    assert min(t.psnr_db for t in pack.textures if t.psnr_db is not None) > 12.0


def test_a_budget_of_quality_ends_when_it_is_reached(shared: TrainingWorker) -> None:
    training = replace(SHORT, steps=20000)
    end, _ = finished(shared, replace(FROM_NOTHING, training=training, budget=QualityBudget(22.0)))
    assert end.reason == "target reached"
    assert pack_of(end).training["steps"] < 5000
    end, _ = finished(shared, replace(FROM_NOTHING, training=replace(SHORT, steps=20), budget=QualityBudget(70.0)))
    assert end.reason == "target not reached"
