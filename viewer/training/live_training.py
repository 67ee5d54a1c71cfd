"""Training beside the window: prepares it, runs it, takes its pictures in one by one, keeps the log. No OpenGL, no torch."""

import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ntc.errors import InputError
from ntc.pack.model import Pack
from ntc.training.snapshot import GroupSnapshot, apply_snapshot
from ntc.worker.client import TrainingWorker, starting_pack
from ntc.worker.protocol import Failed, Finished, Paused, Report, Resumed, TrainingRequest, WorkerProgress
from viewer.jobs.task import Task
from viewer.scene.model import Scene
from viewer.state.actions import Side
from viewer.state.view_state import REFERENCE
from viewer.training.accepting import Stamp, checked_path, default_path, save_pack, stamp_of
from viewer.training.preparation import EncodeScene, Wish, prepare, settings_text
from viewer.training.run_log import RunLog
from viewer.training.runs import Curves, Run, mean_of_psnr, mean_psnr_db
from viewer.training.settings import TrainingSettings
from viewer.training.work import State, Work, put_away

if TYPE_CHECKING:
    from viewer.state.session import Session

SECONDS_BETWEEN_TICKS = 0.1
"""A window that otherwise rests looks so often what the training says."""
MOST_NOTES = 20
SECONDS_TO_STOP = 3.0
SECONDS_TO_WRITE = 20.0


SECONDS_BETWEEN_PICTURES = 1.0
"""Of a training: snapshots that come sooner are shown together."""


class LiveTraining:
    """The training of one session. All calls belong to one thread; none of them waits."""

    def __init__(self, settings: TrainingSettings | None = None) -> None:
        self.settings = settings or TrainingSettings()
        """What the next training is asked for where nobody says otherwise."""
        self._log = RunLog()
        self.curves: Curves | None = None
        """Of the run under way, else of the last one."""
        self._work: Work | None = None
        self._worker = TrainingWorker()
        self._preparation: Task[TrainingRequest] | None = None
        self._saving: tuple[int, Task[Pack]] | None = None
        self._dropped: list[Task[None]] = []
        self._written: dict[str, Stamp] = {}
        """Files that were written, as they were then."""
        self._last_tick = 0.0
        self._scene: Scene | None = None

    @property
    def runs(self) -> tuple[Run, ...]:
        """All runs of the scene, oldest first."""
        return self._log.runs

    @property
    def undecided(self) -> int | None:
        """Number of the run that is to be accepted or discarded."""
        return self._log.undecided

    @property
    def work(self) -> Work | None:
        """The run under way. To be read only."""
        return self._work

    @property
    def state(self) -> State:
        """What is going on."""
        return "idle" if self._work is None else self._work.state

    @property
    def saving(self) -> bool:
        """Whether a pack is being written."""
        return self._saving is not None

    @property
    def process_id(self) -> int | None:
        """Of the training process, where there is one."""
        return self._worker.process_id

    def run_numbered(self, number: int) -> Run:
        """A run of the log. Raises InputError."""
        return self._log[number]

    def base_name(self, session: "Session") -> str | None:
        """Name of the pack that a training would go on from: what A shows, else B, else the first that is open."""
        for slot in (session.view.slot_a, session.view.slot_b):
            if slot.source in session.packs:
                return slot.source
        return next(iter(session.packs), None)

    def start(self, session: "Session", wish: Wish) -> None:
        """Begin. Raises InputError where another training is under way, and for wishes that cannot be."""
        if self._work is not None:
            raise InputError("training: another one is under way; cancel it first (training.cancel)")
        if self._saving is not None:
            raise InputError("training: a pack is being written; try again in a moment")
        if self._scene is not session.scene:
            self._forget_runs(session.scene)
        name = None if isinstance(wish, EncodeScene) else self.base_name(session)
        base = session.packs[name] if name is not None else None
        if base is None and not isinstance(wish, EncodeScene):
            raise InputError("training: there is no pack to go on from; encode the scene first (training.encode)")
        scene = session.scene
        self._work = Work(self._log.next_number, wish, scene, name, base, time.monotonic())
        self._log.undecided = None
        self.curves = self._work.curves
        worker = self._worker

        def work(stopped: Callable[[], bool]) -> TrainingRequest:
            # Nobody else uses the worker until this is done.
            worker.warm_up()
            request = prepare(wish, scene, base, stopped)
            return request if stopped() else worker.start(request)

        self._preparation = Task(work)

    def pause(self) -> None:
        """Stand still. Raises InputError where nothing is trained."""
        work = self._trained()
        if work.state == "training":
            self._worker.pause()
            work.state = "pausing"

    def resume(self) -> None:
        """Go on. Raises InputError where nothing is trained."""
        work = self._trained()
        if work.state in ("paused", "pausing"):
            self._worker.resume()

    def cancel(self) -> None:
        """End the training; what has been shown stays. Raises InputError where there is none."""
        if self._work is None:
            raise InputError("training: there is none under way")
        if self._preparation is not None:
            self._preparation.stop()
        else:
            self._worker.cancel()
        self._work.state = "cancelling"

    def _trained(self) -> Work:
        if self._work is None:
            raise InputError("training: there is none under way")
        if self._work.state == "preparing":
            raise InputError("training: it has not begun yet; wait, or cancel it")
        return self._work

    def accept(self, session: "Session", path: Path | None = None) -> None:
        """Write the undecided run's pack. Raises InputError where there is none, and for a path that cannot be."""
        self._require_nothing_saved()
        run = self._log.undecided_run()
        assert run.pack is not None
        pack = run.pack
        chosen = checked_path(path) if path is not None else default_path(session.scene, pack)
        opened, written = tuple(session.packs.values()), self._written.get(os.path.realpath(chosen))
        self._saving = (run.number, Task(lambda _stopped: save_pack(chosen, pack, opened, written)))

    def discard(self, session: "Session") -> None:
        """Show again what was shown before the undecided run. Raises InputError where there is none."""
        self._require_nothing_saved()
        self._log.discard(session)

    def show(self, session: "Session", number: int, side: Side) -> None:
        """Put the pack of a run into a slot. Raises InputError where there is no such run, or none of its pack."""
        run = self.run_numbered(number)
        if run.pack is None:
            raise InputError(f"run {number}: has no pack ({run.outcome}); train it again")
        if session.packs.get(run.name) is not run.pack:
            session.packs = {**session.packs, run.name: run.pack}
        view = session.view
        slot = view.slot_a if side == "a" else view.slot_b
        slot = replace(slot, source=run.name, path="cached" if slot.source == REFERENCE else slot.path)
        session.view = replace(view, slot_a=slot) if side == "a" else replace(view, slot_b=slot)
        if view.compare not in (side, "wipe"):
            session.view = replace(session.view, compare=side)
        if self._work is None and self._saving is None and run.saved is None:
            self._log.undecided = number

    def _require_nothing_saved(self) -> None:
        if self._saving is not None:
            raise InputError("training: the pack is being written already")

    @property
    def is_due(self) -> bool:
        """Whether a window that rests should draw a frame, for there may be news."""
        active = self._work is not None or self._saving is not None
        return active and time.monotonic() - self._last_tick >= SECONDS_BETWEEN_TICKS

    def tick(self, session: "Session") -> None:
        """Once a frame: take in what has happened, one snapshot at most."""
        self._last_tick = time.monotonic()
        self._dropped = [task for task in self._dropped if not task.done]
        self._take_saved(session)
        work = self._work
        if work is None:
            return
        if work.scene is not session.scene:
            self._leave(session)
            return
        if self._preparation is not None:
            self._take_prepared(session, work)
            return
        for report in self._worker.poll():
            self._take(session, work, report)
        if self._work is work:
            self._put_up(session, work)

    def _take_prepared(self, session: "Session", work: Work) -> None:
        task = self._preparation
        if task is None or not task.done:
            return
        self._preparation = None
        try:
            request = task.result()
        except InputError as error:
            session.say(str(error), "error")
            self._end(session, work, "failed", None, (str(error),))
            return
        if request is not None:
            work.request, work.pack = request, starting_pack(request)
        if work.state == "preparing":
            work.state = "training"
        elif self._worker.busy:
            # It was cancelled, but has begun all the same.
            self._worker.cancel()
        else:
            self._end(session, work, "cancelled", None)
            session.say(f"{work.name} was cancelled; nothing came of it")

    def _take(self, session: "Session", work: Work, report: Report) -> None:
        match report:
            case WorkerProgress():
                work.progress = report
                work.curves.add(report)
                if report.note:
                    work.notes = (*work.notes, report.note)[-MOST_NOTES:]
            case GroupSnapshot():
                self._take_snapshot(session, work, report)
            case Paused():
                work.state = "paused" if work.state == "pausing" else work.state
            case Resumed():
                work.state = "training" if work.state in ("paused", "pausing") else work.state
            case Finished():
                self._take_finished(session, work, report)
            case Failed():
                session.say(report.line, "error")
                self._end(session, work, "failed", work.pack_so_far(), (report.line,))

    def _take_snapshot(self, session: "Session", work: Work, snapshot: GroupSnapshot) -> None:
        assert work.pack is not None
        work.pack = apply_snapshot(work.pack, snapshot)
        first = not work.groups_seen
        work.groups_seen |= {snapshot.group}
        work.is_ahead = True
        self._put_up(session, work)
        if first:
            work.first_picture_seconds = time.monotonic() - work.began
            work.show_beside(session)

    def _put_up(self, session: "Session", work: Work) -> None:
        """Show what snapshots have brought, not too often: every picture of it costs several frames."""
        now = time.monotonic()
        if work.is_ahead and work.pack is not None and now - work.put_up_at >= SECONDS_BETWEEN_PICTURES:
            work.is_ahead, work.put_up_at = False, now
            session.packs = {**session.packs, work.name: work.pack}

    def _take_finished(self, session: "Session", work: Work, finished: Finished) -> None:
        lines = tuple(outcome.line() for outcome in finished.outcomes)
        if finished.pack is not None:
            session.packs = {**session.packs, work.name: finished.pack}
            if not work.groups_seen:
                work.show_beside(session)
            worse = sum(outcome.kept_old for outcome in finished.outcomes)
            kept = (
                f"; {worse} of {len(finished.outcomes)} groups were better before and stay as they were"
                if worse
                else ""
            )
            self._end(session, work, finished.reason, finished.pack, lines)
            session.say(f"{work.name} ({work.wish.title()}): {finished.reason}{kept}. Accept or discard it")
            return
        pack = work.pack_so_far()
        self._end(session, work, "cancelled", pack, lines)
        stays = "its last picture stays: accept or discard it" if pack is not None else "nothing came of it"
        session.say(f"{work.name} was cancelled; {stays}")

    def _end(
        self, session: "Session", work: Work, outcome: str, pack: Pack | None, lines: tuple[str, ...] = ()
    ) -> None:
        """Put the run down in the log; without a pack what was shown before is shown again."""
        progress, request = work.progress, work.request
        psnr = mean_psnr_db(pack) if pack is not None else None
        if psnr is None and pack is not None and progress is not None and progress.psnr_db:
            psnr = mean_of_psnr(list(progress.psnr_db.values()))
        run = Run(
            work.number,
            work.wish.title(),
            settings_text(work.wish),
            request.grouping.group_count if request is not None else 0,
            outcome,
            progress.elapsed_seconds if progress is not None else 0.0,
            psnr,
            (*lines, *work.notes),
            pack,
        )
        self._work = None
        self._log.add(run, work.before)
        if pack is not None:
            session.packs = {**session.packs, run.name: pack}
        elif work.name in session.packs:
            put_away(session, work.name, work.before)
        self._log.let_go(session)

    def _take_saved(self, session: "Session") -> None:
        if self._saving is None or not self._saving[1].done:
            return
        number, task = self._saving
        self._saving = None
        try:
            pack = task.result()
        except InputError as error:
            session.say(str(error), "error")
            return
        if pack is not None and pack.path is not None and (stamp := stamp_of(pack.path)) is not None:
            self._written[os.path.realpath(pack.path)] = stamp
        if pack is None or number not in self._log:
            return
        run = self._log[number]
        self._log.change(replace(run, pack=pack, saved=pack.path, outcome=f"{run.outcome}, accepted"))
        if self.undecided == number:
            self._log.undecided = None
        if run.name in session.packs:
            session.packs = {**session.packs, run.name: pack}
        session.say(f"wrote {pack.path}")

    def _leave(self, session: "Session") -> None:
        """Another scene was opened."""
        if self._preparation is not None:
            self._leave_preparation(self._preparation)
        else:
            self._worker.close()
        self._work = None
        self._forget_runs(session.scene)
        session.say("the training ended, because another scene was opened")

    def _leave_preparation(self, preparation: Task[TrainingRequest]) -> None:
        """Its thread may be using the worker: both are left to end, and there is a new worker."""
        worker, self._worker, self._preparation = self._worker, TrainingWorker(), None
        preparation.stop()

        def end(_stopped: Callable[[], bool]) -> None:
            preparation.join(SECONDS_TO_WRITE)
            worker.close()

        self._dropped.append(Task(end))

    def _forget_runs(self, scene: Scene) -> None:
        self._scene = scene
        self._log = RunLog()
        self.curves = None

    def close(self) -> None:
        """End everything: the process, the threads; a pack that is being written is finished."""
        if self._preparation is not None:
            self._preparation.stop()
            self._preparation.join(SECONDS_TO_STOP)
            self._preparation = None
        if self._saving is not None:
            self._saving[1].join(SECONDS_TO_WRITE)
            self._saving = None
        for task in self._dropped:
            task.join(SECONDS_TO_STOP)
        self._worker.close()
        self._work = None
