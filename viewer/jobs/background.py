"""Jobs by key, one after the other in one thread; the last results are kept."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any

from viewer.jobs.job import Job, JobReport, Result

RESULTS_KEPT = 8
SECONDS_TO_CLOSE = 2.0


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
        """The job under `key`; a new one, that calls `work`, where there is none."""
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
        """Whether a job has reported or ended since the last call."""
        news, self._news = self._news, False
        return news

    @property
    def is_busy(self) -> bool:
        """Whether something runs or waits."""
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
        """Key of the latest job that waits: it is what the user looks at."""
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
