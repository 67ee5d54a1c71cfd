"""Packs of runs on disk: autosaved in the user's data folder, and written beside their scene when the user keeps them."""

import hashlib
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.io import numbered_path
from ntc.pack.file import write_pack
from viewer.locations import DATA_FOLDER_VARIABLE, packs_folder
from viewer.scene.model import Scene
from viewer.scene.scene_files import PACK_SUFFIX
from viewer.state.events import EmitEvent, Notification
from viewer.state.pack_files import same_place, scenes_with_pack
from viewer.training.run_log import Run

MOST_FILES, MOST_BYTES = 40, 2 * 10**9
"""Autosaved packs of all scenes together: beyond either limit the oldest are deleted."""


def default_path(scene_path: Path | None, pack: Pack) -> Path:
    """Return `SCENE.GROUPING.ntc` beside the scene, or in the user's data folder for a built-in one.

    Raises InputError for a scene without file.
    """
    if scene_path is None:
        raise InputError("the scene was not read from a file; name the file to write the pack to")
    return packs_folder(scene_path) / f"{scene_path.stem}.{pack.grouping.name}{PACK_SUFFIX}"


def _new_file(path: Path) -> Path:
    """Make an empty file at `path`, with a number where that exists, also where two programs do so at once. Raises InputError."""
    while True:
        free = numbered_path(path)
        try:
            free.parent.mkdir(parents=True, exist_ok=True)
            free.touch(exist_ok=False)
        except FileExistsError:
            if free.parent.is_dir():
                continue
            raise InputError(f"{free}: cannot be written (its folder is a file); choose a writable folder") from None
        except OSError as error:
            raise InputError(f"{free}: cannot be written ({error.strerror}); choose a writable folder") from error
        return free


def save_numbered(path: Path, pack: Pack) -> Pack:
    """Write `pack` to `path`, with a number where that exists, and return it with its path. No file is replaced. Raises InputError."""
    free = _new_file(path)
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


class UnsavedRuns:
    """Autosaved packs of one user: ordinary pack files, `SCENE-KEY.GROUPING.ntc`, where KEY follows from the scene's path."""

    def __init__(self, folder: Path) -> None:
        """The first autosave makes `folder`."""
        self._folder = folder

    @staticmethod
    def _stem(scene: Scene) -> str:
        path = str(scene.path.resolve()) if scene.path is not None else ""
        return f"{scene.path.stem if scene.path is not None else scene.name}-{hashlib.sha256(path.encode()).hexdigest()[:8]}"

    def of(self, scene: Scene) -> tuple[Path, ...]:
        """Return the autosaved packs of a scene, oldest first."""
        start = f"{self._stem(scene)}."
        return tuple(path for _, size, path in self._files() if size and path.name.startswith(start))

    def _files(self) -> list[tuple[float, int, Path]]:
        """(time of the last change, bytes, path) of each pack of any scene, oldest first."""
        files = []
        with suppress(OSError):
            for path in self._folder.glob(f"*{PACK_SUFFIX}"):
                with suppress(OSError):
                    status = path.stat()
                    files.append((status.st_mtime, status.st_size, path))
        return sorted(files)

    def new_file(self, scene: Scene, pack: Pack) -> Path:
        """Make the file of one more run of a scene. Raises InputError."""
        try:
            return _new_file(self._folder / f"{self._stem(scene)}.{pack.grouping.name}{PACK_SUFFIX}")
        except InputError as error:
            raise InputError(f"{str(error).partition(';')[0]}; set {DATA_FOLDER_VARIABLE}") from error

    def write(self, file: Path, pack: Pack) -> None:
        """Write a pack over its earlier snapshot, and delete the oldest runs beyond the limits. Raises InputError."""
        write_pack(file, pack)
        total = 0
        for number, (_, size, path) in enumerate(reversed(self._files())):
            total += size
            # The newest stays, however large it is.
            if number and (number >= MOST_FILES or total > MOST_BYTES):
                with suppress(OSError):
                    path.unlink()


@dataclass(frozen=True, eq=False)
class SavedPack:
    """The pack of a run that was written where the user keeps it."""

    run: Run
    """The run at the time when the user kept it."""
    scene: Scene
    pack: Pack
    """The pack with its path."""


class RunStore:
    """Writes packs of runs, one after the other, in a thread. All calls belong to one thread; none but `close` waits."""

    def __init__(self, unsaved: UnsavedRuns | None, emit: EmitEvent) -> None:
        """Without `unsaved` nothing is autosaved. `emit` receives messages."""
        self.unsaved = unsaved
        self._emit = emit
        # Python waits for its thread when the program ends, as it must for a pack.
        self._writer = ThreadPoolExecutor(1, "packs of runs")
        self._writing: list[tuple[Future[Pack | None], Run | None, Scene | None]] = []
        """Files being written; the run and its scene where the user keeps it."""
        self._failed = False

    @property
    def keeps(self) -> bool:
        """True while a pack is written that the user keeps."""
        return any(run is not None for _, run, _ in self._writing)

    @property
    def busy(self) -> bool:
        """True while anything is written."""
        return bool(self._writing)

    def autosave(self, pack: Pack, scene: Scene, file: Path | None) -> Path | None:
        """Write the pack of a run to `file`, over its earlier snapshot; None: to a new one. Returns the file; None where runs are not
        autosaved."""
        if self.unsaved is None:
            return None
        try:
            file = file or self.unsaved.new_file(scene, pack)
        except InputError as error:
            self._complain(error)
            return None
        self._write(partial(self.unsaved.write, file, pack))
        return file

    def keep(self, run: Run, scene: Scene, pack: Pack, path: Path | None) -> None:
        """Write the pack of a run to `path`; None: where packs of its scene lie. A number is added to a name that is taken. Then the
        autosave is deleted. Raises InputError for a path that no pack can have."""
        target = default_path(scene.path, pack) if path is None else checked_path(path, scene.path)

        def write() -> Pack:
            saved = save_numbered(target, pack)
            _delete(run.autosave)
            return saved

        self._write(write, run, scene)

    def discard(self, file: Path | None) -> None:
        """Delete an autosaved pack, after what is still being written to it."""
        self._write(partial(_delete, file))

    def _write(self, write: Callable[[], Pack | None], run: Run | None = None, scene: Scene | None = None) -> None:
        self._writing.append((self._writer.submit(write), run, scene))

    def take_saved(self) -> Iterator[SavedPack]:
        """Yield the packs that were written since the last call and that the user keeps. Errors of writing are notified."""
        while self._writing and self._writing[0][0].done():
            future, run, scene = self._writing.pop(0)
            try:
                pack = future.result()
            except InputError as error:
                if run is None:
                    self._complain(error)
                else:
                    self._emit(Notification(str(error), "error"))
            else:
                if run is not None and scene is not None and pack is not None:
                    self._emit(Notification(f"wrote {pack.path}"))
                    yield SavedPack(run, scene, pack)

    def close(self) -> None:
        """Finish writing."""
        self._writer.shutdown()

    def _complain(self, error: InputError) -> None:
        """Notify once that runs cannot be autosaved: the next one would fail alike."""
        if not self._failed:
            self._failed = True
            self._emit(Notification(f"runs will be lost when the window closes: {error}", "error"))


def _delete(file: Path | None) -> None:
    if file is not None:
        with suppress(OSError):
            file.unlink(missing_ok=True)
