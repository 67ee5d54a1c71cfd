"""Packs of runs on disk: accepted ones beside their scene, the others in the user's data folder until it is decided."""

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.io import numbered_path
from ntc.pack.file import read_pack, write_pack
from ntc.pack.match import changed_textures, require_match, same_shape
from viewer.jobs.job import Job, JobReport
from viewer.locations import DATA_FOLDER_VARIABLE, packs_folder
from viewer.scene.model import Scene
from viewer.scene.scene_files import PACK_SUFFIX
from viewer.state.events import EmitEvent, Notification
from viewer.state.pack_files import match_scene, same_place, scenes_with_pack
from viewer.training.kept_runs import KeptRun, KeptRuns, scene_stamp
from viewer.training.run_log import ActiveRun, Run

FileStamp = tuple[int, int, int]
"""Inode, time of the last change in ns, and bytes of a file: differs when the file has been written anew."""


def default_path(scene_path: Path | None, pack: Pack) -> Path:
    """Return `SCENE.GROUPING.ntc` beside the scene, or in the user's data folder for a built-in one, which is made where it is not
    there.

    Raises InputError for a scene without file.
    """
    if scene_path is None:
        raise InputError("the scene was not read from a file; name the file to write the pack to")
    folder = packs_folder(scene_path)
    if folder != scene_path.parent:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: cannot be created ({error.strerror}); set {DATA_FOLDER_VARIABLE}") from error
    return folder / f"{scene_path.stem}.{pack.grouping.name}{PACK_SUFFIX}"


def save_numbered(path: Path, pack: Pack) -> Pack:
    """Write `pack` to `path`, with a number where that exists, and return it with its path. Raises InputError.

    No file is replaced, also where two programs write at once.
    """
    while True:
        free = numbered_path(path)
        try:
            free.touch(exist_ok=False)
        except FileExistsError:
            continue
        except OSError as error:
            raise InputError(f"{free}: cannot be written ({error.strerror}); choose a writable folder") from error
        try:
            write_pack(free, pack)
        except BaseException:
            free.unlink(missing_ok=True)
            raise
        return replace(pack, path=free)


def checked_path(path: Path, scene_path: Path | None) -> Path:
    """Return `path` unchanged. Raises InputError for a name that no pack of the scene can have: one that is no pack's, and one that
    would open with another scene."""
    if path.suffix != PACK_SUFFIX:
        raise InputError(f"{path}: a pack's name ends in {PACK_SUFFIX}")
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a file")
    scenes = scenes_with_pack(path)
    if scenes and not any(scene_path is not None and same_place(scene, scene_path) for scene in scenes):
        raise InputError(f"{path}: would open with {scenes[0].name}, which is another scene; choose another name")
    return path


def _is_as_opened(path: Path, opened: Sequence[Pack]) -> bool:
    """Return whether the file at `path` still holds one of these packs, which were read from there or written to it."""
    try:
        present = read_pack(path)
    except InputError:
        return False
    return any(
        pack.grouping == present.grouping and same_shape(pack, present) and not changed_textures(pack, present)
        for pack in opened
    )


def file_stamp(path: Path) -> FileStamp | None:
    """Return the stamp of the file at `path`; None without one."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns, status.st_size


def save_pack(path: Path, pack: Pack, opened: Sequence[Pack] = (), written: FileStamp | None = None) -> Pack:
    """Write `pack` and return it with its path.

    Raises InputError where the file cannot be written, and where it is that of one of the `opened` packs but another program has
    changed it since. `written` is the stamp of the file as this program wrote it last.
    """
    own = [other for other in opened if other.path is not None and same_place(other.path, path)]
    present = file_stamp(path)
    if own and present is not None and present != written and not _is_as_opened(path, own):
        raise InputError(
            f"{path}: has changed since it was opened; accept under another name (training.accept FILE), or open it again first"
        )
    write_pack(path, pack)
    return replace(pack, path=path)


class WaitingRuns:
    """The waiting runs as one window knows them. All calls belong to one thread."""

    def __init__(self, kept: KeptRuns | None) -> None:
        """Without `kept` there are none."""
        self._kept = kept
        self.runs: tuple[KeptRun, ...] = ()
        """Newest first, as they were when they were looked for last."""
        self._looked = False

    def look(self, scene: Scene) -> str:
        """Look which runs wait now; a line that says so where there is news: of all when first asked, then of this scene."""
        if self._kept is None:
            return ""
        is_first, self._looked = not self._looked, True
        self.runs = self._kept.waiting()
        told = self.runs if is_first else self.of(scene)
        if not told:
            return ""
        lines = ", ".join(run.line for run in told[:3]) + (f" and {len(told) - 3} more" if len(told) > 3 else "")
        return f"undecided runs of an earlier session: {lines}; accept or discard them in panel Training"

    def of(self, scene: Scene) -> tuple[KeptRun, ...]:
        """Return the waiting runs that were made of this scene."""
        return tuple(run for run in self.runs if run.is_of(scene.path))

    def __getitem__(self, key: str) -> KeptRun:
        """Raises InputError where there is none of that key."""
        for run in self.runs:
            if run.key == key:
                return run
        raise InputError("training: that run no longer exists")

    def adopted(self, key: str, number: int, scene: Scene) -> Run:
        """Adopt a waiting run: this window holds its lock from now on. Raises InputError where it does not fit `scene`."""
        kept, facts = self._claim(key)
        try:
            pack = kept.read(key)
            if not facts.is_of(scene.path):
                raise InputError(f"{facts.line}: was trained on {facts.scene_path or 'another scene'}; open that first")
            require_match(pack, match_scene(pack, scene), scene.name)
        except InputError:
            kept.release(key)
            raise
        self.runs = tuple(run for run in self.runs if run.key != key)
        ended = (facts.outcome, facts.seconds, facts.psnr_db)
        return Run(
            number,
            facts.title,
            facts.settings,
            facts.groups,
            *ended,
            (f"from an earlier session, {facts.clock}",),
            pack,
        )

    def write(self, key: str) -> Path:
        """Write a run's pack where those of the scene lie that it was made of; the file's path.

        Raises InputError, also where that scene is gone, or another one by now: its packs would not fit.
        """
        kept, facts = self._claim(key)
        try:
            scene = Path(facts.scene_path)
            if not facts.scene_path or scene_stamp(scene) != facts.scene_stamp:
                raise InputError(
                    f"{facts.line}: {facts.scene_path} has changed since; open the run and accept it into a file"
                )
            pack = kept.read(key)
            written = save_numbered(default_path(scene, pack), pack).path
        except InputError:
            kept.release(key)
            raise
        assert written is not None
        self._remove(key, kept)
        return written

    def discard(self, key: str) -> None:
        """Remove a run for good. Raises InputError where another window has it."""
        kept, _ = self._claim(key)
        self._remove(key, kept)

    def _remove(self, key: str, kept: KeptRuns) -> None:
        kept.remove(key)
        self.runs = tuple(run for run in self.runs if run.key != key)

    def _claim(self, key: str) -> tuple[KeptRuns, KeptRun]:
        facts, kept = self[key], self._kept
        if kept is None or not kept.claim(key):
            self.runs = tuple(run for run in self.runs if run.key != key)
            raise InputError(f"{facts.line}: is open in another window, or was removed")
        return kept, facts


SECONDS_TO_WRITE = 20.0
SECONDS_BETWEEN_KEEPING = 60.0
"""The pack of a run under way is kept in the data folder so often."""


@dataclass(frozen=True, eq=False)
class Saved:
    """An accepted run whose pack has been written."""

    run: Run
    """The run at the time when it was accepted."""
    scene: Scene
    pack: Pack
    """The pack with its path."""


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
        """Packs that were kept last, by the run's number."""
        self._stamps: dict[str, FileStamp] = {}
        """Stamps of the files that were written."""
        self._tasks: list[_Task] = []
        """The first is under way."""
        self._job: Job[Pack | None] | None = None
        self._forgotten: set[int] = set()
        """Numbers of runs whose place is to be removed as soon as nothing writes there."""
        self._failed = False

    @property
    def accepts(self) -> bool:
        """True if an accepted pack is being written."""
        return any(task.write is not None for task in self._tasks)

    def is_accepting(self, number: int) -> bool:
        """Return whether the pack of this run is being written where it was accepted."""
        return any(task.write is not None and task.run.number == number for task in self._tasks)

    @property
    def busy(self) -> bool:
        """True if anything is being written."""
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
            path = checked_path(path, scene.path)
            written = self._stamps.get(os.path.realpath(path))
            write = partial(save_pack, path, run.pack, opened, written)
        self._add(_Task(run, scene, write))

    def take_over(self, run: Run, key: str) -> None:
        """Note that `run` is the one at `key` in the data folder, which this window has claimed."""
        self._keys[run.number] = key
        if run.pack is not None:
            self._packs[run.number] = run.pack

    def forget(self, number: int) -> None:
        """Remove a run that was decided from the data folder."""
        self._tasks[1:] = [t for t in self._tasks[1:] if t.write is not None or t.run.number != number]
        self._forgotten.add(number)
        self._remove_forgotten()

    def leave(self, first: int | None = None) -> bool:
        """Release the kept runs before number `first` to other windows, unless anything is being written.

        Returns whether there was any.
        """
        if self.busy or self.kept is None:
            return False
        left = [number for number in self._keys if first is None or number < first]
        for number in left:
            self.kept.release(self._keys.pop(number))
        return bool(left)

    def take_saved(self) -> Saved | None:
        """Return an accepted run that has been written since the last call. Errors of writing are notified."""
        if self._job is None or not self._job.done:
            return None
        task, job, self._job = self._tasks.pop(0), self._job, None
        saved = None
        try:
            pack = job.result()
            if task.write is not None and pack is not None and pack.path is not None:
                self._forgotten.add(task.run.number)
                stamp = file_stamp(pack.path)
                if stamp is not None:
                    self._stamps[os.path.realpath(pack.path)] = stamp
                self._emit(Notification(f"wrote {pack.path}"))
                saved = Saved(task.run, task.scene, pack)
        except InputError as error:
            if task.write is not None:
                self._emit(Notification(str(error), "error"))
            else:
                self._complain(error)
        self._remove_forgotten()
        self._start()
        return saved

    def close(self) -> None:
        """Finish writing, for SECONDS_TO_WRITE at most, and release the runs that are kept."""
        end = time.monotonic() + SECONDS_TO_WRITE
        while self._job is not None and time.monotonic() < end:
            self._job.join(end - time.monotonic())
            self.take_saved()
        self._tasks.clear()
        self._remove_forgotten()
        self.leave()

    def _add(self, task: _Task) -> None:
        self._tasks.append(task)
        self._start()

    def _start(self) -> None:
        while self._job is None and self._tasks:
            task = self._tasks[0]
            try:
                self._job = self._keeping(task) if task.write is None else self._accepting(task.write)
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
        """Notify that runs cannot be kept, once: the next run would fail alike."""
        if not self._failed:
            self._failed = True
            self._emit(Notification(f"runs will be lost when the window closes: {error}", "error"))
