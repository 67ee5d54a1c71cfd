"""Packs of runs on disk: those that were accepted beside their scene, the others in the user's data folder until it is decided."""

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from ntc.codec.model import Pack
from ntc.errors import InputError
from viewer.jobs.job import Job, JobReport
from viewer.scene.model import Scene
from viewer.state.events import EmitEvent, Notification
from viewer.training.active_run import ActiveRun
from viewer.training.kept_runs import KeptRun, KeptRuns, scene_stamp
from viewer.training.pack_saving import FileStamp, checked_path, default_path, file_stamp, save_numbered, save_pack
from viewer.training.run_log import Run

SECONDS_TO_WRITE = 20.0
SECONDS_BETWEEN_KEEPING = 60.0
"""The pack of a run under way is kept in the data folder so often."""


@dataclass(frozen=True, eq=False)
class Saved:
    """What became of an accepted run."""

    run: Run
    """As it was accepted."""
    scene: Scene
    pack: Pack | None
    """With its path; None where it could not be written."""


@dataclass(frozen=True, eq=False)
class _Task:
    """A pack to write, in a thread."""

    run: Run
    scene: Scene
    write: Callable[[], Pack] | None
    """Writes the accepted pack; None: the run is kept in the data folder."""


class RunKeeper:
    """Writes one pack after the other, in a thread. All calls belong to one thread; none but `close` waits."""

    def __init__(self, kept: KeptRuns | None, emit: EmitEvent) -> None:
        """Without `kept`, packs that are not accepted go with the program. `emit` receives messages."""
        self.kept = kept
        self._emit = emit
        self._keys: dict[int, str] = {}
        """Places in the data folder, by the run's number."""
        self._packs: dict[int, Pack] = {}
        """What was kept of a run last, by its number."""
        self._stamps: dict[str, FileStamp] = {}
        """Of the files that were written."""
        self._tasks: list[_Task] = []
        """The first is under way."""
        self._job: Job[Pack | None] | None = None
        self._forgotten: set[int] = set()
        """Numbers of runs whose place is to be removed as soon as nothing writes there."""
        self._failed = False

    @property
    def accepts(self) -> bool:
        """Whether an accepted pack is being written."""
        return any(task.write is not None for task in self._tasks)

    def is_accepting(self, number: int) -> bool:
        """Whether the pack of this run is being written where it was accepted."""
        return any(task.write is not None and task.run.number == number for task in self._tasks)

    @property
    def busy(self) -> bool:
        """Whether anything is being written."""
        return bool(self._tasks)

    def keep(self, run: Run, scene: Scene) -> None:
        """Write the pack of an undecided run to the data folder, in place of its earlier version there."""
        if self.kept is None or run.pack is None or self._packs.get(run.number) is run.pack:
            return
        self._packs[run.number] = run.pack
        self._forgotten.discard(run.number)
        waiting = self._tasks[1:]
        # A newer version replaces one that is not written yet.
        self._tasks[1:] = [task for task in waiting if task.write is not None or task.run.number != run.number]
        self._add(_Task(run, scene, None))

    def keep_so_far(self, active: ActiveRun) -> None:
        """Keep a run under way, now and then: a crash costs no more than what was trained since."""
        if active.pack is active.kept or time.monotonic() - active.kept_at < SECONDS_BETWEEN_KEEPING:
            return
        so_far = active.pack_so_far()
        if so_far is not None:
            active.kept, active.kept_at = active.pack, time.monotonic()
            self.keep(active.ended("under way", so_far, ()), active.scene)

    def accept(self, run: Run, scene: Scene, path: Path | None, opened: Sequence[Pack]) -> None:
        """Write the pack of a run to `path`, or where packs of its scene lie, and remove it from the data folder then.

        `opened` are the packs that are open. Raises InputError for a path that no pack can have.
        """
        assert run.pack is not None
        if path is None:
            write = partial(save_numbered, default_path(scene.path, run.pack), run.pack)
        else:
            path = checked_path(path)
            written = self._stamps.get(os.path.realpath(path))
            write = partial(save_pack, path, run.pack, opened, written)
        self._add(_Task(run, scene, write))

    def take_over(self, run: Run, key: str) -> None:
        """The run is the one at `key` in the data folder, which this window has claimed."""
        self._keys[run.number] = key
        if run.pack is not None:
            self._packs[run.number] = run.pack

    def forget(self, number: int) -> None:
        """A run was decided: nothing of it stays in the data folder."""
        self._tasks[1:] = [t for t in self._tasks[1:] if t.write is not None or t.run.number != number]
        self._forgotten.add(number)
        self._remove_forgotten()

    def leave(self, first: int | None = None) -> bool:
        """Leave what is kept of runs before number `first` to whichever window asks for it, unless anything is being written.

        Whether there was any.
        """
        if self.busy or self.kept is None:
            return False
        left = [number for number in self._keys if first is None or number < first]
        for number in left:
            self.kept.release(self._keys.pop(number))
        return bool(left)

    def take_saved(self) -> tuple[Saved, ...]:
        """Accepted runs that have been written since the last call, or could not be."""
        if self._job is None or not self._job.done:
            return ()
        task, job, self._job = self._tasks.pop(0), self._job, None
        saved: tuple[Saved, ...] = ()
        try:
            pack = job.result()
            if task.write is not None:
                self._forgotten.add(task.run.number)
                self._note(pack)
                saved = (Saved(task.run, task.scene, pack),)
        except InputError as error:
            if task.write is not None:
                saved = (Saved(task.run, task.scene, None),)
                self._emit(Notification(str(error), "error"))
            else:
                self._complain(error)
        self._remove_forgotten()
        self._start()
        return saved

    def close(self) -> tuple[Saved, ...]:
        """Finish writing, for so long as it may take, and let go of what is kept; what was accepted meanwhile."""
        end = time.monotonic() + SECONDS_TO_WRITE
        saved: list[Saved] = []
        while self._job is not None and time.monotonic() < end:
            self._job.join(end - time.monotonic())
            saved += self.take_saved()
        self._tasks.clear()
        self._remove_forgotten()
        self.leave()
        return tuple(saved)

    def _note(self, pack: Pack | None) -> None:
        path = pack.path if pack is not None else None
        stamp = file_stamp(path) if path is not None else None
        if path is not None and stamp is not None:
            self._stamps[os.path.realpath(path)] = stamp
        self._emit(Notification(f"wrote {path}"))

    def _add(self, task: _Task) -> None:
        self._tasks.append(task)
        self._start()

    def _start(self) -> None:
        while self._job is None and self._tasks:
            task = self._tasks[0]
            if task.write is not None:
                self._job = self._accepting(task.write)
                return
            try:
                self._job = self._keeping(task)
            except InputError as error:
                self._tasks.pop(0)
                self._complain(error)

    @staticmethod
    def _accepting(write: Callable[[], Pack]) -> Job[Pack | None]:
        return Job[Pack | None](lambda _report: write()).start("save pack")

    def _keeping(self, task: _Task) -> Job[Pack | None]:
        """Raises InputError where there is no place for it."""
        kept, run, scene = self.kept, task.run, task.scene
        assert kept is not None
        assert run.pack is not None
        if run.number not in self._keys:
            self._keys[run.number] = kept.new_key()
        key, pack = self._keys[run.number], run.pack
        path = str(scene.path.resolve()) if scene.path is not None else ""
        stamp = scene_stamp(scene.path)
        about = (run.title, run.settings, run.outcome, run.groups, run.seconds, run.psnr_db)
        facts = KeptRun(scene.name, path, stamp, *about, number=run.number, ended=time.time())

        def keep(_report: JobReport) -> None:
            kept.write(key, pack, facts)

        return Job[Pack | None](keep).start("keep run")

    def _remove_forgotten(self) -> None:
        under_way = {self._tasks[0].run.number} if self._tasks else set()
        for number in self._forgotten - under_way:
            self._forgotten.discard(number)
            self._packs.pop(number, None)
            key = self._keys.pop(number, None)
            if key is not None and self.kept is not None:
                self.kept.remove(key)

    def _complain(self, error: InputError) -> None:
        """Once: the next run would fail alike."""
        if not self._failed:
            self._failed = True
            self._emit(Notification(f"runs will be lost when the window closes: {error}", "error"))


def accepted(run: Run, saved: Saved, open_as: str) -> Run:
    """`run` as the log keeps it once its pack is written and open under the name `open_as`."""
    assert saved.pack is not None
    return replace(run, pack=saved.pack, saved=saved.pack.path, open_as=open_as)
