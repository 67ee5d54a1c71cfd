"""Jobs: functions that run in threads beside the frames, with progress, cancelling and results.

`Background` runs jobs in one thread, the latest first, because the user looks at what was asked for last. Callers ask for a key in
every frame: the first time submits the job, later times return it. Results of the last MOST_RESULTS jobs stay until they are dropped.
A cancelled job ends at its next report of progress, which raises CancelledError in it.
"""

import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable
from concurrent.futures import CancelledError, Future, wait
from typing import Any, Generic, TypeVar

from ntc.errors import InputError
from viewer.scene.json_text import time_left

Result = TypeVar("Result")
MOST_RESULTS = 8
SECONDS_TO_CLOSE = 2.0
SECONDS_BETWEEN_CHECKS = 0.02


class JobReport:
    """Progress of a running job. The job writes it; the window's thread reads it, and may cancel."""

    def __init__(self, changed: Callable[[], None] = lambda: None) -> None:
        """Make a report of a new job. `changed` is called in the job's thread after each report."""
        self._changed = changed
        self.cancelled = False
        self.began = time.monotonic()
        """Monotonic time in seconds at which the job began, or at which it was submitted while it waits."""
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
        """Report that `done` of `of` steps are done. Raises CancelledError in a cancelled job."""
        self.check()
        self.share = done / max(of, 1)
        self._changed()

    def show(self, partial: object) -> None:
        """Hand over a first result. Raises CancelledError in a cancelled job."""
        self.partial = partial
        self.progress(0, 1)

    def check(self) -> None:
        """End a cancelled job. Raises CancelledError."""
        if self.cancelled:
            raise CancelledError


class Job(Generic[Result]):
    """Call of `work(report)` in a thread, with the `concurrent.futures.Future` of its result.

    Threads are daemons. At exit Python would wait for the threads of a `ThreadPoolExecutor`, however long their work takes.
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
        """Run in this thread. An exception of the work becomes the exception of the future."""
        if self.future.set_running_or_notify_cancel():
            self.report.began = time.monotonic()
            try:
                self.future.set_result(self._work(self.report))
            except BaseException as error:  # noqa: BLE001  `result` raises it again.
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
        """True if the job has a result or an error, or was cancelled."""
        return self.future.done()

    def result(self) -> Result:
        """Return the result of a job that is done. Raises CancelledError where it was cancelled, and InputError for every other
        error."""
        try:
            return self.future.result(0.0)
        except (InputError, CancelledError):
            raise
        except Exception as error:
            raise InputError(f"{type(error).__name__}: {error}") from error

    @property
    def problem(self) -> str:
        """Error of a job that is done, one line; "" for none."""
        error = CancelledError("cancelled") if self.future.cancelled() else self.future.exception(0.0)
        return "" if error is None else " ".join(str(error).split()) or type(error).__name__


class Background:
    """Thread that runs jobs by key, the latest first, and notes when a job has news. Called from the window's thread."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._jobs: OrderedDict[Hashable, Job[Any]] = OrderedDict()
        """Jobs: first those that are done, in the order of their ends, then the others, in the order of their submission."""
        self._running: Job[Any] | None = None
        self._thread: threading.Thread | None = None
        self._news = False
        self._closing = False

    def submit(self, key: Hashable, work: Callable[[JobReport], Result]) -> Job[Result]:
        """Return the job under `key`. If there is none, a new job that calls `work` is submitted."""
        with self._condition:
            if key not in self._jobs:
                self._jobs[key] = Job(work, self._note_news)
                if self._thread is None:
                    self._thread = threading.Thread(target=self._work, name="background", daemon=True)
                    self._thread.start()
                self._condition.notify()
            return self._jobs[key]

    def cancel(self, key: Hashable) -> None:
        """Cancel the job under `key`. The result of a job that is done stays."""
        with self._condition:
            if key in self._jobs and not self._jobs[key].done:
                self._jobs.pop(key).cancel()

    def forget(self) -> None:
        """Cancel all jobs and drop all results, because the scene or pack that they belong to is closed."""
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
        """True if a job runs or waits."""
        with self._condition:
            return self._running is not None or self._next() is not None

    def close(self) -> None:
        """End the thread. The running job ends at its next report."""
        self.forget()
        with self._condition:
            self._closing = True
            self._condition.notify()
        if self._thread is not None:
            # A job that rarely reports must not delay closing the window: its daemon thread is abandoned.
            self._thread.join(SECONDS_TO_CLOSE)
            self._thread = None

    def _note_news(self) -> None:
        self._news = True

    def _next(self) -> Hashable | None:
        """Return the key of the latest job that waits, because the user looks at its result."""
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
                    for old in done[:-MOST_RESULTS]:
                        del self._jobs[old]
            self._news = True
