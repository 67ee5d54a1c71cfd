"""What is done before a training is asked for: its process is started, and the encoding that a scene is offered is prepared."""

from concurrent.futures import CancelledError
from dataclasses import replace
from pathlib import Path

from ntc.training.request import TrainingRequest
from ntc.worker.client import TrainingWorker
from viewer.jobs.job import Job, JobReport
from viewer.scene.model import Scene
from viewer.training.preparation import EncodeScene, TrainingJob, prepare
from viewer.training.settings import DEFAULT_BUDGET

LEAST_MEMORY = 2_000_000_000
"""Bytes that must be free: the process takes about 250 MB before it trains, and the prepared textures a share of the scene's."""
MEMORY_FILE = Path("/proc/meminfo")
SECONDS_BETWEEN_CHECKS = 0.02
SECONDS_TO_END = 3.0


def free_memory() -> int | None:
    """Bytes that programs can still have; None where the system does not say."""
    try:
        for line in MEMORY_FILE.read_text().splitlines():
            name, _, amount = line.partition(":")
            if name == "MemAvailable":
                return int(amount.split()[0]) * 1024
    except (OSError, ValueError, IndexError):
        return None
    return None


class AheadPreparation:
    """The encoding of one scene, prepared before it is asked for."""

    def __init__(self) -> None:
        self._job: EncodeScene | None = None
        self._scene: Scene | None = None
        self._preparation: Job[TrainingRequest] | None = None

    def begin(self, job: EncodeScene, scene: Scene, worker: TrainingWorker) -> None:
        """Start the process of `worker` and prepare `job`, in a thread. No effect where that was begun for the scene, and where memory
        is short.

        No other code uses the worker until `take` has returned in the thread of another preparation, or `end` has.
        """
        if self._scene is scene:
            return
        before = self._preparation
        self.forget()
        self._job, self._scene = job, scene
        memory = free_memory()
        if memory is not None and memory < LEAST_MEMORY:
            return

        def begin(report: JobReport) -> TrainingRequest:
            if before is not None:
                before.join(SECONDS_TO_END)
            worker.warm_up()
            return prepare(job, scene, None, report)

        self._preparation = Job(begin).start("prepare ahead")

    def take(self, job: TrainingJob, scene: Scene, report: JobReport) -> TrainingRequest | None:
        """The request for `job`, as soon as it is prepared; None where nothing like it was. To be called in a thread.

        Raises what preparing raised, and CancelledError where `report` is cancelled.
        """
        preparation, self._preparation = self._preparation, None
        if preparation is None:
            return None
        wanted = self._scene is scene and self._job is not None and _prepared_as(job) == _prepared_as(self._job)
        if not wanted:
            preparation.cancel()
        while not preparation.done:
            try:
                report.check()
            except CancelledError:
                preparation.cancel()
                preparation.join(SECONDS_TO_END)
                raise
            preparation.join(SECONDS_BETWEEN_CHECKS)
        return replace(preparation.result(), budget=job.settings.budget) if wanted else None

    def forget_other(self, scene: Scene) -> None:
        """Drop what belongs to another scene than `scene`."""
        if self._scene is not None and self._scene is not scene:
            self.forget()

    def forget(self) -> None:
        """Drop what there is, without waiting."""
        if self._preparation is not None:
            self._preparation.cancel()
        self._job = self._scene = None

    def end(self) -> None:
        """End what is under way; waits for its thread."""
        self.forget()
        if self._preparation is not None:
            self._preparation.join(SECONDS_TO_END)
            self._preparation = None


def _prepared_as(job: TrainingJob) -> TrainingJob:
    """`job` without what its preparation does not depend on."""
    settings = replace(job.settings, codec=job.settings.codec_kind, budget=DEFAULT_BUDGET)
    return replace(job, settings=settings)
