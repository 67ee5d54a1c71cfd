"""Jobs: functions that run in threads beside the frames, with progress and results. `Background` runs one after the other."""

import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable
from concurrent.futures import CancelledError, Future, wait
from typing import Any, Generic, TypeVar

from ntc.errors import InputError
from viewer.scene.json_text import time_left

Result = TypeVar("Result")
RESULTS_KEPT = 8
SECONDS_TO_CLOSE = 2.0
SECONDS_BETWEEN_CHECKS = 0.02


class JobReport:
    """Progress of a running job. The job writes it; the window's thread reads it, and may cancel."""

    def __init__(self, changed: Callable[[], None] = lambda: None) -> None:
        """`changed` is called in the job's thread after each report."""
        self._changed = changed
        self.cancelled = False
        self.began = time.monotonic()
        """Monotonic time in seconds at which the job began; until then, at which it was submitted."""
        self.share = 0.0
        """Progress of the job, 0 to 1."""
        self.partial: object = None
        """A first result to show until the job is done."""

    @property
    def seconds(self) -> float:
        """Time in seconds since the job began."""
        return time.monotonic() - self.began

    @property
    def seconds_left(self) -> float | None:
        """Time left in seconds, None while it is unknown (`time_left`)."""
        return time_left(self.seconds, self.share)

    def progress(self, done: int, of: int) -> None:
        """Report that `done` of `of` steps are done. Raises CancelledError where the job is to end."""
        self.check()
        self.share = done / max(of, 1)
        self._changed()

    def show(self, partial: object) -> None:
        """Hand over a first result. Raises CancelledError where the job is to end."""
        self.partial = partial
        self.progress(0, 1)

    def check(self) -> None:
        """Raises CancelledError where the job is to end."""
        if self.cancelled:
            raise CancelledError


class Job(Generic[Result]):
    """One call of `work(report)`, and the `concurrent.futures.Future` of its result.

    The threads of `ThreadPoolExecutor` do not fit: Python waits for them when the program ends, however long their work takes.
    Those of jobs are daemons.
    """

    def __init__(self, work: Callable[[JobReport], Result], changed: Callable[[], None] = lambda: None) -> None:
        self._work = work
        self.report = JobReport(changed)
        self.future: Future[Result] = Future()

    def start(self, name: str) -> "Job[Result]":
        """Run in a new daemon thread called `name`."""
        threading.Thread(target=self.run, name=name, daemon=True).start()
        return self

    def run(self) -> None:
        """Run in this thread. Whatever the work raises becomes the exception of the future."""
        if self.future.set_running_or_notify_cancel():
            self.report.began = time.monotonic()
            try:
                self.future.set_result(self._work(self.report))
            except BaseException as error:  # noqa: BLE001  It is raised again where the result is asked for.
                self.future.set_exception(error)

    def cancel(self) -> None:
        """Keep the job from starting, or end it at its next report."""
        self.report.cancelled = True
        self.future.cancel()

    def join(self, seconds: float) -> None:
        """Wait for the end, at most `seconds`."""
        wait([self.future], seconds)

    @property
    def done(self) -> bool:
        """True if there is a result, an error, or the job was cancelled."""
        return self.future.done()

    def result(self) -> Result:
        """Return what the work returned, once done. Raises CancelledError where it was cancelled, and InputError for every other
        error."""
        try:
            return self.future.result(0.0)
        except (InputError, CancelledError):
            raise
        except Exception as error:
            raise InputError(f"{type(error).__name__}: {error}") from error

    @property
    def problem(self) -> str:
        """The error that ended a job that is done, as one line; "" for none."""
        error = CancelledError("cancelled") if self.future.cancelled() else self.future.exception(0.0)
        return "" if error is None else " ".join(str(error).split()) or type(error).__name__


class Background:
    """Runs jobs by key, the latest one first, and notes when there is something new to show. Called from the window's thread."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._jobs: OrderedDict[Hashable, Job[Any]] = OrderedDict()
        """Jobs that are done, in the order in which they ended, and the others, in the order in which they were submitted."""
        self._running: Job[Any] | None = None
        self._thread: threading.Thread | None = None
        self._news = False
        self._closing = False

    def submit(self, key: Hashable, work: Callable[[JobReport], Result]) -> Job[Result]:
        """Return the job under `key`; a new one, that calls `work`, where there is none."""
        with self._condition:
            if key not in self._jobs:
                self._jobs[key] = Job(work, self._note_news)
                if self._thread is None:
                    self._thread = threading.Thread(target=self._work, name="background", daemon=True)
                    self._thread.start()
                self._condition.notify()
            return self._jobs[key]

    def cancel(self, key: Hashable) -> None:
        """Cancel the job under `key`; a job that is done keeps its result."""
        with self._condition:
            if key in self._jobs and not self._jobs[key].done:
                self._jobs.pop(key).cancel()

    def forget(self) -> None:
        """Cancel all jobs and drop all results: what they are about is closed."""
        with self._condition:
            for job in self._jobs.values():
                job.cancel()
            self._jobs.clear()

    def take_news(self) -> bool:
        """Return whether a job has reported or ended since the last call."""
        news, self._news = self._news, False
        return news

    @property
    def is_busy(self) -> bool:
        """True if something runs or waits."""
        with self._condition:
            return self._running is not None or self._next() is not None

    def close(self) -> None:
        """End the thread; the job that runs ends at its next report."""
        self.forget()
        with self._condition:
            self._closing = True
            self._condition.notify()
        if self._thread is not None:
            # A job that does not report for long must not keep the window from closing: the thread is a daemon.
            self._thread.join(SECONDS_TO_CLOSE)
            self._thread = None

    def _note_news(self) -> None:
        self._news = True

    def _next(self) -> Hashable | None:
        """Return the key of the latest job that waits: it is what the user looks at."""
        return next((key for key in reversed(self._jobs) if not self._jobs[key].done), None)

    def _work(self) -> None:
        while True:
            with self._condition:
                self._condition.wait_for(lambda: self._closing or self._next() is not None)
                key = self._next()
                if key is None:
                    return
                job = self._running = self._jobs[key]
            job.run()
            with self._condition:
                self._running = None
                if self._jobs.get(key) is job:
                    self._jobs.move_to_end(key)
                    done = [key for key, job in self._jobs.items() if job.done]
                    for old in done[:-RESULTS_KEPT]:
                        del self._jobs[old]
            self._news = True
