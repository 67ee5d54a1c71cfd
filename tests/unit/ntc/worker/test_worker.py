"""Background training: it gives what training gives, obeys at once, says what went wrong and dies without a trace."""

import hashlib
import math
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from ntc.codec.encoding import QualityBudget, StepBudget, TimeBudget
from ntc.codec.model import Grouping, Pack
from ntc.codec.quality import psnr_db
from ntc.codec.reference import decode_image
from ntc.errors import InputError
from ntc.pack.file import read_pack, write_pack
from ntc.training.compiling import COMPILING
from ntc.training.messages import Ended, GroupSnapshot, TrainingProgress, TrainingRequest, apply_snapshot, moved_texture
from ntc.worker.client import Finished, Report, TrainingOrder, TrainingWorker, starting_pack
from ntc.worker.process import Failed, Paused, Resumed, WindowEnd
from tests.support.processes import SECONDS, wait_for_end
from tests.support.training_workers import (
    BLOCK_CODEC,
    BLOCKS_FROM_NOTHING,
    CODEC,
    ENDLESS,
    FROM_NOTHING,
    GROUPS,
    LARGE,
    LONGEST_WAIT,
    MANY_BLOCKS,
    SHORT,
    TEXTURES,
    CodecCase,
    array_bytes,
    blocks,
    encoded_by_group,
    ends,
    finished,
    pack_of,
    processor_seconds,
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
    assert (last.step, last.steps, last.share) == (steps, steps, 1.0)
    assert set(last.losses) == {0, 1}
    assert set(last.psnr_db) == {0, 1, 2, 3}
    assert all(math.isfinite(value) for value in (*last.losses.values(), *last.psnr_db.values()))
    assert last.ktexels_per_second > 0.0
    assert last.freezing_scale == 1.0


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
    time.sleep(1.0)
    waiting = shared.poll()
    assert len([report for report in waiting if isinstance(report, TrainingProgress)]) <= 2
    assert len([report for report in waiting if isinstance(report, GroupSnapshot)]) <= 4
    shared.cancel()
    until(shared, Finished)
    # Textures of codec block are encoded within a frame or two: figures of such a run come from its last report alone.
    shared.start(BLOCKS_FROM_NOTHING)
    reports: list[Report] = []
    while not any(isinstance(report, Finished | Failed) for report in reports):
        time.sleep(0.4)
        reports += shared.poll()
    last = [report for report in reports if isinstance(report, TrainingProgress)][-1]
    assert last.step == last.steps == len(TEXTURES) == len(last.psnr_db)


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
    assert outcome.rejected
    assert "left unchanged at" in outcome.line()
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


def test_a_budget_of_quality_ends_when_it_is_reached(shared: TrainingWorker) -> None:
    training = replace(SHORT, steps=20000)
    end, _ = finished(shared, replace(FROM_NOTHING, training=training, budget=QualityBudget(22.0)))
    assert end.reason == "target reached"
    assert pack_of(end).training["steps"] < 5000
    end, _ = finished(shared, replace(FROM_NOTHING, training=replace(SHORT, steps=20), budget=QualityBudget(70.0)))
    assert end.reason == "target not reached"


def test_before_the_first_snapshot_textures_have_their_mean_colour() -> None:
    pack = starting_pack(BLOCKS_FROM_NOTHING)
    for index, texture in enumerate(TEXTURES):
        image = decode_image(pack, index)
        assert image.shape == texture.pixels.shape
        mean = texture.pixels.reshape(-1, texture.pixels.shape[2]).mean(0)
        np.testing.assert_allclose(
            image.reshape(-1, image.shape[2]), np.broadcast_to(mean, (image[..., 0].size, len(mean))), atol=1
        )


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


@pytest.mark.parametrize("budget", [TimeBudget(0.001), QualityBudget(100.0)])
def test_whatever_the_budget_every_texture_is_encoded(
    shared: TrainingWorker, budget: TimeBudget | QualityBudget
) -> None:
    end, _ = finished(shared, replace(BLOCKS_FROM_NOTHING, budget=budget))
    assert len(end.outcomes) == GROUPS.group_count
    assert same(pack_of(end), encoded_by_group(TEXTURES, GROUPS, BLOCK_CODEC, BLOCKS_FROM_NOTHING.training.seed))
    if isinstance(budget, QualityBudget):
        assert end.reason == "target not reached"


@pytest.mark.parametrize(("request_", "rounds"), [(LARGE, 3), (MANY_BLOCKS, 1)], ids=["grid", "block"])
def test_it_pauses_resumes_and_is_cancelled_in_the_middle_of_its_work(
    shared: TrainingWorker, monkeypatch: pytest.MonkeyPatch, request_: TrainingRequest, rounds: int
) -> None:
    # It has the lowest priority: on a busy machine it would be killed before it can obey.
    monkeypatch.setattr("ntc.worker.client.SECONDS_TO_CANCEL", LONGEST_WAIT)
    shared.start(request_)
    until(shared, TrainingProgress)
    process = shared.process_id
    assert process is not None
    if sys.platform != "win32":
        assert os.getpriority(os.PRIO_PROCESS, process) == 19
    for _ in range(rounds):
        shared.pause()
        until(shared, Paused)
        used = processor_seconds(process)
        time.sleep(0.2)
        assert [report for report in shared.poll() if not isinstance(report, GroupSnapshot | TrainingProgress)] == []
        assert processor_seconds(process) - used < 0.05
        shared.resume()
        until(shared, Resumed)
        until(shared, TrainingProgress)
    shared.pause()
    until(shared, Paused)
    shared.cancel()
    end = until(shared, (Finished, Failed))[-1]
    assert isinstance(end, Finished)
    assert (end.reason, end.pack) == ("cancelled", None)
    assert blocks() == []
    assert shared.process_id == process, "it obeyed, and serves again"


def test_paused_before_it_began_it_waits(shared: TrainingWorker, case: CodecCase) -> None:
    shared.warm_up()
    assert shared.process_id is not None
    # Stopped until both messages have been sent: on a busy machine it would otherwise train between them.
    os.kill(shared.process_id, signal.SIGSTOP)
    try:
        shared.start(case.from_nothing)
        shared.pause()
    finally:
        os.kill(shared.process_id, signal.SIGCONT)
    reports = until(shared, Paused)
    assert not any(isinstance(report, TrainingProgress) for report in reports)
    shared.resume()
    assert isinstance(until(shared, (Finished, Failed))[-1], Finished)


def test_what_cannot_be_trained_is_refused_at_once(shared: TrainingWorker, case: CodecCase) -> None:
    plain, trained = case.from_nothing, case.trained
    others = replace(CODEC, hidden_width=32), BLOCKS_FROM_NOTHING.codec if plain is FROM_NOTHING else CODEC
    for request, words in (
        (replace(plain, textures=()), "no texture to train"),
        (replace(plain, grouping=Grouping("random", (0, 1))), "needs a group for each texture"),
        (replace(plain, start=trained), "no group to train"),
        (replace(plain, start=trained, dirty=frozenset({2})), "groups 0 to 1 only"),
        *((replace(plain, codec=other, start=trained), "another codec") for other in others),
        (replace(plain, textures=TEXTURES[::-1], start=trained), "does not hold these textures"),
        (
            replace(plain, grouping=Grouping("random", (0, 0, 1, 1)), start=trained, dirty=frozenset({0})),
            "group 1: has other textures",
        ),
        (replace(plain, dirty=frozenset({0})), "group 1: has other textures"),
        (replace(plain, budget=StepBudget(0)), "steps is 0"),
        (replace(plain, budget=TimeBudget(math.nan)), "seconds is nan"),
    ):
        with pytest.raises(InputError, match=words):
            shared.start(request)
        assert not shared.busy
    assert blocks() == []


def test_what_fails_in_the_process_is_said_in_one_line(shared: TrainingWorker) -> None:
    shared.start(replace(FROM_NOTHING, training=replace(SHORT, texels_per_texture=-1)))
    end = until(shared, (Finished, Failed))[-1]
    assert isinstance(end, Failed)
    assert end.line.startswith("training: ")
    assert "\n" not in end.line
    assert not shared.busy
    if not torch.cuda.is_available():
        shared.start(replace(FROM_NOTHING, training=replace(SHORT, device="cuda")))
        end = until(shared, (Finished, Failed))[-1]
        assert isinstance(end, Failed)
        assert "CUDA" in end.line
    assert isinstance(finished(shared, replace(FROM_NOTHING, budget=StepBudget(3)))[0], Finished), "it still serves"


def test_without_a_process_or_shared_memory_it_says_so(shared: TrainingWorker, monkeypatch: pytest.MonkeyPatch) -> None:
    real, made = SharedMemory, []

    def scarce(*arguments: Any, **options: Any) -> Any:
        made.append(1)
        if len(made) > 1:
            raise OSError(28, "No space left on device")
        return real(*arguments, **options)

    def refuse(_process: object) -> None:
        raise OSError(11, "Resource temporarily unavailable")

    with monkeypatch.context() as patch:
        patch.setattr("ntc.worker.shared_arrays.SharedMemory", scarce)
        for _ in range(2):
            with pytest.raises(InputError, match=r"shared memory: .* cannot be allocated \(No space left on device\)"):
                shared.start(FROM_NOTHING)
        assert not shared.busy
    monkeypatch.setattr("multiprocessing.context.SpawnProcess.start", refuse)
    with TrainingWorker() as worker:
        with pytest.raises(InputError, match="cannot start a process"):
            worker.start(FROM_NOTHING)
        assert not worker.busy
        assert worker.process_id is None
    assert blocks() == []


def end_at_once(order: TrainingOrder | None, _window: WindowEnd) -> Ended | None:
    """Train nothing."""
    return None if order is None else Ended("cancelled")


def test_an_idle_process_ends_without_a_report(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ntc.worker.client.run_training", end_at_once)
    with TrainingWorker(idle_seconds=0.1) as worker:
        worker.start(FROM_NOTHING)
        process = worker.process_id
        assert process is not None
        assert until(worker, Finished)
        wait_for_end(process)
        began = time.monotonic()
        while worker.process_id is not None and time.monotonic() - began < SECONDS:
            assert worker.poll() == []
            time.sleep(0.01)
        assert worker.process_id is None
        worker.start(FROM_NOTHING)
        assert worker.process_id != process
        assert until(worker, Finished)


@pytest.mark.parametrize("kills", [2, pytest.param(20, marks=pytest.mark.guards("training"))])
def test_killed_at_any_moment_it_says_so_and_leaves_nothing(tmp_path: Path, trained: Pack, kills: int) -> None:
    random = np.random.default_rng(0)
    path = tmp_path / "scene.ntc"
    write_pack(path, trained)
    before = path.read_bytes()
    again = replace(FROM_NOTHING, start=read_pack(path), dirty=frozenset({0}))
    requests = (replace(again, training=ENDLESS, seconds_between_snapshots=0.01), MANY_BLOCKS)
    ended: list[int] = []
    with TrainingWorker() as worker:
        for attempt in range(kills):
            worker.start(requests[attempt % 2])
            process = worker.process_id
            assert process is not None
            # Some of them while it starts, some while it works.
            if attempt % 4 > 1:
                until(worker, TrainingProgress)
            wait = time.monotonic() + random.uniform(0.0, 0.6)
            while time.monotonic() < wait:
                worker.poll()
                time.sleep(0.001)
            os.kill(process, 9)
            report = until(worker, (Finished, Failed))[-1]
            assert isinstance(report, Failed)
            assert "signal 9" in report.line
            assert not worker.busy
            assert ends(process)
            assert blocks() == []
            ended.append(process)
        assert isinstance(finished(worker, replace(again, budget=StepBudget(5)))[0], Finished), "it starts again"
    assert len(set(ended)) == kills
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(sys.platform == "win32", reason="stops by signal")
def test_cancelled_while_it_starts_and_closed_while_it_trains(case: CodecCase) -> None:
    worker = TrainingWorker()
    worker.start(case.from_nothing)
    worker.cancel()
    assert [type(report) for report in worker.poll()] == [Finished], "nothing is waited for"
    worker.start(case.endless)
    process = worker.process_id
    assert process is not None
    # Closing cannot wait until it obeys.
    os.kill(process, signal.SIGSTOP)
    worker.close()
    worker.close()
    assert ends(process)
    assert blocks() == []
    assert worker.poll() == []


@pytest.mark.skipif(sys.platform == "win32", reason="stops by signal")
def test_a_process_that_does_not_obey_is_ended_within_a_second(
    case: CodecCase, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [0.0]
    monkeypatch.setattr("ntc.worker.client.time", SimpleNamespace(monotonic=lambda: now[0]))
    with TrainingWorker() as worker:
        worker.start(case.endless)
        until(worker, TrainingProgress)
        process = worker.process_id
        assert process is not None
        os.kill(process, signal.SIGSTOP)
        worker.cancel()
        now[0] += 0.5
        assert not any(isinstance(report, Finished) for report in worker.poll()), "it is given time to obey"
        assert worker.busy
        now[0] += 0.5
        assert isinstance(worker.poll()[-1], Finished)
        assert not worker.busy
        assert ends(process)
    assert blocks() == []


OWNER = """
import sys, time
import numpy as np
from ntc.codec.grid.model import GridConfig
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture
from ntc.codec.grid.training.config import TrainingConfig
from ntc.worker.client import TrainingWorker
assert "torch" not in sys.modules
from ntc.training.messages import TrainingProgress, TrainingRequest

def main():
    texture = SourceTexture("t", np.zeros((16, 16, 3), np.uint8) + np.arange(16, dtype=np.uint8)[:, None], "0")
    training = TrainingConfig(steps=10**7, texels_per_texture=64, device="cpu", converged_db=None)
    worker = TrainingWorker()
    worker.start(TrainingRequest((texture,), Grouping("single", (0,)), GridConfig(hidden_width=16), training))
    while not any(isinstance(report, TrainingProgress) for report in worker.poll()):
        time.sleep(0.01)
    print(worker.process_id, flush=True)
    while sys.argv[1] == "False":
        time.sleep(0.01)
    # Ends without closing.

if __name__ == "__main__":
    main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="kills by signal")
@pytest.mark.parametrize("closed", [True, False])
def test_nothing_is_left_of_a_program_that_ends_or_is_killed(tmp_path: Path, closed: bool) -> None:
    script = tmp_path / "owner.py"
    script.write_text(OWNER)
    command = [sys.executable, str(script), str(closed)]
    owner = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert owner.stdout is not None
    process = int(owner.stdout.readline())
    if not closed:
        owner.kill()
    _, errors = owner.communicate(timeout=LONGEST_WAIT)
    assert errors == "", "no tracebacks, and no warnings of what leaked"
    assert ends(process)
    assert blocks(owner.pid) == []
    assert owner.returncode == (0 if closed else -9)


def test_a_training_that_waits_for_the_compiler_says_so_and_can_be_cancelled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    with TrainingWorker() as worker:
        worker.start(BLOCKS_FROM_NOTHING)
        (first, *_) = until(worker, TrainingProgress)
        assert isinstance(first, TrainingProgress)
        assert (first.work, first.steps) == (COMPILING, 0)
        worker.cancel()
        end = until(worker, Finished)[-1]
        assert isinstance(end, Finished)
        assert end.reason == "cancelled"
