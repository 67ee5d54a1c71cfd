"""Runs that windows before this one have left undecided: listed until they are opened, written beside their scene, or removed."""

from pathlib import Path

from ntc.errors import InputError
from ntc.pack.match import require_match
from viewer.scene.model import Scene
from viewer.state.pack_files import match_scene
from viewer.training.kept_runs import KeptRun, KeptRuns, scene_stamp
from viewer.training.pack_saving import default_path, save_numbered
from viewer.training.run_log import Run


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
        return f"kept back from an earlier session: {lines}; see the panel Training"

    def of(self, scene: Scene) -> tuple[KeptRun, ...]:
        """Those that were made of this scene."""
        return tuple(run for run in self.runs if run.is_of(scene.path))

    def __getitem__(self, key: str) -> KeptRun:
        """Raises InputError where there is none of that key."""
        for run in self.runs:
            if run.key == key:
                return run
        raise InputError("training: that run no longer exists")

    def adopted(self, key: str, number: int, scene: Scene) -> Run:
        """A run as one of this window's, which has its lock from now on. Raises InputError where it does not fit `scene`."""
        kept, facts = self._claim(key)
        try:
            pack = kept.read(key)
            if not facts.is_of(scene.path):
                raise InputError(f"{facts.line}was trained on {facts.scene_path or 'another scene'}; open that first")
            require_match(pack, match_scene(pack, scene), scene.name)
        except InputError:
            kept.release(key)
            raise
        self.runs = tuple(run for run in self.runs if run.key != key)
        ended = (facts.outcome, facts.seconds, facts.psnr_db)
        return Run(number, facts.title, facts.settings, facts.groups, *ended, (f"kept back at {facts.clock}",), pack)

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
