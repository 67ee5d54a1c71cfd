"""Training beside the window: prepares a run, passes its snapshots on as events, keeps the log. No OpenGL, no torch, no session."""

import time
from collections.abc import Container
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.pack.file import read_pack
from ntc.pack.match import require_match
from ntc.training.messages import GroupSnapshot, TrainingProgress, TrainingRequest
from ntc.worker.client import Finished, Report, TrainingWorker
from ntc.worker.process import Failed, Paused, Resumed
from viewer.jobs.job import Job, JobReport
from viewer.scene.json_text import counted
from viewer.scene.model import Scene
from viewer.state.events import EmitEvent, Notification, PackClosed, PackRenamed, PackShown, PackUpdated
from viewer.state.pack_files import match_scene, pack_figures, unused_name
from viewer.training.preparation import AheadPreparation, EncodeScene, TrainingJob, job_title, prepare
from viewer.training.rates import RateCurves, sampled_textures
from viewer.training.run_log import ActiveRun, Curves, Run, RunLog, State
from viewer.training.run_store import RunStore, UnsavedRuns
from viewer.training.settings import TrainingSettings

SECONDS_BETWEEN_TICKS = 0.1
"""A window at rest draws a frame so often while a run is under way."""
SECONDS_BETWEEN_UPDATES = 1.0
"""Snapshots that come sooner are shown together: every new version of a pack costs several frames."""
SECONDS_BETWEEN_AUTOSAVES = 60.0
"""The pack of a run under way is autosaved so often, from its first complete snapshot on."""
SECONDS_TO_STOP = 3.0
SECONDS_TO_END = 20.0


class LiveTraining:
    """The training of one window. All calls belong to one thread; none of them waits."""

    def __init__(self, emit: EmitEvent, unsaved: UnsavedRuns | None = None) -> None:
        """`emit` receives messages, and packs as they are trained. Runs are autosaved in `unsaved`; without it they end with the
        program."""
        self._emit = emit
        self._store = RunStore(unsaved, emit)
        self.log = RunLog()
        """Ended runs of the scene, with unsaved ones of earlier windows."""
        self.active: ActiveRun | None = None
        """The run under way. To be read only."""
        self.curves: Curves | None = None
        """Curves of the run under way, else of the last one."""
        self.plan = TrainingSettings()
        """How the next encoding is to be done, for the offer, the panel and the menu alike. Commands change it."""
        self.rates = RateCurves()
        """Rate curves of the scene's textures."""
        self._scene: Scene | None = None
        """The scene of the runs: their packs are written for no other."""
        self._worker = TrainingWorker()
        self._ahead = AheadPreparation()
        self._preparation: Job[TrainingRequest] | None = None
        self._stopping: list[Job[None]] = []
        """Workers of scenes that were closed, about to end."""
        self._last_tick = 0.0
        self._packs_to_drop = False
        """True if a run has ended since old packs were dropped."""

    @property
    def state(self) -> State:
        """State of the run under way."""
        return "idle" if self.active is None else self.active.state

    @property
    def saving(self) -> bool:
        """True if a pack is being written that the user keeps."""
        return self._store.keeps

    @property
    def process_id(self) -> int | None:
        """Id of the training process, where there is one."""
        return self._worker.process_id

    def start(self, job: TrainingJob, scene: Scene, base: Pack | None) -> None:
        """Begin a run; it goes on from the pack `base`, unless the scene is encoded from nothing.

        Raises InputError where another run is under way, and where there is no pack to go on from.
        """
        if self.active is not None:
            raise InputError("training: another run is under way; cancel it first (training.cancel)")
        if base is None and not isinstance(job, EncodeScene):
            raise InputError("training: no pack is open to continue from; encode the scene first (training.encode)")
        self.enter(scene)
        pack = None if isinstance(job, EncodeScene) else base
        self.active = ActiveRun(self.log.next_number, job, scene, time.monotonic())
        self.log.chosen = None
        self.curves = self.active.curves
        worker, ahead = self._worker, self._ahead

        def begin(report: JobReport) -> TrainingRequest:
            # No other code uses the worker until this job is done.
            request = ahead.take(job, scene, report)
            worker.warm_up()
            request = request or prepare(job, scene, pack, report)
            report.check()
            return worker.start(request)

        self._preparation = Job(begin).start("prepare training")

    def enter(self, scene: Scene) -> None:
        """Make `scene` the open one, and list its unsaved runs. A run of another scene ends; its autosave stays."""
        if self._scene is scene:
            return
        was_under_way = self.active is not None
        if self._scene is not None:
            self.leave_scene()
        self._scene = scene
        if self._store.unsaved is not None:
            self.log = RunLog(self._store.unsaved.of(scene))
            if count := len(self.log.runs):
                runs = counted(count, "unsaved run")
                self._emit(Notification(f"{runs} of this scene: show, keep or discard in panel Training"))
        # Numbers of textures mean others in another scene.
        self.plan = replace(self.plan, only=None)
        if was_under_way:
            self._emit(Notification("training was stopped because another scene was opened"))

    def prepare_ahead(self, scene: Scene) -> None:
        """Start the process, and prepare the encoding that a scene without a pack is offered, so that it begins at once when it is
        asked for. No effect while a run is under way, where that was done for the scene, and where memory is short."""
        if self.active is None:
            self._ahead.begin(EncodeScene(self.plan), scene, self._worker)
            self.measure_rates(scene)

    def measure_rates(self, scene: Scene, texture: int | None = None) -> None:
        """Measure the rate curve of a texture of the scene; None: those of the largest ones that the next encoding takes."""
        if texture is not None:
            self.rates.want(scene, [texture])
            return
        self.rates.want(scene, reversed(sampled_textures(self.plan, scene)), self.plan.chosen_maps)

    def pause(self) -> None:
        """Pause the run. Raises InputError where none trains."""
        run = self._training_run()
        if run.state == "training":
            self._worker.pause()
            run.state = "pausing"

    def resume(self) -> None:
        """Go on with the run. Raises InputError where none trains."""
        if self._training_run().state in ("paused", "pausing"):
            self._worker.resume()

    def cancel(self) -> None:
        """End the run; the last pack that it made stays. Raises InputError where there is none."""
        if self.active is None:
            raise InputError("training: no run is under way")
        if self._preparation is not None:
            self._preparation.cancel()
        else:
            self._worker.cancel()
        self.active.state = "cancelling"

    def _training_run(self) -> ActiveRun:
        if self.active is None:
            raise InputError("training: no run is under way")
        if self.active.state == "preparing":
            raise InputError("training: the run has not started yet; wait, or cancel it")
        return self.active

    def keep(self, number: int, path: Path | None) -> None:
        """Write the pack of run `number`, 0 for the chosen one, to `path`; None: where its scene has its packs.

        Raises InputError where there is no such unsaved run, for a pack that cannot be read, and for a path that no pack can have.
        Errors of writing are notified.
        """
        if self.saving:
            raise InputError("training: a pack is being written; try again in a moment")
        run, scene = self.log.unsaved_run(number), self._scene
        assert scene is not None
        self._store.keep(run, scene, self._pack_of(run), path)

    def discard(self, number: int) -> None:
        """Close the pack of run `number`, 0 for the chosen one, and delete its file. It stays in memory until the scene is closed, or
        newer runs replace it. Raises InputError where there is no such unsaved run."""
        run = self.log.unsaved_run(number)
        with suppress(InputError):
            self._pack_of(run)
        self.log.change(replace(self.log[run.number], autosave=None, discarded=True))
        if self.log.chosen == run.number:
            self.log.chosen = None
        self._store.discard(run.autosave)
        self._emit(PackClosed(run.name))

    def open_run(self, number: int) -> str:
        """Open the pack of a run; returns its name. Raises InputError where there is no such run, or its pack cannot be read."""
        run = self.log[number]
        self._emit(PackUpdated(run.name, self._pack_of(run)))
        if self.active is None and not self.saving and run.is_unsaved:
            self.log.chosen = number
        return run.name

    def _pack_of(self, run: Run) -> Pack:
        """Return the pack of a run, from its file where it is not in memory. Raises InputError."""
        if run.pack is not None:
            return run.pack
        if run.file is None or self._scene is None:
            raise InputError(f"run {run.number}: has no pack ({run.fate}); train it again")
        pack = read_pack(run.file)
        require_match(pack, match_scene(pack, self._scene), self._scene.name)
        psnr = run.psnr_db if run.psnr_db is not None else pack_figures(pack).psnr_db
        self.log.change(replace(run, pack=pack, groups=pack.grouping.group_count, psnr_db=psnr))
        return pack

    def leave_scene(self) -> None:
        """End the run under way as far as it is: the scene is about to be closed."""
        run = self.active
        if run is not None:
            if self._preparation is not None:
                self._abandon(self._preparation)
            else:
                self._worker.close()
            self.active = None
            if (pack := run.pack_so_far()) is not None:
                self._store.autosave(pack, run.scene, run.autosave)
        self._scene = None
        self.log = RunLog()
        self.curves = None

    @property
    def is_due(self) -> bool:
        """True if a window at rest should draw a frame, because there may be news."""
        busy = self.active is not None or self._store.busy or self.rates.is_busy
        return busy and time.monotonic() - self._last_tick >= SECONDS_BETWEEN_TICKS

    def tick(self, scene: Scene, shown: frozenset[str], names: Container[str] = ()) -> None:
        """Once a frame: emit what has happened. `scene` is the open one, `shown` the names of the packs in the slots, `names` those
        of all open packs."""
        self._last_tick = time.monotonic()
        self._stopping = [job for job in self._stopping if not job.done]
        if self._packs_to_drop:
            self._packs_to_drop = False
            for name in self.log.drop_old_packs(shown):
                self._emit(PackClosed(name))
        self.enter(scene)
        self._take_saved(shown, names)
        self._ahead.forget_other(scene)
        self.rates.enter(scene)
        self.rates.tick(may_start=self.active is None)
        run = self.active
        if run is None:
            return
        if self._preparation is not None:
            self._take_prepared(run, self._preparation)
        else:
            for report in self._worker.poll():
                self._take(run, report)
            if self.active is run:
                self._publish_snapshots(run)

    def _take_prepared(self, run: ActiveRun, preparation: Job[TrainingRequest]) -> None:
        if not preparation.done:
            return
        self._preparation = None
        try:
            run.request = preparation.result()
            run.pack = self._worker.pack
        except CancelledError:
            pass
        except InputError as error:
            self._emit(Notification(str(error), "error"))
            self._end(run, "failed", None, (str(error),))
            return
        if run.state == "preparing":
            run.state = "training"
        elif self._worker.busy:
            # It was cancelled when the worker had just begun.
            self._worker.cancel()
        else:
            self._end(run, "cancelled", None)
            self._emit(Notification(f"{run.name} was cancelled; it made no pack"))

    def _take(self, run: ActiveRun, report: Report) -> None:
        match report:
            case TrainingProgress():
                run.add_progress(report)
            case GroupSnapshot():
                run.add_snapshot(report.group, self._worker.pack)
                self._publish_snapshots(run)
            case Paused():
                run.state = "paused" if run.state == "pausing" else run.state
            case Resumed():
                run.state = "training" if run.state in ("paused", "pausing") else run.state
            case Finished():
                self._take_finished(run, report)
            case Failed():
                self._emit(Notification(report.line, "error"))
                self._end(run, "failed", run.pack_so_far(), (report.line,))

    def _publish_snapshots(self, run: ActiveRun) -> None:
        is_new = run.groups_seen and run.pack is not run.published and run.is_showable
        self._autosave(run)
        if is_new and run.pack is not None and time.monotonic() - run.published_at >= SECONDS_BETWEEN_UPDATES:
            self._publish(run, run.pack)

    def _autosave(self, run: ActiveRun) -> None:
        if run.pack is run.autosaved or time.monotonic() - run.autosaved_at < SECONDS_BETWEEN_AUTOSAVES:
            return
        if (pack := run.pack_so_far()) is not None:
            run.autosaved, run.autosaved_at = run.pack, time.monotonic()
            run.autosave = self._store.autosave(pack, run.scene, run.autosave)

    def _publish(self, run: ActiveRun, pack: Pack) -> None:
        is_first = run.published is None
        run.published, run.published_at = pack, time.monotonic()
        self._emit(PackUpdated(run.name, pack))
        if is_first:
            run.first_picture_seconds = run.published_at - run.began
            self._emit(PackShown(run.name))

    def _take_finished(self, run: ActiveRun, finished: Finished) -> None:
        lines = tuple(outcome.line() for outcome in finished.outcomes)
        if finished.pack is None:
            pack = run.pack_so_far()
            self._end(run, "cancelled", pack, lines)
            rest = "keep or discard its latest pack" if pack is not None else "it made no pack"
            self._emit(Notification(f"{run.name} was cancelled; {rest}"))
            return
        worse = sum(outcome.rejected for outcome in finished.outcomes)
        groups = counted(len(finished.outcomes), "group")
        unchanged = f"; {worse} of {groups} left unchanged: training gave no better result" if worse else ""
        self._end(run, finished.reason, finished.pack, lines)
        self._emit(Notification(f"{run.name} ({job_title(run.job)}): {finished.reason}{unchanged}. Keep or discard it"))

    def _end(self, run: ActiveRun, outcome: str, pack: Pack | None, lines: tuple[str, ...] = ()) -> None:
        """Log the run; one that made no pack is closed."""
        self.active = None
        if pack is None and run.published is not None:
            self._emit(PackClosed(run.name))
        if pack is not None:
            self._publish(run, pack)
            run.autosave = self._store.autosave(pack, run.scene, run.autosave)
        self.log.add(run.ended(outcome, pack, lines))
        self._packs_to_drop = True

    def _take_saved(self, shown: frozenset[str], names: Container[str]) -> None:
        for saved_run in self._store.take_saved():
            if saved_run.scene is not self._scene:
                continue
            run, path = self.log[saved_run.run.number], saved_run.pack.path
            assert path is not None
            name = unused_name(saved_run.pack.grouping.name, path, names)
            changed = replace(run, pack=saved_run.pack, saved=path, autosave=None, discarded=False, open_as=name)
            self.log.change(changed)
            if self.log.chosen == run.number:
                self.log.chosen = None
            self._emit(PackUpdated(run.name, saved_run.pack))
            self._emit(PackRenamed(run.name, name))
            if run.name not in shown:
                # Otherwise an older pack of this grouping would look like the one that was written.
                self._emit(PackShown(name))

    def _abandon(self, preparation: Job[TrainingRequest]) -> None:
        """The thread of `preparation` may be using the worker: both are left to end, and there is a new worker."""
        worker, self._worker, self._preparation = self._worker, TrainingWorker(), None
        self._ahead = AheadPreparation()
        preparation.cancel()

        def end(_report: JobReport) -> None:
            preparation.join(SECONDS_TO_END)
            worker.close()

        self._stopping.append(Job(end).start("end training"))

    def close(self) -> None:
        """End the process and the threads; packs that are being written are finished, and the run under way is autosaved."""
        if self._scene is not None:
            self.leave_scene()
        self._store.close()
        for job in self._stopping:
            job.join(SECONDS_TO_STOP)
        self._ahead.end()
        self.rates.close()
        self._worker.close()
        self.active = None
